"""What refinement needs of a layout: which gridlines, cells and neighbours belong to each other. Made once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.reference import BLACK, Reference

MAX_NEIGHBOURS = 6  # around a marker at most
MAX_RING_MARKERS = 18  # in its two rings at most
MAX_ONWARD_COSINE = np.cos(np.radians(150.0))  # of a gridline that goes on beyond a marker


class Topology(NamedTuple):
    """Indices only; -1 stands for none. K cells are drawn, colored ones and the white; B are black.

    Attributes:
        edges: (E, 2) int32 marker ids, the smaller first.
        cells: (K, 3) int32 marker ids of the drawn cells.
        cell_color: (K,) int32, red 0, green 1, blue 2, white 4.
        cell_edges: (K, 3) int32, edge k runs between the corners k and k + 1.
        black: (B, 3) int32 marker ids of the black cells.
        edge_cells: (E, 2) int32, the drawn cells on an edge's two sides, in no order.
        spokes: (M, 6) int32, the edges that end at a marker, once around it.
        near: (M, 18) int32, the markers of its two rings.
        offset: (M, 18, 2) float64, their places relative to it in the layout, in units of the mean edge, y up.
        stencil: (M, 2, 18) float64: weights that give the map's derivatives from the differences to these markers
            (a cubic's least squares), where all 18 are there; else 0.
        along: (E, 2) float64, from an edge's start to its end, in the unit of ``ring_vectors``.
        ahead: (E, 2) int32, the marker next on the same gridline before an edge's start, and the one after its end.
        third: (E, 2) float64, the layout's third difference along these four, in the unit of ``ring_vectors``.
        onward: (M, 6) int32, the edge after each of the ``spokes`` on the same gridline.
    """

    edges: NDArray[np.int32]
    cells: NDArray[np.int32]
    cell_color: NDArray[np.int32]
    cell_edges: NDArray[np.int32]
    black: NDArray[np.int32]
    edge_cells: NDArray[np.int32]
    spokes: NDArray[np.int32]
    near: NDArray[np.int32]
    ring_vectors: NDArray[np.float64]
    derivative_stencil: NDArray[np.float64]
    edge_vectors: NDArray[np.float64]
    next_markers: NDArray[np.int32]
    third_differences: NDArray[np.float64]
    next_edges: NDArray[np.int32]


def topology_of(layout: Reference) -> Topology:
    """The topology of a triangular layout."""
    count, edges = len(layout.layer), layout.edges.astype(np.int64)
    drawn = layout.cell_color != BLACK
    cells = layout.cell_corners[drawn].astype(np.int64)
    sides = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2)
    key = edges[:, 0] * count + edges[:, 1]
    cell_edges = np.searchsorted(key, sides.min(axis=2) * count + sides.max(axis=2))
    edge_cells = _items_by_owner(cell_edges.ravel(), np.repeat(np.arange(len(cells)), 3), len(edges), 2)
    ends = edges.ravel(order="F")
    spokes = _items_by_owner(ends, np.tile(np.arange(len(edges)), 2), count, MAX_NEIGHBOURS)
    ring = _items_by_owner(ends, edges[:, ::-1].ravel(order="F"), count, MAX_NEIGHBOURS)
    near = _two_rings(ring)
    xy = layout.xy_mm
    chord = xy[edges[:, 1]] - xy[edges[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    ahead = np.stack([_next_markers(ring, xy, edges[:, ::-1]), _next_markers(ring, xy, edges)], axis=1)
    third = xy[ahead[:, 0]] - xy[ahead[:, 1]] + 3 * chord
    spokes = _sorted_by_direction(spokes, edges, xy)
    offset = np.where((near >= 0)[:, :, None], (xy[near] - xy[:, None]) / length.mean(), 0.0)
    return Topology(
        edges=layout.edges.astype(np.int32),
        cells=cells.astype(np.int32),
        cell_color=layout.cell_color[drawn].astype(np.int32),
        cell_edges=cell_edges.astype(np.int32),
        black=layout.cell_corners[~drawn].astype(np.int32).reshape(-1, 3),
        edge_cells=edge_cells,
        spokes=spokes,
        near=near,
        ring_vectors=offset,
        derivative_stencil=_derivative_stencil(near, offset),
        edge_vectors=chord / length.mean(),
        next_markers=ahead,
        third_differences=np.where(np.all(ahead >= 0, axis=1)[:, None], third / length.mean(), 0.0),
        next_edges=_next_edges(spokes, edges, ahead, key),
    )


def _next_edges(
    spokes: NDArray[np.int32], edges: NDArray[np.int64], ahead: NDArray[np.int32], key: NDArray[np.int64]
) -> NDArray[np.int32]:
    """(M, 6) int32: the edge after each spoke on the same gridline, -1 where none is; ``key`` tells edges."""
    starts = edges[spokes, 0] == np.arange(len(spokes))[:, None]
    end = np.where(starts, edges[spokes, 1], edges[spokes, 0])
    beyond = np.where(starts, ahead[spokes, 1], ahead[spokes, 0])
    found = np.searchsorted(key, np.minimum(end, beyond) * len(spokes) + np.maximum(end, beyond))
    return np.where((spokes >= 0) & (beyond >= 0), found, -1).astype(np.int32)


def _items_by_owner(
    owner: NDArray[np.int64], item: NDArray[np.int64], count: int, most: int
) -> NDArray[np.int32]:
    """(count, most) int32: the items of each owner, filled up with -1."""
    order = np.argsort(owner, kind="stable")
    owner, item = owner[order], item[order]
    place = np.arange(len(owner)) - np.searchsorted(owner, owner)
    out = np.full((count, most), -1, np.int32)
    out[owner, place] = item
    return out


def _sorted_by_direction(
    spokes: NDArray[np.int32], edges: NDArray[np.int64], xy: NDArray[np.float64]
) -> NDArray[np.int32]:
    """(M, 6) int32: the edges at each marker in the order of their directions."""
    marker = np.arange(len(spokes))[:, None]
    other = np.where(spokes >= 0, edges[spokes].sum(axis=2) - marker, 0)
    away = xy[other] - xy[:, None]
    angle = np.where(spokes >= 0, np.arctan2(away[..., 1], away[..., 0]), np.inf)
    return np.take_along_axis(spokes, np.argsort(angle, axis=1, kind="stable"), axis=1)


def _next_markers(
    ring: NDArray[np.int32], xy: NDArray[np.float64], edges: NDArray[np.int64]
) -> NDArray[np.int32]:
    """(E,) int32: the neighbour of each edge's end that goes on in its direction, -1 where none does."""
    start, end = edges[:, 0], edges[:, 1]
    back, on = xy[start] - xy[end], xy[ring[end]] - xy[end][:, None]
    lengths = np.linalg.norm(back, axis=1)[:, None] * np.linalg.norm(on, axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.where(ring[end] >= 0, np.einsum("ek,enk->en", back, on) / lengths, 1.0)
    best = cosine.argmin(axis=1)
    rows = np.arange(len(edges))
    return np.where(cosine[rows, best] < MAX_ONWARD_COSINE, ring[end][rows, best], -1).astype(np.int32)


def _two_rings(ring: NDArray[np.int32]) -> NDArray[np.int32]:
    """(M, 18): the neighbours, then the neighbours' neighbours, each once."""
    count = len(ring)
    second = np.where(ring[:, :, None] >= 0, ring[ring], -1).reshape(count, -1)
    both = np.concatenate([ring, second], axis=1)
    both[both == np.arange(count)[:, None]] = -1
    order = np.argsort(both, axis=1, kind="stable")
    ordered = np.take_along_axis(both, order, axis=1)
    again = np.zeros(both.shape, np.bool_)
    again[:, 1:] = ordered[:, 1:] == ordered[:, :-1]
    np.put_along_axis(both, order, np.where(again, -1, ordered), axis=1)
    front = np.argsort(both < 0, axis=1, kind="stable")
    return np.ascontiguousarray(
        np.take_along_axis(both, front, axis=1)[:, :MAX_RING_MARKERS].astype(np.int32)
    )


def _derivative_stencil(near: NDArray[np.int32], offset: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y = offset[..., 0], offset[..., 1]
    terms = np.stack([x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y], axis=2)
    out = np.zeros((len(near), 2, MAX_RING_MARKERS))
    full = (near >= 0).all(axis=1)
    terms = terms[full]
    gram = np.swapaxes(terms, 1, 2) @ terms
    sound = np.linalg.cond(gram) < 1e8 if len(gram) else np.empty(0, np.bool_)
    solved = np.linalg.solve(gram[sound], np.swapaxes(terms[sound], 1, 2))[:, :2]
    out[np.flatnonzero(full)[sound]] = solved
    return out
