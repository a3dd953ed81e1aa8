"""Stage 7: parts in the frame of one of them, before that has a place in the layout.

The layout is unknown then: a plane of cells without a rim stands for it. Parts are registered against the first one as
against placed ones, by a smooth local map and their inks.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.layout.lattice import NEIGHBOUR_STEPS
from extractor.layout.lattice_tables import LayoutCells, cell_lookup_table
from extractor.numbering.lattice_walk import WalkedCells

CORNER_STEPS = (
    np.array([[-1, -1], [2, -1], [-1, 2]]) / 3.0
)  # from the centre of an up-cell, in steps of the lattice
LATTICE_STEPS = np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])  # of q and r, in edges
TURNS = 3
NO_MOTION = np.zeros(3, np.int32)


class Plane(NamedTuple):
    """The cells of the lattice up to some layers around a place; units are edges.

    Attributes:
        cells: the cells; an ink is 1 + the class (q - r) mod 3.
        axial: (U, 2) int32.
        cell_lookup: as ``Lattice.cell_lookup``.
    """

    cells: LayoutCells
    axial: NDArray[np.int32]
    cell_lookup: NDArray[np.int32]


@cache
def plane_of(layers: int) -> Plane:
    """The plane of a number of layers."""
    span = np.arange(-layers, layers + 1, dtype=np.int32)
    axial = np.stack(np.meshgrid(span, span, indexing="ij"), axis=-1).reshape(-1, 2)
    axial = np.ascontiguousarray(axial[np.abs(axial.sum(axis=1)) <= layers])
    lookup, places = cell_lookup_table(axial, layers), axial[:, None] + NEIGHBOUR_STEPS
    cells = LayoutCells(
        centre_mm=(axial + 1.0 / 3.0) @ LATTICE_STEPS,
        ink=((axial[:, 0] - axial[:, 1]) % 3 + 1).astype(np.uint8),
        size_mm=np.ones(len(axial)),
        corner_vectors_mm=np.tile(CORNER_STEPS @ LATTICE_STEPS, (len(axial), 1, 1)),
        cell_neighbours=lookup[places[..., 0] + layers + 1, places[..., 1] + layers + 1],
    )
    return Plane(cells, axial, lookup)


def joined_to(part: int, cells: WalkedCells, odds: NDArray[np.float64], layers: int) -> WalkedCells:
    """The cells with more of them in the frame of a part, and of this part.

    Args:
        part: the part.
        cells: the cells.
        odds: (N, 3) their log likelihoods for the classes of the part.
        layers: of the layout.
    """
    plane = plane_of(2 * layers + 2)  # no cell of a pattern is farther from another one
    own = cells.part == part
    cell = native.moved_cells(cells, part, NO_MOTION, plane.cell_lookup)
    cell = native.attach_parts(
        cells, cell, odds, plane.cells, plane.axial, plane.cell_lookup, with_single_cells=False
    )
    axial, first = cells.axial.copy(), cells.first.copy()
    for other in np.unique(cells.part[(cell >= 0) & ~own]):
        chosen = (cells.part == other) & (cell >= 0)
        turned, places = cells.axial[chosen], plane.axial[cell[chosen]]
        turn = 0
        while turn < TURNS - 1 and np.ptp(places - turned, axis=0).any():
            turned = np.stack([-turned.sum(axis=1) - 1, turned[:, 0]], axis=1)
            turn += 1
        axial[chosen], first[chosen] = places, (first[chosen] + 2 * turn) % 3
    return cells._replace(axial=axial, first=first, part=np.where(cell >= 0, part, -1).astype(np.int32))
