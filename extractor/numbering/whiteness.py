"""Measures the inks, and the brightness and whiteness of predicted places.

The brightness is the sum of the channels, relative to that of the inks around. In light of any color, each channel of
white is about as strong as in the ink with most of that channel; colored dirt has a weaker channel. The whiteness is
the weakest of these ratios.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.localmap.cell_prediction import KnownCells


class WhitenessLimits(NamedTuple):
    """Limits of whiteness.

    Attributes:
        sample_radius: of a color sample, relative to the square root of the cell's area. Chosen.
    """

    sample_radius: float = 0.1


LIMITS = WhitenessLimits()


class InkColors(NamedTuple):
    """The inks in the image.

    Attributes:
        colors: (4, 3) float64, median BGR of red, green and blue in rows 1 to 3; 0 for an absent ink.
        strongest: (3,) float64, the maximum of each channel.
    """

    colors: NDArray[np.float64]
    strongest: NDArray[np.float64]


def measure_inks(
    image: NDArray[np.uint8],
    center: NDArray[np.float64],
    area: NDArray[np.float64],
    ink: NDArray[np.uint8],
    known: NDArray[np.int64],
    basis: NDArray[np.float64],
) -> tuple[KnownCells, InkColors]:
    """Measure the levels of known cells and the inks.

    Args:
        image: (H, W, 3) uint8 BGR.
        center: (N, 2) px; area: (N,) px^2; ink: (N,) uint8, the cells of the image.
        known: (K,) int64 and basis: (K, 2, 2), by ``lattice_bases``.
    """
    radius, level, colors, strongest = native.measure_inks(image, center, area, ink, known, LIMITS)
    return KnownCells(known, basis, radius, level), InkColors(colors, strongest)
