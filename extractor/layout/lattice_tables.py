"""Tables of a triangular layout for numbering and repair: cells by lattice place, neighbours of markers and cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import layout as native
from extractor.layout.lattice import NEIGHBOUR_STEPS, axial_coordinates
from extractor.layout.neighbour_tables import (
    FIRST_RING,
    neighbour_table,
    ring_weights,
)
from extractor.layout.reference import BLACK, WHITE, Reference

UNKNOWN_AXIAL = -(
    1 << 20
)  # the axial coordinate of a cell without coordinates; as in native/layout/lattice_tables.hpp


class LayoutCells(NamedTuple):
    """The layout's U colored cells, for compiled functions.

    Attributes:
        centre_mm: (U, 2) float64, layout frame.
        ink: (U,) uint8, 1 red, 2 green, 3 blue.
        size_mm: (U,) float64, the mean side.
        corner_vectors_mm: (U, 3, 2) float64, from the centre to the corners.
        cell_neighbours: (U, 6) int32, the cells that share a corner with each cell, in the order of
            ``NEIGHBOUR_STEPS``; -1 for none.
    """

    centre_mm: NDArray[np.float64]
    ink: NDArray[np.uint8]
    size_mm: NDArray[np.float64]
    corner_vectors_mm: NDArray[np.float64]
    cell_neighbours: NDArray[np.int32]


class RingTables(NamedTuple):
    """The neighbours of the layout's M markers, for compiled functions; -1 for no neighbour.

    Attributes:
        marker_mm: (M, 2) float64, layout frame.
        neighbours, ring_weights: (M, 18) int32 and float64, see ``Lattice``.
        first_ring: (M, 6) int32, the six markers around each marker.
        present: (M,) bool, the markers that touch a colored or white cell.
        layers: number of layers.
    """

    marker_mm: NDArray[np.float64]
    neighbours: NDArray[np.int32]
    ring_weights: NDArray[np.float64]
    first_ring: NDArray[np.int32]
    present: NDArray[np.bool_]
    layers: int


@dataclass(frozen=True, eq=False)
class Lattice:
    """The lattice of a triangular layout with M markers and U colored cells.

    Attributes:
        layers: number of layers.
        marker_mm: (M, 2) float64, layout frame.
        cell_lookup: (S, S) int32, the colored cell at the axial (q, r), read by ``cell_at``; -1 for none.
        corner_ids: (U, 3) int32, the markers (q, r), (q + 1, r), (q, r + 1) of every colored cell.
        ink: (U,) uint8, 1 red, 2 green, 3 blue.
        axial: (U, 2) int32, the cells' (q, r).
        white_axial: (W, 2) int32, (q, r) of the white down-cells.
        layer: (M,) int32, the markers' layers.
        neighbours: (M, 18) int32, the markers in the two rings around each marker, -1 outside the pattern.
        ring_weights: (M, 18) float64, weights of ``neighbours`` that give a marker's place; 0 where these are too few.
        present: (M,) bool, the markers that touch a colored or white cell.
    """

    layers: int
    marker_mm: NDArray[np.float64]
    cell_lookup: NDArray[np.int32]
    corner_ids: NDArray[np.int32]
    ink: NDArray[np.uint8]
    axial: NDArray[np.int32]
    white_axial: NDArray[np.int32]
    layer: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    ring_weights: NDArray[np.float64]
    present: NDArray[np.bool_]

    @cached_property
    def centre_mm(self) -> NDArray[np.float64]:
        """(U, 2) float64, the centres of the colored cells."""
        return np.asarray(self.marker_mm[self.corner_ids].mean(axis=1))

    @cached_property
    def size_mm(self) -> NDArray[np.float64]:
        """(U,) float64, the mean side of the colored cells."""
        corners = self.marker_mm[self.corner_ids]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return np.asarray(sides.mean(axis=1))

    @cached_property
    def cell_neighbours(self) -> NDArray[np.int32]:
        """(U, 6) int32, the colored cells that share a corner with each cell, in the order of ``NEIGHBOUR_STEPS``; -1
        for none."""
        places = self.axial[:, None] + NEIGHBOUR_STEPS
        return cells_at(places.reshape(-1, 2), self).reshape(-1, 6)

    @cached_property
    def layout_cells(self) -> LayoutCells:
        """The colored cells as a record for compiled functions."""
        return LayoutCells(
            self.centre_mm, self.ink, self.size_mm, self.corner_vectors_mm, self.cell_neighbours
        )

    @cached_property
    def ring_tables(self) -> RingTables:
        """The markers' neighbours as a record for compiled functions."""
        return RingTables(
            marker_mm=self.marker_mm,
            neighbours=self.neighbours,
            ring_weights=self.ring_weights,
            first_ring=self.first_ring,
            present=self.present,
            layers=self.layers,
        )

    @cached_property
    def first_ring(self) -> NDArray[np.int32]:
        """(M, 6) int32, the six markers around each marker, -1 outside the pattern."""
        return np.ascontiguousarray(self.neighbours[:, FIRST_RING])

    @cached_property
    def corner_vectors_mm(self) -> NDArray[np.float64]:
        """(U, 3, 2) float64, from the centres of the colored cells to their corners."""
        return np.asarray(self.marker_mm[self.corner_ids] - self.centre_mm[:, None])


