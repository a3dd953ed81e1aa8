"""Bleed: the blur brings the neighbours' levels into a cell's middle. Levels with the bleed removed, or adapted.

A level is the mean of a disc in the middle of the cell. Each of the three neighbours has a share in that mean, which
depends on the distance from the disc to the side between the cells, in units of the blur.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import synthesis as native
from extractor.refine.synthesis.ink_levels import LIMITS as LEVEL_LIMITS
from extractor.refine.synthesis.ink_levels import DiscLimits, InkLevels


class BleedLimits(NamedTuple):
    """Limits of bleed.

    Attributes:
        max_bleed: share of a neighbour in a cell's mean, the most that is corrected. Chosen.
        disc: limits of the disc in a cell's middle.
    """

    max_bleed: float = 0.1
    disc: DiscLimits = LEVEL_LIMITS.disc


LIMITS = BleedLimits()


def remove_bleed(
    levels: InkLevels, color: NDArray[np.int32], share: NDArray[np.float64], median_share: float
) -> InkLevels:
    """The levels without bleed.

    Args:
        levels: with bleed.
        color: (K,) the cells' inks.
        share: (K,) the share of each neighbour; ``median_share`` stands for NaN.
    """
    return InkLevels(*native.remove_bleed(levels, color, share, median_share, LIMITS))
