"""The matched filter across the gridlines: rows of pixels are compared with a blurred step.

The weight of a pixel is the derivative of the step, so that the weighted sums give the offset of the gridline from its
expected place.
"""

from __future__ import annotations

from typing import NamedTuple


class MatchedFilterLimits(NamedTuple):
    """Limits of the rows of pixels across a gridline.

    Attributes:
        reach_sigma: in units of the blur, the reach of a row to each side. Derived: erf(1.3), 93 % of what a gridline
            tells, lies within.
        clear_sigma: in units of the blur, the least distance of the other gridline of a corner from a row. Chosen.
        max_reach: of the cell's height, the reach of a row at most. Chosen.
        min_end_share, max_end_share: of the gridline, the part at each end without rows, at least and at most. Chosen.
        min_offset_px, max_offset_share: px, and of the gridline's length; a gridline whose offset exceeds the larger of
            both is not read. Chosen.
    """

    reach_sigma: float = 1.3
    clear_sigma: float = 2.6
    max_reach: float = 0.33
    min_end_share: float = 0.1
    max_end_share: float = 0.4
    min_offset_px: float = 1.0
    max_offset_share: float = 0.15


LIMITS = MatchedFilterLimits()
