"""Dot gain: all cells look larger by the same width, because inks bleed or the camera is not linear.

Every gridline is then shifted towards the black beside the gridline. Around a marker where colored and black cells
alternate, these shifts cancel. At the pattern's rim they do not: an acute corner there moves outward by several widths.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure as native


def markers_without_dot_gain(
    xy: NDArray[np.float64], cells: NDArray[np.int32], dot_gain: float
) -> NDArray[np.float64]:
    """(M, 2) px: markers ``xy``, which are means of the corners of the enlarged cells (K, 3), moved back inward."""
    return native.markers_without_dot_gain(xy, cells, dot_gain)
