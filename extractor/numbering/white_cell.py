"""Decides whether a bright place is the white cell: white inside and not white outside.

The numbered cells predict place and size by a quadratic map from the layout to the image. A scratch across a black
cell, a crossing of two scratches, a drop or a reflection fail the test, and so does the white cell one step aside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# The corners of a down-cell relative to its center, in axial steps: below, upper right and upper left; as CORNERS in
# extractor/native/numbering/white_cell.cpp.
CORNERS = np.array([[1, -2], [1, 1], [-2, 1]]) / 3
# Points in the corners and towards corners and sides; outside points beyond the corners and beyond three points of each
# side.
INSIDE_POINTS = np.concatenate([0.85 * CORNERS, 0.5 * CORNERS, -0.33 * CORNERS])
SIDE_POINTS = [
    one + share * (two - one) for one, two in CORNERS[[[0, 1], [1, 2], [2, 0]]] for share in (0.25, 0.5, 0.75)
]
OUTSIDE_POINTS = np.concatenate(
    [1.7 * CORNERS, np.array(SIDE_POINTS) - 0.25 * CORNERS[[2, 2, 2, 0, 0, 0, 1, 1, 1]]]
)
GRID, GRID_REACH = 4, 0.8  # half width in points and in axial steps of the grid for the centroid; chosen
GRID_STEPS = np.arange(-GRID, GRID + 1)
CENTROID_POINTS = (
    GRID_REACH / GRID * np.array([[a, b] for a in GRID_STEPS for b in GRID_STEPS if abs(a + b) <= GRID])
)


class WhiteCellPoints(NamedTuple):
    """The places that are sampled, as axial steps from the center of the white cell.

    Attributes:
        inside: (P, 2) float64, in the three corners, then anywhere in the cell.
        outside: (Q, 2) float64, beyond the corners and the sides.
        centroid: (R, 2) float64, a grid.
    """

    inside: NDArray[np.float64] = INSIDE_POINTS
    outside: NDArray[np.float64] = OUTSIDE_POINTS
    centroid: NDArray[np.float64] = CENTROID_POINTS


class WhiteCellLimits(NamedTuple):
    """Limits of the white cell.

    Whiteness is scaled from 0 for the palest of inks and black to 1 for the middle of the cell.

    Attributes:
        max_fit_cells: numbered cells nearest to the white cell, for its prediction. Chosen.
        min_fit_cells: with fewer there is no prediction. Derived: a linear map has three coefficients.
        ridge: of the cells' total weight; regularises the map's curvature where all these cells lie on one side.
            Chosen.
        weight_softening: a cell's weight is the inverse of this plus the square of its distance, in units of the cells'
            root mean square distance. Chosen.
        min_pivot_share: of the cells' total weight, the least square of the pivot of the slope across; below it the
            cells lie on one line. Chosen.
        max_predicted_deviation: in edges, of the prediction. Chosen.
        max_centroid_distance: in edges, from prediction to centroid of the white; the next black cell is at 1.
            Measured: rule "white centroid".
        min_inside: whiteness within the cell. Measured: rule "white triangle".
        min_corner: whiteness in the corners. Measured: rule "white triangle".
        max_outside: whiteness outside the cell. Measured: rule "white triangle".
        min_reach: whiteness above the ground, the least of the middle that the other places are compared with. Derived:
            it only keeps a division from failing.
        sample_radius: of a color sample, relative to the square root of the area spanned by the axial steps. Chosen.
        points: the places that are sampled.
    """

    max_fit_cells: int = 16
    min_fit_cells: int = 3
    ridge: float = 0.02
    weight_softening: float = 0.3
    min_pivot_share: float = 1e-4
    max_predicted_deviation: float = 0.15
    max_centroid_distance: float = 0.3
    min_inside: float = 0.5
    min_corner: float = 0.25
    max_outside: float = 0.5
    min_reach: float = 1e-3
    sample_radius: float = 0.1
    points: WhiteCellPoints = WhiteCellPoints()


LIMITS = WhiteCellLimits()


class WhiteCellLayout(NamedTuple):
    """The layout for the search of the white cell.

    Attributes:
        layers: number of layers.
        cell_lookup: (S, S) int32, as ``Lattice.cell_lookup``.
        white_mm: (2,) float64, the center of the white cell.
        axial_mm: (2, 2) float64, mm per axial step there.
        center_mm: (U, 2) float64, the centers of the colored cells.
    """

    layers: int
    cell_lookup: NDArray[np.int32]
    white_mm: NDArray[np.float64]
    axial_mm: NDArray[np.float64]
    center_mm: NDArray[np.float64]
