"""Dot gain: all cells look larger by the same width, because inks bleed or the camera is not linear.

Every gridline is then shifted towards the black beside the gridline. Around a marker where colored and black cells
alternate, these shifts cancel. At the pattern's rim they do not: an acute corner there moves outward by several widths.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import synthesis as native


class DotGainLimits(NamedTuple):
    """Limits of dot gain.

    Attributes:
        min_gridlines, max_gridlines: gridlines that the dot gain is measured from; with no more than the least, it is
            taken as 0, and of more than the most, every n-th is used. Chosen.
        min_dot_gain: in units of the blur; drawings, compression and glare look like less, which is taken as 0. Chosen.
        min_sine: of the angle of a corner; a sharper corner moves no farther. Chosen.
    """

    min_gridlines: int = 40
    max_gridlines: int = 250
    min_dot_gain: float = 0.1
    min_sine: float = 0.2


LIMITS = DotGainLimits()


def markers_without_dot_gain(
    xy: NDArray[np.float64], cells: NDArray[np.int32], dot_gain: float
) -> NDArray[np.float64]:
    """(M, 2) px: markers ``xy``, which are means of the corners of the enlarged cells (K, 3), moved back inward."""
    return np.asarray(native.markers_without_dot_gain(xy, cells, dot_gain, LIMITS))
