"""The topology of a layout: the relations of edges, cells and neighbours. Refinement uses these tables."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.gridline_slopes import (
    LayoutGridlines,
    covariance_couplings,
    end_couplings,
    scatter_bending,
    slope_weights,
)
from extractor.layout.reference import BLACK, Reference

MAX_NEIGHBOURS = 6  # of a marker
MAX_RING_MARKERS = 18  # in the two rings around a marker
MAP_DERIVATIVES = 5  # x, y, xx, xy, yy
# Of a quadratic through the markers around another: how many determine its curvature, and what is added to the diagonal
# of the normal equations of the curvature, in the unit of ``ring_vectors``.
MIN_FIRM_MARKERS, FIRM_RIDGE = 8, 0.001
# Of the normal equations of a map: a cubic has 2e2 to 3e3 with four rows of markers, and 4e4 or more with three.
MAX_CONDITION = 1e4
MAX_ONWARD_COSINE = np.cos(np.radians(150.0))  # between the two edges at a marker that form one gridline


class Topology(NamedTuple):
    """Tables of M markers, E edges, K drawn cells (the colored ones and the white one) and B black cells; -1: none.

    Attributes:
        edges: (E, 2) int32 marker ids, the smaller first.
        cells: (K, 3) int32 marker ids of the drawn cells.
        cell_color: (K,) int32, red 0, green 1, blue 2, white 4.
        cell_edges: (K, 3) int32, edge k connects the corners k and k + 1.
        black_cells: (B, 3) int32 marker ids of the black cells.
        edge_cells: (E, 2) int32, the drawn cells on the two sides of an edge, in no order.
        spokes: (M, 6) int32, the edges that end at a marker, in the order of their directions.
        ring_markers: (M, 18) int32, the markers in the two rings around each marker, the first ring first.
        ring_vectors: (M, 18, 2) float64, the layout vectors from a marker to its ``ring_markers``, in units of the
            mean edge, y up.
        derivative_stencil: (M, 18, 5) float64, weights of the differences to the ``ring_markers`` that give the
            map's derivatives x, y, xx, xy, yy by least squares: the first ones of a cubic, or of a quadratic where only
            three rows of markers are there, as at the rim; the second ones of a quadratic through all of them, which
            noise and scatter change least. 0 with fewer than 8 markers.
        edge_vectors: (E, 2) float64, from an edge's start to its end, in the unit of ``ring_vectors``.
        next_markers: (E, 2) int32, on the same gridline the marker before an edge's start and the marker after its end.
        third_differences: (E, 2) float64, the layout's third difference along these four markers, in the unit of
            ``ring_vectors``.
        next_edges: (M, 6) int32, the edge that follows each of the ``spokes`` on the same gridline.
        end_couplings: (E, 6) float64, see ``gridline_slopes``.
        covariance_couplings: (E, 6) float64, the same of the covariances.
        scatter_bending: (E, 3) float64, see ``gridline_slopes``.
        cell_height: of the drawn cells over the black, towards the camera, in units of the mean edge; 0 for flat pads.
    """

    edges: NDArray[np.int32]
    cells: NDArray[np.int32]
    cell_color: NDArray[np.int32]
    cell_edges: NDArray[np.int32]
    black_cells: NDArray[np.int32]
    edge_cells: NDArray[np.int32]
    spokes: NDArray[np.int32]
    ring_markers: NDArray[np.int32]
    ring_vectors: NDArray[np.float64]
    derivative_stencil: NDArray[np.float64]
    edge_vectors: NDArray[np.float64]
    next_markers: NDArray[np.int32]
    third_differences: NDArray[np.float64]
    next_edges: NDArray[np.int32]
    end_couplings: NDArray[np.float64]
    covariance_couplings: NDArray[np.float64]
    scatter_bending: NDArray[np.float64]
    cell_height: float = 0.0


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
    ring_markers = _two_rings(ring)
    xy = layout.xy_mm
    chord = xy[edges[:, 1]] - xy[edges[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    next_markers = np.stack([_next_markers(ring, xy, edges[:, ::-1]), _next_markers(ring, xy, edges)], axis=1)
    third = xy[next_markers[:, 0]] - xy[next_markers[:, 1]] + 3 * chord
    spokes = _sorted_by_direction(spokes, edges, xy)
    ring_vectors = np.where(
        (ring_markers >= 0)[:, :, None], (xy[ring_markers] - xy[:, None]) / length.mean(), 0.0
    )
    stencil = _derivative_stencil(ring_markers, ring_vectors)
    edge_vectors = chord / length.mean()
    # from one side, scatter makes more second derivatives than bending does: the rim's count as 0, and what is left
    # out may be as large as what scatter would make
    all_slopes = slope_weights(stencil, ring_markers, edges, edge_vectors)
    slopes = all_slopes.curved_at(edges, np.all(spokes >= 0, axis=1))
    couplings = end_couplings(slopes, edges)
    is_inner: NDArray[np.bool_] = np.all(ring_markers >= 0, axis=1)
    is_seen: NDArray[np.bool_] = np.any(edge_cells >= 0, axis=1)
    gridlines = LayoutGridlines(edges, edge_vectors, is_seen, spokes, is_inner)
    return Topology(
        edges=layout.edges.astype(np.int32),
        cells=cells.astype(np.int32),
        cell_color=layout.cell_color[drawn].astype(np.int32),
        cell_edges=cell_edges.astype(np.int32),
        black_cells=layout.cell_corners[~drawn].astype(np.int32).reshape(-1, 3),
        edge_cells=edge_cells,
        spokes=spokes,
        ring_markers=ring_markers,
        ring_vectors=ring_vectors,
        derivative_stencil=stencil,
        edge_vectors=edge_vectors,
        next_markers=next_markers,
        third_differences=np.where(np.all(next_markers >= 0, axis=1)[:, None], third / length.mean(), 0.0),
        next_edges=_next_edges(spokes, edges, next_markers, key),
        end_couplings=couplings,
        covariance_couplings=covariance_couplings(couplings, slopes, gridlines),
        scatter_bending=scatter_bending(all_slopes, edges, edge_vectors, spokes),
        cell_height=0.0 if layout.as_made is None else layout.as_made.cell_height_mm / float(length.mean()),
    )


def _next_edges(
    spokes: NDArray[np.int32],
    edges: NDArray[np.int64],
    next_markers: NDArray[np.int32],
    key: NDArray[np.int64],
) -> NDArray[np.int32]:
    """(M, 6) int32: the edge that follows each spoke on the same gridline, -1 for none.

    Args:
        key: (E,) ascending, (smaller id) * M + (larger id) of every edge.
    """
    starts = edges[spokes, 0] == np.arange(len(spokes))[:, None]
    end = np.where(starts, edges[spokes, 1], edges[spokes, 0])
    following = np.where(starts, next_markers[spokes, 1], next_markers[spokes, 0])
    found = np.searchsorted(key, np.minimum(end, following) * len(spokes) + np.maximum(end, following))
    return np.where((spokes >= 0) & (following >= 0), found, -1).astype(np.int32)


def _items_by_owner(
    owner: NDArray[np.int64], item: NDArray[np.int64], count: int, max_items: int
) -> NDArray[np.int32]:
    """(count, max_items) int32: the items of each owner, padded with -1."""
    order = np.argsort(owner, kind="stable")
    owner, item = owner[order], item[order]
    column = np.arange(len(owner)) - np.searchsorted(owner, owner)
    table = np.full((count, max_items), -1, np.int32)
    table[owner, column] = item
    return table


def _sorted_by_direction(
    spokes: NDArray[np.int32], edges: NDArray[np.int64], xy: NDArray[np.float64]
) -> NDArray[np.int32]:
    """(M, 6) int32: the edges at each marker in the order of their directions."""
    marker = np.arange(len(spokes))[:, None]
    other = np.where(spokes >= 0, edges[spokes].sum(axis=2) - marker, 0)
    vector = xy[other] - xy[:, None]
    angle = np.where(spokes >= 0, np.arctan2(vector[..., 1], vector[..., 0]), np.inf)
    return np.take_along_axis(spokes, np.argsort(angle, axis=1, kind="stable"), axis=1)


def _next_markers(
    ring: NDArray[np.int32], xy: NDArray[np.float64], edges: NDArray[np.int64]
) -> NDArray[np.int32]:
    """(E,) int32: the neighbour of each edge's end that continues the edge, -1 for none."""
    start, end = edges[:, 0], edges[:, 1]
    backward, onward = xy[start] - xy[end], xy[ring[end]] - xy[end][:, None]
    lengths = np.linalg.norm(backward, axis=1)[:, None] * np.linalg.norm(onward, axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.where(ring[end] >= 0, np.einsum("ek,enk->en", backward, onward) / lengths, 1.0)
    best = cosine.argmin(axis=1)
    rows = np.arange(len(edges))
    return np.where(cosine[rows, best] < MAX_ONWARD_COSINE, ring[end][rows, best], -1).astype(np.int32)


def _two_rings(ring: NDArray[np.int32]) -> NDArray[np.int32]:
    """(M, 18) int32: the neighbours, then the neighbours' neighbours, each once; from the neighbours (M, 6)."""
    count = len(ring)
    second = np.where(ring[:, :, None] >= 0, ring[ring], -1).reshape(count, -1)
    both = np.concatenate([ring, second], axis=1)
    both[both == np.arange(count)[:, None]] = -1
    order = np.argsort(both, axis=1, kind="stable")
    ordered = np.take_along_axis(both, order, axis=1)
    repeated = np.zeros(both.shape, np.bool_)
    repeated[:, 1:] = ordered[:, 1:] == ordered[:, :-1]
    np.put_along_axis(both, order, np.where(repeated, -1, ordered), axis=1)
    known_first = np.argsort(both < 0, axis=1, kind="stable")
    return np.ascontiguousarray(
        np.take_along_axis(both, known_first, axis=1)[:, :MAX_RING_MARKERS].astype(np.int32)
    )


def _derivative_stencil(
    ring_markers: NDArray[np.int32], ring_vectors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(M, 18, 5) float64, see ``Topology.derivative_stencil``."""
    known: NDArray[np.bool_] = np.asarray(ring_markers >= 0)
    x, y = ring_vectors[..., 0], ring_vectors[..., 1]
    quadratic = np.stack([x, y, x * x / 2, x * y, y * y / 2], axis=2)
    cubic = np.concatenate(
        [quadratic, np.stack([x * x * x, x * x * y, x * y * y, y * y * y], axis=2)], axis=2
    )
    out = np.zeros((len(ring_markers), MAP_DERIVATIVES, MAX_RING_MARKERS))
    with np.errstate(divide="ignore"):
        near = np.where(known, (x * x + y * y) ** -2.0, 0.0)
    enough = np.flatnonzero(known.sum(axis=1) >= MIN_FIRM_MARKERS)
    ridge = np.array([0.0, 0.0, *[FIRM_RIDGE] * 3])
    first, second = slice(0, 2), slice(2, MAP_DERIVATIVES)
    complete = (ring_markers >= 0).all(axis=1, keepdims=True)
    even = np.where(complete, 1.0, near)
    every = known.astype(np.float64)
    fits = (quadratic, near, ridge, first), (cubic, even, 0.0, first), (quadratic, every, ridge, second)
    for terms, weight, added, rows in fits:
        solutions, regular = _least_squares(terms[enough], weight[enough], added, rows)
        out[enough[regular], rows] = solutions
    return np.ascontiguousarray(np.swapaxes(out, 1, 2))


def _least_squares(
    terms: NDArray[np.float64], weight: NDArray[np.float64], ridge: NDArray[np.float64] | float, rows: slice
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(r, R, K) the weights that give R coefficients from K values; (n,) whether the values determine all, r times.

    Args:
        terms: (n, K, T). weight: (n, K), of the values. ridge: (T,), added to the diagonal of the normal equations.
        rows: the R coefficients of the T.
    """
    weighted = np.swapaxes(terms * weight[..., None], 1, 2)
    gram = weighted @ terms + ridge * np.eye(terms.shape[2])
    eigenvalues = np.linalg.eigvalsh(gram)
    regular = eigenvalues[:, -1] < MAX_CONDITION * eigenvalues[:, 0]
    by_row = np.linalg.solve(gram[regular], np.eye(terms.shape[2])[:, rows])
    return np.swapaxes(by_row, 1, 2) @ weighted[regular], regular
