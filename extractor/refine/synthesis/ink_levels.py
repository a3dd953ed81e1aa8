"""The ink levels of one image: a level for every cell, from the cell itself and from all cells of its ink.

A cell's own level is noisy, and half of the error would go into its gridlines. Light and print vary smoothly from cell
to cell in most images, and a low polynomial over the image, fitted robustly to each ink, has much less noise. Every
level is moved towards the polynomial by the share of noise in the cells' scatter about the polynomial. Where the
scatter is not noise (uneven print, hard shadows, a missing cell) the cell's own level is kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import synthesis as native
from extractor.refine.synthesis.ink_polynomials import LIMITS as POLYNOMIAL_LIMITS
from extractor.refine.synthesis.ink_polynomials import PolynomialLimits


class DiscLimits(NamedTuple):
    """Limits of the disc in a cell's middle, whose mean is the cell's level.

    Attributes:
        disc_share: of the inscribed circle's radius, the disc of a cell's level at most. Chosen.
        first_disc_share: the same where nothing is drawn yet, and the neighbours' ink bleeds into the disc. Chosen.
        clear_sigma: in units of the blur, the distance of the disc from the cell's sides. Chosen.
        min_radius_px: px, of the disc. Chosen.
    """

    disc_share: float = 0.55
    first_disc_share: float = 0.47
    clear_sigma: float = 2.2
    min_radius_px: float = 0.75


class InkLevelLimits(NamedTuple):
    """Limits of ink levels.

    Attributes:
        cells_for_terms: from so many cells on, so many terms of an ink's polynomial. Derived: polynomials of degree 3,
            2, 1 and 0 have so many; the cells are chosen.
        disc: of the disc in a cell's middle.
        polynomial: of the robust fit.
    """

    cells_for_terms: tuple[tuple[int, int], ...] = ((40, 10), (18, 6), (8, 3), (1, 1))
    disc: DiscLimits = DiscLimits()
    polynomial: PolynomialLimits = POLYNOMIAL_LIMITS


LIMITS = InkLevelLimits()


class InkLevels(NamedTuple):
    """The levels of the inks in an image, as light (0 to 255).

    Attributes:
        cell: (K, 3) levels of the drawn cells over black, at their centroids.
        slope: (K, 3, 2) levels per px along x and y.
        black: (3, 10) the polynomial of the black.
        is_outlier: (K,) bool, cells that do not look like the other cells of their ink.
    """

    cell: NDArray[np.float64]
    slope: NDArray[np.float64]
    black: NDArray[np.float64]
    is_outlier: NDArray[np.bool_]


def level_change(before: NDArray[np.float64], now: NDArray[np.float64]) -> float:
    """The median change of the cells' levels (K, 3), in units of their median level."""
    return float(native.level_change(before, now))
