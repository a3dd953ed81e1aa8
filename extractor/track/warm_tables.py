"""Tables of a layout for the warm start: colored cells, their surroundings, and markers from neighbouring cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.reference import BLACK, WHITE, Reference
from extractor.numeric.nearest_points import nearest_points

# The layout's cell across an edge; as in native/track/warm_tables.hpp.
NO_CELL, BLACK_CELL, WHITE_CELL = range(3)


@dataclass(frozen=True, eq=False)
class WarmTables:
    """Tables of the C colored cells and M markers of a triangular layout.

    Attributes:
        corners: (C, 3) int32 marker ids, counter-clockwise from the front.
        ink: (C,) uint8, 1 red, 2 green, 3 blue.
        across_edge: (C, 3) uint8, the kind of cell across the edge from corner k to corner k + 1.
        nearest: (C, 3) int32, the nearest red, green and blue cell; one of them is the cell itself.
        cells_of_marker: (M, 3) int32, the colored cells around a marker, or -1.
        is_at_white: (C,) bool, cells that share an edge with the white cell.
        is_rim: (C,) bool, cells with a corner in the outermost layer.
        completion: (K, 4) int32, rows (a, b, c, d) of two cells abc and bad with the common edge a-b.
        completion_weights: (K, 3) float64: d = weights . (a, b, c), from the layout's positions.
    """

    corners: NDArray[np.int32]
    ink: NDArray[np.uint8]
    across_edge: NDArray[np.uint8]
    nearest: NDArray[np.int32]
    cells_of_marker: NDArray[np.int32]
    is_at_white: NDArray[np.bool_]
    is_rim: NDArray[np.bool_]
    completion: NDArray[np.int32]
    completion_weights: NDArray[np.float64]


class CompletionTables(NamedTuple):
    """Pairs of cells with a common edge.

    Attributes:
        markers, weights: ``completion`` and ``completion_weights`` of ``WarmTables``.
        cell_across: (all cells, 3) int32, the cell across each edge, -1 for none.
    """

    markers: NDArray[np.int32]
    weights: NDArray[np.float64]
    cell_across: NDArray[np.int32]


def build_warm_tables(reference: Reference) -> WarmTables:
    """The tables of a triangular layout."""
    colored = np.flatnonzero((reference.cell_color != BLACK) & (reference.cell_color != WHITE))
    corners = np.ascontiguousarray(reference.cell_corners[colored])
    ink = (reference.cell_color[colored] + 1).astype(np.uint8)
    cells_of_marker = np.full((len(reference.layer), 3), -1, np.int32)
    cells_of_marker[corners, (ink - 1)[:, None]] = np.arange(len(colored))[:, None]
    completion = _completion_tables(reference)
    kinds = np.array([BLACK_CELL, WHITE_CELL, NO_CELL], np.uint8)
    kind_of_cell = np.append(
        np.where(reference.cell_color == WHITE, 1, 0), 2
    )  # the last one for the index -1
    across_edge = kinds[kind_of_cell[completion.cell_across[colored]]]
    return WarmTables(
        corners=corners,
        ink=ink,
        across_edge=across_edge,
        nearest=_nearest_by_ink(reference.xy_mm[corners].mean(axis=1), ink),
        cells_of_marker=cells_of_marker,
        is_at_white=(across_edge == WHITE_CELL).any(axis=1),
        is_rim=(reference.layer[corners] == reference.layers).any(axis=1),
        completion=completion.markers,
        completion_weights=completion.weights,
    )


def _completion_tables(reference: Reference) -> CompletionTables:
    """The pairs of cells with a common edge in a triangular layout."""
    cells = reference.cell_corners.astype(np.int64)
    count = len(reference.layer)
    ends = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    apex = np.roll(cells, -2, axis=1).reshape(-1)
    key, opposite = ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]
    order = np.argsort(key)
    twin = order[np.minimum(np.searchsorted(key[order], opposite), len(key) - 1)]
    shared = key[twin] == opposite
    across = np.where(shared, twin // 3, -1).astype(np.int32).reshape(-1, 3)
    rows = np.column_stack([ends[shared], apex[shared], apex[twin[shared]]]).astype(np.int32)
    a, b, c, d = np.moveaxis(reference.xy_mm[rows], 1, 0)
    ab, ac, ad = b - a, c - a, d - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    weight_b = (ad[:, 0] * ac[:, 1] - ad[:, 1] * ac[:, 0]) / area
    weight_c = (ab[:, 0] * ad[:, 1] - ab[:, 1] * ad[:, 0]) / area
    return CompletionTables(rows, np.column_stack([1 - weight_b - weight_c, weight_b, weight_c]), across)


def _nearest_by_ink(centre_mm: NDArray[np.float64], ink: NDArray[np.uint8]) -> NDArray[np.int32]:
    """(C, 3) int32, the nearest red, green and blue cell of each of C cells."""
    nearest = np.empty((len(ink), 3), np.int32)
    for color in range(3):
        members = np.flatnonzero(ink == color + 1)
        nearest[:, color] = members[nearest_points(centre_mm[members], centre_mm)[:, 0]]
    return nearest
