"""Stage 6: the cell mesh, a triangular mesh through the cells' centers; its faces are the markers and the black cells.

The centers of the colored cells form a lattice as regular as the pattern's own, and blur that rounds the corners moves
no center. Every marker is a triangle of a red, a green and a blue center, and so is every black cell; the two kinds
turn in opposite directions. Cells of one ink are second neighbours in this lattice: an edge of the mesh between two of
these cells is the wrong diagonal and is flipped. Colors thus determine the right neighbours even where shear has made
wrong neighbours nearer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.cells import Cells


class CellMeshLimits(NamedTuple):
    """Limits of the mesh.

    Attributes:
        max_flip_rounds: passes over all faces in which edges between cells of one ink are flipped. Measured: rule
            "flips".
        min_area_ratio, max_area_ratio: of a face, relative to its cells' mean area; other triangles are no faces. The
            ratio is about 1 for three neighbours, and at least 2 across a gap. Chosen around the one, and below the
            other.
        max_swelling: sides of the cells over those at which neighbours just meet. Ink that bled and overexposure make
            cells larger; smaller ones are left as they are: in clutter, figures that lie apart must not meet. Chosen.
        max_corner_gap: L of eq. 5 (neighbouring cells share a corner), in edges of an equilateral cell of the smaller
            area; cells whose nearest corners are farther apart form no face. Measured: rule "shared corner".
    """

    max_flip_rounds: int = 12
    min_area_ratio: float = 0.4
    max_area_ratio: float = 1.9
    max_swelling: float = 1.6
    max_corner_gap: float = 0.4


LIMITS = CellMeshLimits()


@dataclass(frozen=True, eq=False)
class CellMesh:
    """Stage 6.

    Attributes:
        faces: (F, 3) int32, the red, green and blue cell of each face; -1 thrice for a triangle that is no face.
        neighbours: (F, 3) int32, the face across the edge opposite to each cell, or -1.
        orientation: (F,) int8, +1 where red, green, blue run clockwise in the image, -1 counter-clockwise, 0 no face.
        swelling: sides of the cells' triangles over the sides at which neighbours just meet, 1 to
            ``CellMeshLimits.max_swelling``.
        count: number of faces that are markers or black cells.
    """

    faces: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    orientation: NDArray[np.int8]
    swelling: float
    count: int


def build_cell_mesh(cells: Cells) -> CellMesh | None:
    """Stage 6: Delaunay triangles of the centers, corrected by color.

    Returns None with fewer than three cells, or with all centers on one line.
    """
    mesh = CellMesh(*native.build_cell_mesh(cells, LIMITS))
    return mesh if len(mesh.faces) else None


def without_swelling(
    center_px: NDArray[np.float64], corner_px: NDArray[np.float64], swelling: float
) -> NDArray[np.float64]:
    """The corners (N, 3, 2) of cells whose sides are divided by the swelling, around their centers (N, 2)."""
    return np.asarray(native.without_swelling(center_px, corner_px, swelling))
