"""The decision by hues on an image of the other side.

Inside: light moves the hues of all inks together, which is not visible in the result of a single picture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor import Reason
from extractor.numbering.other_side import reason_by_hues


def test_other_hues_leave_the_cause_open() -> None:
    """In light that moves hues, the reason names neither the side nor the channels alone."""
    palette = np.array([2.0, 131.0, 234.0])

    def inks(hues_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        """R, G, B of these hues (the hexagonal hue of HSV), with some grey."""
        angle = (hues_deg[:, None] / 60 + np.array([0.0, 4.0, 2.0])) % 6
        return 40 + 150 * np.clip(np.abs(angle - 3) - 1, 0, 1)

    as_seen = inks(palette)
    assert reason_by_hues(as_seen, palette) is Reason.MIRRORED
    assert reason_by_hues(as_seen[::-1, ::-1], palette) is Reason.SWAPPED_CHANNELS
    assert reason_by_hues(inks(palette + np.array([15.0, -20.0, 25.0])), palette) is Reason.OTHER_SIDE
    # halfway between both
    halfway = palette + np.array([0.0, -11.0, 0.0])
    assert reason_by_hues(inks(halfway), palette) is Reason.OTHER_SIDE
    assert reason_by_hues(np.full((3, 3), np.nan), palette) is Reason.OTHER_SIDE
