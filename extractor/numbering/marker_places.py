"""Between numbering and refinement: every marker's initial place, averaged from the cells that meet there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.layout.lattice_tables import Lattice
from extractor.numbering.missing_cells import NumberedTriangles


class InitialMarkers(NamedTuple):
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the means of the corners, NaN where there is none.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN where there is none.
        agreed: (M,) bool, all triangles that the pattern has there were found and agree, or at least two.
        is_intact: (M,) bool, all triangles that the pattern has there were found and agree, and these are at least two.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    agreed: NDArray[np.bool_]
    is_intact: NDArray[np.bool_]


def merge_corners(cells: NumberedTriangles, lattice: Lattice) -> InitialMarkers:
    """Merge the corners at each marker (eq. 4: at most one red, green and blue).

    A cell's corners are those of its triangle where the triangle agrees with the prediction by the cell's neighbours,
    else the predicted ones.

    Args:
        cells: the numbered cells of the image.
        lattice: the layout.

    Returns:
        The markers before refinement.
    """
    markers = len(lattice.marker_mm)
    return native.merge_corners(cells, cells, lattice.layout_cells, lattice.corner_ids, markers)
