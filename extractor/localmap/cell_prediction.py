"""Predicts the image places of the down-cells around numbered cells.

The three cells next to a place predict the place best. Cells farther away are used only for places that the nearer
cells leave open and that are possible origins of the pattern.
"""

from __future__ import annotations

from typing import NamedTuple


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
