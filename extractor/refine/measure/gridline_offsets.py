"""Offsets of the gridlines at virtual markers, measured at the last comparison of the image with the pattern.

Rounded corners, halos and inks whose response differs shift the sides of all cells alike, by an amount that depends on
the ink and on the place along the side: its profile. A profile is no shape of the surface, because colored cells lie on
alternate sides of the gridlines. The median profile of each ink over the picture is removed from the offsets.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure as native
from extractor.image.pyramid import PyramidLevel


class GridlineReading(NamedTuple):
    """The gridlines and the levels beside them, at the last comparison of the image with the pattern.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        sides: (E, 6), the light on both sides, as ``GridlineSides`` gives it.
        station_sums: (E, m, 2), of the pixels around each virtual marker, the weighted residual and the information.
        weight: (E,) 0 to 1.
        variance_ratio: (E,), as ``variance_ratios`` gives it.
        dot_gain_offset: (E,) px, the shift of the gridline towards (-uy, ux) by dot gain.
        sigma: px, the blur.
        noise: gray levels.
    """

    lines: NDArray[np.float64]
    sides: NDArray[np.float64]
    station_sums: NDArray[np.float64]
    weight: NDArray[np.float64]
    variance_ratio: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]
    sigma: float
    noise: float


def measure_virtual_markers(view: PyramidLevel, reading: GridlineReading) -> NDArray[np.float64]:
    """The virtual markers measured in the image.

    Args:
        view: the image.
        reading: of the same image.

    Returns:
        (E, m, 3): x and y, px at full scale, and the variance across the gridline, px^2; NaN where not measured.
    """
    offsets = native.measure_offsets(view, reading)
    return native.virtual_markers(reading.lines, offsets, view.scale)
