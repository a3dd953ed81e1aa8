"""Stage 7, the spin-search algorithm (SSA): walks from cell to cell around their common corners (eqs. 4 and 5).

The best links are followed first. A walk gives every connected part axial coordinates in a frame of its own, by geometry
alone. Cells at links that contradict the walk are left out, and the walk is done again without them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.cells.triangle_fit import without_swelling

MIN_HOLE_NEIGHBOURS = 3  # of a free place; beside a straight rim there are two. Derived


class WalkLimits(NamedTuple):
    """Limits of a walk.

    Attributes:
        max_rounds: walks, each without the cells contradicted before. Measured: rule "contradictions".
    """

    max_rounds: int = 6


LIMITS = WalkLimits()


@dataclass(frozen=True, eq=False)
class Walk:
    """The cells of an image with their places in the lattice.

    Attributes:
        axial: (N, 2) int32, in the frame of the cell's part, as of a pattern seen from its back.
        first: (N,) int8, the corner of the triangle that is the cell's corner 0.
        part: (N,) int32, the connected part, or -1 for a cell without one.
        contradictions: number of links that contradicted the walk.
    """

    axial: NDArray[np.int32]
    first: NDArray[np.int8]
    part: NDArray[np.int32]
    contradictions: int

    @property
    def sizes(self) -> NDArray[np.int64]:
        """(P,) the number of cells of each part."""
        return np.bincount(self.part[self.part >= 0])


class WalkedCells(NamedTuple):
    """Walked cells as native loops take them; a pattern's sides differ in the order of corners and coordinates.

    Attributes:
        center_px: (N, 2) float64.
        corner_px: (N, 3, 2) float64 without swelling, counter-clockwise as seen from the pattern's front.
        axial: (N, 2) int32.
        first: (N,) int8, the corner that is corner 0.
        part: (N,) int32, or -1.
    """

    center_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    axial: NDArray[np.int32]
    first: NDArray[np.int8]
    part: NDArray[np.int32]


def walk_cells(mesh: CellMesh) -> Walk:
    """Walk over all linked cells."""
    axial, first, part, contradictions = native.walk_cells(mesh.links, LIMITS)
    return Walk(axial, first, part, int(contradictions))


def seen_from(cells: Cells, mesh: CellMesh, walk: Walk, mirrored: bool) -> WalkedCells:
    """The walked cells of a pattern that is seen from its back (``mirrored``) or from its front."""
    center, corner = cells.center_px, without_swelling(cells, mesh)
    if mirrored:
        return WalkedCells(center, corner, walk.axial, walk.first, walk.part)
    axial, corner = np.ascontiguousarray(walk.axial[:, ::-1]), np.ascontiguousarray(corner[:, ::-1])
    return WalkedCells(center, corner, axial, (2 - walk.first).astype(np.int8), walk.part)


def count_holes(walk: Walk) -> int:
    """The number of places without a cell among the cells of the parts."""
    known = walk.part >= 0
    if not known.any():
        return 0
    axial, part = walk.axial[known], walk.part[known]
    low = axial.min(axis=0) - 1
    size = axial.max(axis=0) + 2 - low
    holes = 0
    for one in np.flatnonzero(walk.sizes > MIN_HOLE_NEIGHBOURS):
        here = np.zeros(size, np.int8)
        q, r = (axial[part == one] - low).T
        here[q, r] = 1
        inner = here[1:-1, 1:-1]
        around = (
            here[2:, 1:-1] + here[:-2, 1:-1] + here[1:-1, 2:] + here[1:-1, :-2] + here[2:, :-2] + here[:-2, 2:]
        )
        holes += int(np.count_nonzero((inner == 0) & (around >= MIN_HOLE_NEIGHBOURS)))
    return holes
