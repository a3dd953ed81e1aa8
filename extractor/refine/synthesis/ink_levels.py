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
    return native.level_change(before, now)
