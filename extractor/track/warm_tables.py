"""What the warm start needs of a layout: colored cells, what lies beside each, and markers from their neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.layout.reference import BLACK, WHITE, Reference
from extractor.numeric.compilation import compiled

NO_CELL, BLACK_CELL, WHITE_CELL = range(3)  # what the layout has beyond an edge


@dataclass(frozen=True, eq=False)
class WarmTables:
    """What the warm start needs of a triangular layout; C counts its inked cells.

    Attributes:
        corners: (C, 3) int32 marker ids, counter-clockwise from the front.
        ink: (C,) uint8, 1 red, 2 green, 3 blue.
        beyond: (C, 3) uint8, what lies beyond the edge from corner k to corner k + 1.
        nearest: (C, 3) int32, the nearest inked cell that is red, green, blue; the cell itself among them.
        cells_of_marker: (M, 3) int32, the inked cells around a marker, or -1.
        white: (C,) bool, cells beside the white one.
        rim: (C,) bool, cells with a corner in the outermost layer.
        completion: (K, 4) int32: marker d from the markers a, b, c of the cell across the edge a-b.
        weights: (K, 3) float64: d = weights . (a, b, c), from the layout's positions.
    """

    corners: NDArray[np.int32]
    ink: NDArray[np.uint8]
    beyond: NDArray[np.uint8]
    nearest: NDArray[np.int32]
    cells_of_marker: NDArray[np.int32]
    white: NDArray[np.bool_]
    rim: NDArray[np.bool_]
    completion: NDArray[np.int32]
    weights: NDArray[np.float64]


def build_warm_tables(reference: Reference) -> WarmTables:
    """The tables of a triangular layout."""
    inked = np.flatnonzero((reference.cell_color != BLACK) & (reference.cell_color != WHITE)).astype(np.int32)
    corners = np.ascontiguousarray(reference.cell_corners[inked])
    ink = (reference.cell_color[inked] + 1).astype(np.uint8)
    around = np.full((len(reference.layer), 3), -1, np.int32)
    around[corners, (ink - 1)[:, None]] = np.arange(len(inked))[:, None]
    completion, weights, across = _completion_rows(reference)
    kind = np.array([BLACK_CELL, WHITE_CELL, NO_CELL], np.uint8)
    color = np.append(np.where(reference.cell_color == WHITE, 1, 0), 2)
    beyond = kind[color[across[inked]]]
    return WarmTables(
        corners=corners,
        ink=ink,
        beyond=beyond,
        nearest=_nearest_by_ink(reference.xy_mm[corners].mean(axis=1), ink),
        cells_of_marker=around,
        white=(beyond == WHITE_CELL).any(axis=1),
        rim=(reference.layer[corners] == reference.layers).any(axis=1),
        completion=completion,
        weights=weights,
    )


def _completion_rows(
    reference: Reference,
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int32]]:
    """Rows (a, b, c, d) with their weights, and (cells, 3) the cell across each edge, -1 without one."""
    cells = reference.cell_corners.astype(np.int64)
    count = len(reference.layer)
    ends = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    apex = np.roll(cells, -2, axis=1).reshape(-1)
    key, opposite = ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]
    order = np.argsort(key)
    place = order[np.minimum(np.searchsorted(key[order], opposite), len(key) - 1)]
    shared = key[place] == opposite
    across = np.where(shared, place // 3, -1).astype(np.int32).reshape(-1, 3)
    rows = np.column_stack([ends[shared], apex[shared], apex[place[shared]]]).astype(np.int32)
    a, b, c, d = np.moveaxis(reference.xy_mm[rows], 1, 0)
    along, up, want = b - a, c - a, d - a
    area = along[:, 0] * up[:, 1] - along[:, 1] * up[:, 0]
    of_b = (want[:, 0] * up[:, 1] - want[:, 1] * up[:, 0]) / area
    of_c = (along[:, 0] * want[:, 1] - along[:, 1] * want[:, 0]) / area
    return rows, np.column_stack([1 - of_b - of_c, of_b, of_c]), across


def _nearest_by_ink(center_mm: NDArray[np.float64], ink: NDArray[np.uint8]) -> NDArray[np.int32]:
    from scipy.spatial import cKDTree

    nearest = np.empty((len(ink), 3), np.int32)
    for color in range(3):
        members = np.flatnonzero(ink == color + 1)
        nearest[:, color] = members[cKDTree(center_mm[members]).query(center_mm)[1]]
    return nearest


def predict_missing_markers(tables: WarmTables, xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """The markers (M, 2) with those that are lost beside known cells predicted from these."""
    return np.asarray(_predict_missing(tables.completion, tables.weights, xy_px))


@compiled
def _predict_missing(completion, weights, xy):  # type: ignore[no-untyped-def]
    out, votes = xy.copy(), np.zeros(xy.shape[0])
    for row in range(completion.shape[0]):
        a, b, c, d = completion[row]
        if np.isfinite(xy[d, 0]) or not np.isfinite(xy[a, 0] + xy[b, 0] + xy[c, 0]):
            continue
        if votes[d] == 0.0:
            out[d] = 0.0
        votes[d] += 1.0
        for axis in range(2):
            guess = (
                weights[row, 0] * xy[a, axis] + weights[row, 1] * xy[b, axis] + weights[row, 2] * xy[c, axis]
            )
            out[d, axis] += guess
    for m in range(xy.shape[0]):
        if votes[m] > 0.0:
            out[m] /= votes[m]
    return out
