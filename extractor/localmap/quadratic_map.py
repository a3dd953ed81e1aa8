"""Predicts a detached cell's place in the layout by a quadratic map through the numbered cells nearest to it.

These numbered cells are its support cells. The map goes from the image to the layout.
"""

from __future__ import annotations

from typing import NamedTuple


class QuadraticMapLimits(NamedTuple):
    """Limits of the map of a detached cell.

    Attributes:
        max_support_distance: in cells, from the nearest support cell; farther away a place is uncertain. Chosen.
        max_deviation: in cells, of the predicted place; beyond it the place is uncertain. Chosen.
        robust_rounds: of least squares; support cells cut by dirt are outliers. Chosen.
        exact_misfit: in cells; smaller misfits keep the full weight. Chosen.
        distance_softening: in squares of the support cells' mean distance; added to the squared distance by which a
            support cell's weight is divided. Chosen.
        ridge: regularises the curvature where the support cells lie in a row. Chosen.
        min_pivot: of the normal matrix, against its largest entry; below it the support cells lie in a row. Chosen.
    """

    max_support_distance: float = 4.5
    max_deviation: float = 0.12
    robust_rounds: int = 4
    exact_misfit: float = 0.02
    distance_softening: float = 0.3
    ridge: float = 1e-3
    min_pivot: float = 1e-7


LIMITS = QuadraticMapLimits()
