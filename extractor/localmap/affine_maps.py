"""Local linear maps from the layout to the image around every numbered cell, in pixels per millimetre."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import localmap as native
from extractor.layout.lattice_tables import LayoutCells


class AffineMapLimits(NamedTuple):
    """Limits of linear maps.

    Attributes:
        min_spread: least ratio of the neighbours' spread across to along; below it they lie on one line. Chosen.
        max_misfit: of the distance to a neighbour, from its center to the prediction by a triangle. Measured: rule
            "mapped by triangle".
        min_rival_misfit: the same for the triangle rotated by 120 degrees, which mispredicts by 1.7 distances. Chosen
            below that.
    """

    min_spread: float = 0.2
    max_misfit: float = 0.3
    min_rival_misfit: float = 0.8


LIMITS = AffineMapLimits()


def completed_linear_maps(
    center_px: NDArray[np.float64],
    corner_px: NDArray[np.float64],
    cell: NDArray[np.int32],
    mirrored: bool,
    layout: LayoutCells,
) -> NDArray[np.float64]:
    """The linear map around each numbered cell, by least squares over its six neighbours.

    The millimetres of the layout contain the pattern's own shape, so a round pattern has the same maps as a
    honeycomb. Where a cell has too few neighbours, at the rims of holes, its own triangle gives its map if a neighbour
    determines the order of its corners.

    Args:
        center_px: (N, 2) the cells' centers; corner_px: (N, 3, 2) their triangles, clockwise, or NaN.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        mirrored: the pattern is seen from its back.
        layout: the layout's cells.

    Returns:
        (N, 2, 2) float64, px per mm, or NaN.
    """
    return np.asarray(native.completed_linear_maps(center_px, corner_px, cell, mirrored, layout, LIMITS))
