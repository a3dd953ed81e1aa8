"""Bleed: the blur brings the neighbours' levels into a cell's middle. Levels with the bleed removed, or adapted.

A level is the mean of a disc in the middle of the cell. Each of the three neighbours has a share in that mean, which
depends on the distance from the disc to the side between the cells, in units of the blur.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import synthesis as native
from extractor.refine.synthesis.ink_levels import InkLevels


def remove_bleed(
    levels: InkLevels, color: NDArray[np.int32], share: NDArray[np.float64], median_share: float
) -> InkLevels:
    """The levels without bleed.

    Args:
        levels: with bleed.
        color: (K,) the cells' inks.
        share: (K,) the share of each neighbour; ``median_share`` stands for NaN.
    """
    return native.remove_bleed(levels, color, share, median_share)
