"""The article's spin-search algorithm (SSA): the graph is numbered from the white cell, clockwise, layer by layer.

Plain Python, not optimised.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.article.corners import Triangles
from benchmarks.suites.article.graph import CornerGraph
from extractor.layout.lattice import axial_coordinates, layer_of, marker_id
from extractor.layout.reference import BLACK, WHITE, Reference
from extractor.numeric.bilinear import fill_patch_mean

# Smallest ratio of the white cell's interior to the inks of its neighbours, both as sums over the channels.
# The ratio of black is below a quarter; white is brighter than any ink even in a dim print.
MIN_WHITE_RATIO = 0.75
MAX_ROUNDS = 8
MAX_WHITES = 8

# Clockwise around a marker the inks are red, green, blue, with black in the gaps between. If the white cell
# lies in the gap after blue, red or green, the marker is the white cell's corner (0, 0), (0, 1) or (-1, 1).
GAP_AXIAL = np.array([[0, 1], [-1, 1], [0, 0]], np.int32)


class LatticeTables(NamedTuple):
    """Tables of the layout.

    Attributes:
        layers: the layout's layers.
        cell_of: (M,) int32, the colored cell whose axial (q, r) is this marker's ("up-cell"), or -1.
    """

    layers: int
    cell_of: NDArray[np.int32]


class SpinResult(NamedTuple):
    """The result of one search.

    Attributes:
        marker: (T, 3) int32, the marker at each corner of each triangle, or -1.
        cell: (T,) int32, the layout's cell of each triangle, or -1.
        bad: (N,) bool, nodes with contradictory numbers.
        outside: triangles outside the layout's outline.
    """

    marker: NDArray[np.int32]
    cell: NDArray[np.int32]
    bad: NDArray[np.bool_]
    outside: int


class NumberedTriangles(NamedTuple):
    """The numbers from one start: ``marker`` and ``cell`` as in ``SpinResult``, and counts of contradictions."""

    marker: NDArray[np.int32]
    cell: NDArray[np.int32]
    outside: int
    conflicts: int


class Numbering(NamedTuple):
    """The result of stage 7.

    Attributes:
        marker_of_corner: (T, 3) int32, the marker at each corner of each triangle, or -1.
        cell_of_triangle: (T,) int32, the layout's cell of each triangle, or -1.
    """

    marker_of_corner: NDArray[np.int32]
    cell_of_triangle: NDArray[np.int32]


def make_lattice_tables(reference: Reference) -> LatticeTables:
    """The tables of a triangular layout."""
    q, r = axial_coordinates(reference.layer, reference.index).T
    cell_of = np.full(len(q), -1, np.int32)
    inked = np.flatnonzero((reference.cell_color != BLACK) & (reference.cell_color != WHITE))
    corners = reference.cell_corners[inked]
    lower_left = np.argmin((q + r)[corners], axis=1)
    cell_of[corners[np.arange(len(inked)), lower_left]] = inked
    return LatticeTables(layers=int(reference.layer.max()), cell_of=cell_of)


def _sense(graph: CornerGraph) -> int:
    """1 from the front, -1 mirrored."""
    return -1 if graph.mirrored else 1


class Gaps(NamedTuple):
    """The gaps after each ink of each node.

    Attributes:
        ratio: (N, 3) float64, the gap's brightness over that of the neighbouring inks, 0 where unknown.
        centre_px: (N, 3, 2) float64, NaN where unknown.
    """

    ratio: NDArray[np.float64]
    centre_px: NDArray[np.float64]


def _measure_gaps(
    image: NDArray[np.uint8], corner_px: NDArray[np.float64], corner_of_node: NDArray[np.int32], sense: int
) -> Gaps:
    """Measure the gaps.

    Clockwise from the triangle of one ink to the triangle of the next, the gap's corners are the node, the first
    triangle's corner before the node and the second triangle's corner after it.
    """
    found = Gaps(np.zeros(corner_of_node.shape), np.full((*corner_of_node.shape, 2), np.nan))
    middle = corner_px.mean(axis=1)
    for n, ink in np.argwhere((corner_of_node >= 0) & (np.roll(corner_of_node, -1, axis=1) >= 0)):
        (ta, ka), (tb, kb) = divmod(corner_of_node[n, ink], 3), divmod(corner_of_node[n, (ink + 1) % 3], 3)
        before, after = corner_px[ta, (ka - sense) % 3], corner_px[tb, (kb + sense) % 3]
        centre = (corner_px[ta, ka] + corner_px[tb, kb]) / 6 + (before + after) / 3
        radius = 0.2 * np.hypot(*(before - centre))
        gap, first, second = (
            _patch_level(image, place, radius) for place in (centre, middle[ta], middle[tb])
        )
        if np.isfinite(gap + first + second):
            found.ratio[n, ink] = 2.0 * gap / max(first + second, 1.0)
            found.centre_px[n, ink] = centre
    return found


def _patch_level(image: NDArray[np.uint8], place: NDArray[np.float64], radius: float) -> float:
    """The sum of the channels around a place; NaN outside the image."""
    height, width, _ = image.shape
    color = np.zeros(3)
    is_inside = fill_patch_mean(image.reshape(-1), height, width, place[0], place[1], radius, color)
    return float(color.sum()) if is_inside else np.nan


def _spin_search(
    start: int, axial: tuple[int, int], graph: CornerGraph, lattice: LatticeTables
) -> SpinResult:
    """Number triangles outward from one node, the smallest id first.

    At a marker with the color phase (q - r) mod 3 the ink of a triangle determines which of the three cells around the
    marker it shows. The cell's other two corners follow clockwise. Every corner that is reached twice must get the same
    marker both times.

    Args:
        start: the first node.
        axial: its coordinates (q, r).
        graph: the corners.
        lattice: the layout.
    """
    cell_of, node_of_corner = lattice.cell_of.tolist(), graph.node_of_corner.tolist()
    corner_of_node = graph.corner_of_node.tolist()
    marker = np.full(graph.node_of_corner.shape, -1, np.int32)
    cell = np.full(len(node_of_corner), -1, np.int32)
    bad = np.zeros(len(corner_of_node), np.bool_)
    outside, sense = 0, _sense(graph)
    triangle_of: dict[int, int] = {}  # by up-cell
    axial_of = {start: axial}  # by node
    heap = [(marker_id(*axial), start)]  # the smallest marker id first
    while heap:
        _, n = heapq.heappop(heap)
        q, r = axial_of[n]
        for turn in range(3):
            c = corner_of_node[n][(q - r + turn) % 3]
            if c < 0:
                continue
            t, k = divmod(c, 3)
            # Roles 0, 1, 2: the node is the cell's corner (0, 0), (1, 0), (0, 1).
            role = (0, 2, 1)[turn]
            cq, cr = q - (role == 1), r - (role == 2)
            up = marker_id(cq, cr) if layer_of(cq, cr) <= lattice.layers else -1
            if up < 0 or cell_of[up] < 0:
                outside += 1
                continue
            if cell[t] >= 0 or up in triangle_of:
                if cell[t] != cell_of[up] or triangle_of.get(up) != t:
                    bad[n] = True
                    if cell[t] >= 0:
                        bad[node_of_corner[t]] = True
                continue
            cell[t], triangle_of[up] = cell_of[up], t
            for j in range(3):
                # Clockwise the roles are 0, 2, 1.
                at = (role - sense * j) % 3
                place, corner = (cq + (at == 1), cr + (at == 2)), (k + j) % 3
                marker[t, corner] = marker_id(*place)
                other = node_of_corner[t][corner]
                if other not in axial_of:
                    axial_of[other] = place
                    heapq.heappush(heap, (int(marker[t, corner]), other))
                elif axial_of[other] != place:
                    bad[other] = True
    return SpinResult(marker, cell, bad, outside)


def _split_nodes(graph: CornerGraph, bad: NDArray[np.bool_]) -> CornerGraph:
    """The graph with every corner of the bad nodes as a separate node."""
    corner_of_node = graph.corner_of_node.copy()
    corners = corner_of_node[bad]
    corners = corners[corners >= 0]
    corner_of_node[bad] = -1
    node_of_corner = graph.node_of_corner.copy()
    node_of_corner.reshape(-1)[corners] = -1
    count = len(corner_of_node)
    node_of_corner.reshape(-1)[corners] = count + np.arange(len(corners))
    single_nodes = np.full((len(corners), 3), -1, np.int32)
    ink_of_corner = np.zeros(node_of_corner.size, np.int64)
    nodes, ink = np.nonzero(graph.corner_of_node >= 0)
    ink_of_corner[graph.corner_of_node[nodes, ink]] = ink
    single_nodes[np.arange(len(corners)), ink_of_corner[corners]] = corners
    xy = np.concatenate([graph.xy_px, np.full((len(corners), 2), np.nan)])
    return CornerGraph(
        node_of_corner, np.concatenate([corner_of_node, single_nodes]).astype(np.int32), xy, graph.mirrored
    )


def _number_from(
    graph: CornerGraph, lattice: LatticeTables, node: int, coordinate: NDArray[np.int32]
) -> NumberedTriangles:
    """Number from one node. Nodes with contradictions are split, and the search is repeated."""
    conflicts = 0
    for _ in range(MAX_ROUNDS):
        found = _spin_search(node, (int(coordinate[0]), int(coordinate[1])), graph, lattice)
        if not found.bad.any():
            return NumberedTriangles(found.marker, found.cell, found.outside, conflicts)
        conflicts += int(found.bad.sum())
        graph = _split_nodes(graph, found.bad)
        if found.bad[node]:
            break
    return NumberedTriangles(
        np.full_like(found.marker, -1), np.full_like(found.cell, -1), found.outside, conflicts
    )


def number_triangles(
    image: NDArray[np.uint8], triangles: Triangles, graph: CornerGraph, lattice: LatticeTables
) -> Numbering | None:
    """Stage 7: number every triangle that is connected with the white cell; None without a white cell.

    A bright gap between cells is a candidate of the white cell. The candidate with the most cells inside the layout's
    outline and the fewest outside is used. Nothing is numbered if two candidates are equal.
    """
    ratio, centre = _measure_gaps(image, triangles.corner_px, graph.corner_of_node, _sense(graph))
    bright = np.argwhere(ratio > MIN_WHITE_RATIO)
    bright = bright[np.argsort(-ratio[bright[:, 0], bright[:, 1]], kind="stable")][: 3 * MAX_WHITES]
    best: tuple[int, Numbering] | None = None
    tie = False
    tried_px: list[NDArray[np.float64]] = []
    for node, ink in bright:
        white_px = centre[node, ink]
        reach = 0.5 * np.hypot(*(white_px - graph.xy_px[node]))
        if any(np.hypot(*(white_px - other)) < reach for other in tried_px):
            continue
        tried_px.append(white_px)
        numbered = _number_from(graph, lattice, int(node), GAP_AXIAL[ink])
        score = int((numbered.cell >= 0).sum()) - 3 * numbered.outside - numbered.conflicts
        found = Numbering(numbered.marker, numbered.cell)
        if best is None or score > best[0]:
            tie = best is not None and score - best[0] < 2
            best = (score, found)
        elif best[0] - score < 2:
            tie = True
    if best is None:
        return None
    return Numbering(*(np.full_like(numbers, -1) for numbers in best[1])) if tie else best[1]
