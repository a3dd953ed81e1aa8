"""Stage 7, the spin-search algorithm (SSA): walks from cell to cell around their common corners (eqs. 4 and 5).

The best links are followed first. A walk gives every connected part axial coordinates in a frame of its own, by
geometry alone. Cells at links that contradict the walk are left out, and the walk is done again without them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.image.pyramid import PyramidLevel


@dataclass(frozen=True, eq=False)
class Walk:
    """The cells of an image with their places in the lattice.

    Attributes:
        axial: (N, 2) int32, in the frame of the cell's part, as of a pattern seen from its back.
        first: (N,) int8, the corner of the triangle that is the cell's corner 0.
        part: (N,) int32, the connected part, or -1 for a cell without one.
        contradictions: number of links that contradicted the walk.
        holes: number of places without a cell among the cells of the parts.
    """

    axial: NDArray[np.int32]
    first: NDArray[np.int8]
    part: NDArray[np.int32]
    contradictions: int
    holes: int

    @property
    def sizes(self) -> NDArray[np.int64]:
        """(P,) the number of cells of each part."""
        return np.bincount(self.part[self.part >= 0])


class WalkedCells(NamedTuple):
    """Walked cells as native loops take them; a pattern's sides differ in the order of corners and coordinates.

    Attributes:
        centre_px: (N, 2) float64.
        corner_px: (N, 3, 2) float64 without swelling, counter-clockwise as seen from the pattern's front.
        axial: (N, 2) int32.
        first: (N,) int8, the corner that is corner 0.
        part: (N,) int32, or -1.
    """

    centre_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    axial: NDArray[np.int32]
    first: NDArray[np.int8]
    part: NDArray[np.int32]


def cell_light(view: PyramidLevel, cells: Cells, mesh: CellMesh) -> NDArray[np.float64]:
    """(N, 3) float64, the light of cells over the local black (B, G, R, units of 1/255); NaN where unknown.

    Args:
        view: the image at the scale of recognition.
        cells, mesh: the cells and their links.
    """
    return native.cell_light(view, cells.centre_px, mesh.corner_px)


def walk_cells(mesh: CellMesh, light: NDArray[np.float64]) -> Walk:
    """Walk over all linked cells, along links that the cells' light (N, 3) does not contradict."""
    return native.walk_cells(mesh.links, light)


def seen_from(cells: Cells, mesh: CellMesh, walk: Walk, mirrored: bool) -> WalkedCells:
    """The walked cells of a pattern that is seen from its back (``mirrored``) or from its front."""
    centre, corner = cells.centre_px, mesh.corner_px
    if mirrored:
        return WalkedCells(centre, corner, walk.axial, walk.first, walk.part)
    axial, corner = np.ascontiguousarray(walk.axial[:, ::-1]), np.ascontiguousarray(corner[:, ::-1])
    return WalkedCells(centre, corner, axial, (2 - walk.first).astype(np.int8), walk.part)
