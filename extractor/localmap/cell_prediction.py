"""Predicts the image places of the down-cells around numbered cells.

The three cells next to a place predict the place best. Cells farther away are used only for places that the nearer
cells leave open and that are possible origins of the pattern.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import localmap as native


class CellPredictionLimits(NamedTuple):
    """Limits of the prediction of down-cells.

    Attributes:
        max_outside_share: of a component's cells, outside the layout at an admissible origin. Chosen.
        min_determinant: of the sums of squared axial steps to a cell's neighbours; below it they lie on one line.
            Derived: of whole numbers, it is 0 or at least 1.
        white_reaches: distances from the nearest numbered cell, in edges, within which the white cell is searched, ring
            by ring; four, as in native/localmap/cell_prediction.hpp. Measured: rule "far white cell".
    """

    max_outside_share: float = 0.02
    min_determinant: float = 0.5
    white_reaches: tuple[float, float, float, float] = (0.7, 1.7, 2.7, 3.7)


LIMITS = CellPredictionLimits()


class KnownCells(NamedTuple):
    """The K cells that predict.

    Attributes:
        cells: (K,) int64, the cells of the image.
        basis: (K, 2, 2) float64, px per axial step.
        radius_px: (K,) float64, over which the cell's color is sampled.
        level: (K,) float64, the sum of its channels, NaN outside the image.
    """

    cells: NDArray[np.int64]
    basis: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    level: NDArray[np.float64]


def lattice_bases(
    center: NDArray[np.float64], axial: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The local bases of the lattice, by least squares over the six neighbours of each cell.

    Args:
        center: (N, 2) px; axial: (N, 2) int32, ``UNKNOWN_AXIAL`` for unknown.

    Returns:
        (K,) int64, the cells with enough neighbours, and (K, 2, 2) float64, px per axial step at each.
    """
    known, basis = native.lattice_bases(center, axial, LIMITS)
    return known, basis