def lattice_of(reference: Reference) -> Lattice:
    """The lattice of a triangular layout."""
    coordinates = axial_coordinates(reference.layer, reference.index)
    inked = np.flatnonzero((reference.cell_color != BLACK) & (reference.cell_color != WHITE))
    corners = reference.cell_corners[inked]
    neighbours = neighbour_table(coordinates, int(reference.layer.max()))
    lower_left = corners[np.arange(len(inked)), coordinates.sum(axis=1)[corners].argmin(axis=1)]
    return Lattice(
        layers=int(reference.layer.max()),
        marker_mm=reference.xy_mm,
        cell_lookup=cell_lookup_table(coordinates[lower_left], int(reference.layer.max())),
        corner_ids=corner_marker_ids(coordinates[lower_left]),
        ink=(reference.cell_color[inked] + 1).astype(np.uint8),
        axial=coordinates[lower_left],
        white_axial=_down_axial(coordinates[reference.cell_corners[reference.cell_color == WHITE]]),
        layer=reference.layer,
        neighbours=neighbours,
        ring_weights=ring_weights(reference.xy_mm, neighbours),
        present=reference.present,
    )


def cell_lookup_table(axial: NDArray[np.int32], layers: int) -> NDArray[np.int32]:
    """(S, S) int32, S = 2 layers + 3: each cell's number at its axial place; the border and free places hold -1."""
    lookup = np.full((2 * layers + 3, 2 * layers + 3), -1, np.int32)
    lookup[axial[:, 0] + layers + 1, axial[:, 1] + layers + 1] = np.arange(len(axial))
    return lookup


def _down_axial(corners: NDArray[np.int32]) -> NDArray[np.int32]:
    """(W, 2) int32, (q, r) of the down-cells with corners (W, 3, 2): these add up to (3q - 1, 3r + 2)."""
    return np.ascontiguousarray((corners.sum(axis=1) + (1, -2)) // 3, dtype=np.int32)


def cells_at(axial: NDArray[np.int32], lattice: Lattice) -> NDArray[np.int32]:
    """(N,) int32, the layout's cell at each axial (q, r) of (N, 2), or -1."""
    return native.cells_at(np.ascontiguousarray(axial, dtype=np.int32), lattice.cell_lookup)


def cells_between_whites(lattice: Lattice) -> int:
    """The number of colored cells with two or three white cells at their sides, which may hide them."""
    steps = np.array([[0, 0], [-1, 0], [-1, 1]], np.int32)  # to the up-cells that share a side
    cells = cells_at((lattice.white_axial[:, None] + steps).reshape(-1, 2), lattice)
    return int((np.bincount(cells[cells >= 0]) > 1).sum())


def corner_marker_ids(axial: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N, 3) int32 ids of the markers (q, r), (q + 1, r), (q, r + 1), the corners of the cells at (q, r) of (N, 2)."""
    return native.corner_ids(np.ascontiguousarray(axial, dtype=np.int32))
