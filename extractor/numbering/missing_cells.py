"""Cells that no map showed as triangles, at their places between the numbered cells; their edges decide."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.layout.lattice_tables import Lattice
from extractor.numbering.registration import Numbering


class NumberedTriangles(NamedTuple):
    """Numbered cells with the triangles from which their edges are measured.

    Attributes:
        centre_px: (N, 2) float64.
        corner_px: (N, 3, 2) float64, clockwise in the image; NaN where no triangle is measured.
        cell: (N,) int32, the layout's cell.
        mirrored: the pattern is seen from its back.
        found: the number of cells that were found; those behind are predicted.
    """

    centre_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    cell: NDArray[np.int32]
    mirrored: bool
    found: int

    def measured(self, corner_px: NDArray[np.float64]) -> NumberedTriangles:
        """The cells with measured corners (N, 3, 2), NaN where there are none; predicted cells need them."""
        kept = np.isfinite(corner_px[:, 0, 0])
        kept[: self.found] = True
        if kept.all():
            return self._replace(corner_px=corner_px)
        return NumberedTriangles(
            self.centre_px[kept], corner_px[kept], self.cell[kept], self.mirrored, self.found
        )


def with_missing_cells(
    corner_px: NDArray[np.float64], numbering: Numbering, lattice: Lattice
) -> NumberedTriangles:
    """The numbered cells of an image, and the layout's other cells where the cells around predict them.

    Args:
        corner_px: (N, 3, 2) of the image's cells, clockwise in the image.
        numbering: their numbers.
        lattice: the layout.
    """
    known = np.flatnonzero(numbering.cell >= 0)
    corners, cell = corner_px[known], numbering.cell[known]
    centre = _centres(corners)
    found, predicted = native.missing_cells(centre, cell, lattice.layout_cells)
    if not numbering.mirrored:  # the layout's order is clockwise in images of the back
        predicted = predicted[:, ::-1]
    return NumberedTriangles(
        np.concatenate([centre, _centres(predicted)]),
        np.concatenate([corners, predicted]),
        np.concatenate([cell, found]),
        numbering.mirrored,
        len(cell),
    )


def _centres(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) the centres of triangles (N, 3, 2); ``mean`` takes five times as long."""
    return (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0
