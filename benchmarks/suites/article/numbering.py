"""The article's spin-search algorithm (SSA): the graph is numbered from the white cell, clockwise, layer by layer."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.article.graph import CornerGraph
from extractor.cells.triangle_fit import Triangles
from extractor.layout.lattice import axial_coordinates, layer_of, marker_id
from extractor.layout.reference import BLACK, WHITE, Reference
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled

# The interior of the white cell against the inks of the cells beside it, both as sums over the channels.
# Black stays below a quarter; the white of a dim print is still brighter than any ink.
MIN_WHITE_RATIO = 0.75
MAX_ROUNDS = 8
MAX_WHITES = 8

# Clockwise around a marker the inks turn red, green, blue, with black in the gaps between. Where the white cell
# lies in the gap after blue, red or green, the marker is the white cell's corner (0, 0), (0, 1) or (-1, 1).
GAP_AXIAL = np.array([[0, 1], [-1, 1], [0, 0]], np.int32)


@dataclass(frozen=True, eq=False)
class LatticeTables:
    """What numbering needs of the layout.

    Attributes:
        layers: the layout's layers.
        cell_of: (M,) int32, the colored cell whose axial (q, r) is this marker's ("up-cell"), or -1.
    """

    layers: int
    cell_of: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Numbering:
    """Stage 7.

    Attributes:
        marker_of_corner: (T, 3) int32, the marker at each corner of each triangle, or -1.
        cell_of_triangle: (T,) int32, the layout's cell that each triangle shows, or -1.
        white_px: (2,) the center of the white cell, or NaN.
        conflicts: nodes that were taken apart because their neighbours disagreed about them.
        ambiguous: two white cells could be the reference and nothing tells them apart.
    """

    marker_of_corner: NDArray[np.int32]
    cell_of_triangle: NDArray[np.int32]
    white_px: NDArray[np.float64]
    conflicts: int
    ambiguous: bool


def make_lattice_tables(reference: Reference) -> LatticeTables:
    """The tables of a triangular layout."""
    q, r = axial_coordinates(reference.layer, reference.index).T
    cell_of = np.full(len(q), -1, np.int32)
    inked = np.flatnonzero((reference.cell_color != BLACK) & (reference.cell_color != WHITE))
    corners = reference.cell_corners[inked]
    lower_left = np.argmin((q + r)[corners], axis=1)
    cell_of[corners[np.arange(len(inked)), lower_left]] = inked
    return LatticeTables(layers=int(reference.layer.max()), cell_of=cell_of)


@compiled
def _measure_gaps(image, corner_px, node_of_corner, corner_of_node, sense):  # type: ignore[no-untyped-def]
    """Brightness of the gap after each ink of each node, relative to the inks beside it, and its center.

    Clockwise from the triangle of one ink to that of the next, the gap's corners are the node, the first
    triangle's corner before the node and the second one's after it.
    """
    nodes = corner_of_node.shape[0]
    ratio = np.zeros((nodes, 3))
    center = np.full((nodes, 3, 2), np.nan)
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    beyond, one, other = np.zeros(3), np.zeros(3), np.zeros(3)
    for n in range(nodes):
        for ink in range(3):
            a, b = corner_of_node[n, ink], corner_of_node[n, (ink + 1) % 3]
            if a < 0 or b < 0:
                continue
            ta, ka, tb, kb = a // 3, a % 3, b // 3, b % 3
            pa = corner_px[ta, (ka - sense) % 3]
            pb = corner_px[tb, (kb + sense) % 3]
            x = (corner_px[ta, ka, 0] + corner_px[tb, kb, 0]) / 6 + (pa[0] + pb[0]) / 3
            y = (corner_px[ta, ka, 1] + corner_px[tb, kb, 1]) / 6 + (pa[1] + pb[1]) / 3
            radius = 0.2 * np.hypot(pa[0] - x, pa[1] - y)
            inside = fill_patch_mean(flat, height, width, x, y, radius, beyond)
            inside &= fill_patch_mean(
                flat, height, width, corner_px[ta, :, 0].mean(), corner_px[ta, :, 1].mean(), radius, one
            )
            inside &= fill_patch_mean(
                flat, height, width, corner_px[tb, :, 0].mean(), corner_px[tb, :, 1].mean(), radius, other
            )
            if inside:
                ratio[n, ink] = 2.0 * beyond.sum() / max(one.sum() + other.sum(), 1.0)
                center[n, ink, 0] = x
                center[n, ink, 1] = y
    return ratio, center


@compiled
def _spin_search(start, q0, r0, sense, ink, node_of_corner, corner_of_node, cell_of, layers):  # type: ignore[no-untyped-def]
    """Number triangles from one node outwards, the smallest id first; who contradicts whom.

    At a marker with the color phase (q - r) mod 3 the ink of a triangle says which of the three cells around it
    that is; its clockwise neighbours then give the other two corners. Every corner that is reached twice must be
    reached as the same marker.
    """
    triangles, nodes = ink.shape[0], corner_of_node.shape[0]
    unknown = -(1 << 20)
    node_q = np.full(nodes, unknown, np.int32)
    node_r = np.full(nodes, unknown, np.int32)
    marker = np.full((triangles, 3), -1, np.int32)
    cell = np.full(triangles, -1, np.int32)
    holder = np.full(cell_of.shape[0], -1, np.int32)  # up-cell -> triangle
    named = np.full(cell_of.shape[0], -1, np.int32)  # marker -> node
    bad = np.zeros(nodes, np.bool_)
    outside = 0
    node_q[start], node_r[start] = q0, r0
    first = marker_id(q0, r0)
    named[first] = start
    heap = [first * nodes + start]  # the smallest marker id first
    while len(heap) > 0:
        n = heapq.heappop(heap) % nodes
        q, r = node_q[n], node_r[n]
        phase = (q - r) % 3
        for turn in range(3):
            hue = (phase + turn) % 3
            c = corner_of_node[n, hue]
            if c < 0:
                continue
            t, k = c // 3, c % 3
            # roles 0, 1, 2: the node is the cell's corner (0, 0), (1, 0), (0, 1)
            role = 0 if turn == 0 else 1 if turn == 2 else 2
            cq = q - 1 if role == 1 else q
            cr = r - 1 if role == 2 else r
            known = layer_of(cq, cr) <= layers
            up = marker_id(cq, cr) if known else -1
            if not known or cell_of[up] < 0:
                outside += 1
                continue
            if cell[t] >= 0 or holder[up] >= 0:
                if cell[t] != cell_of[up] or holder[up] != t:
                    bad[n] = True
                    if cell[t] >= 0:
                        for j in range(3):
                            bad[node_of_corner[t, j]] = True
                continue
            cell[t] = cell_of[up]
            holder[up] = t
            for j in range(3):
                # clockwise the roles run 0, 2, 1
                at = (role - sense * j) % 3
                corner = (k + j) % 3
                mq = cq + 1 if at == 1 else cq
                mr = cr + 1 if at == 2 else cr
                m = marker_id(mq, mr)
                marker[t, corner] = m
                other = node_of_corner[t, corner]
                if node_q[other] == unknown:
                    node_q[other], node_r[other] = mq, mr
                    if named[m] < 0:
                        named[m] = other
                    heapq.heappush(heap, m * nodes + other)
                elif node_q[other] != mq or node_r[other] != mr:
                    bad[other] = True
    return marker, cell, bad, outside


def _split_nodes(graph: CornerGraph, bad: NDArray[np.bool_]) -> CornerGraph:
    """The graph with the bad nodes taken apart: each of their corners becomes a node of its own."""
    corner_of_node = graph.corner_of_node.copy()
    loose = corner_of_node[bad]
    loose = loose[loose >= 0]
    corner_of_node[bad] = -1
    node_of_corner = graph.node_of_corner.copy()
    node_of_corner.reshape(-1)[loose] = -1
    count = len(corner_of_node)
    node_of_corner.reshape(-1)[loose] = count + np.arange(len(loose))
    alone = np.full((len(loose), 3), -1, np.int32)
    hue = np.zeros(node_of_corner.size, np.int64)
    at, ink = np.nonzero(graph.corner_of_node >= 0)
    hue[graph.corner_of_node[at, ink]] = ink
    alone[np.arange(len(loose)), hue[loose]] = loose
    xy = np.concatenate([graph.xy_px, np.full((len(loose), 2), np.nan)])
    return CornerGraph(
        node_of_corner, np.concatenate([corner_of_node, alone]).astype(np.int32), xy, graph.mirrored
    )


def _number_from(
    graph: CornerGraph, triangles: Triangles, lattice: LatticeTables, node: int, coordinate: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], int, int]:
    """Spin from one node; nodes that are contradicted are taken apart and the search is run again."""
    sense = -1 if graph.mirrored else 1
    conflicts = 0
    for _ in range(MAX_ROUNDS):
        marker, cell, bad, outside = _spin_search(
            node, int(coordinate[0]), int(coordinate[1]), sense, triangles.ink,
            graph.node_of_corner, graph.corner_of_node, lattice.cell_of, lattice.layers,
        )  # fmt: skip
        if not bad.any():
            return marker, cell, outside, conflicts
        conflicts += int(bad.sum())
        graph = _split_nodes(graph, bad)
        if bad[node]:
            break
    return np.full_like(marker, -1), np.full_like(cell, -1), outside, conflicts


def number_triangles(
    image: NDArray[np.uint8], triangles: Triangles, graph: CornerGraph, lattice: LatticeTables
) -> Numbering | None:
    """Stage 7: number every triangle that is connected with the white cell; None without a white cell.

    A bright gap between cells is the white cell; where several are bright, the one that puts the most cells
    inside the layout's outline and the fewest outside is, unless two do so equally well.
    """
    sense = -1 if graph.mirrored else 1
    ratio, center = _measure_gaps(
        image, triangles.corner_px, graph.node_of_corner, graph.corner_of_node, sense
    )
    bright = np.argwhere(ratio > MIN_WHITE_RATIO)
    bright = bright[np.argsort(-ratio[bright[:, 0], bright[:, 1]], kind="stable")][: 3 * MAX_WHITES]
    best: tuple[int, Numbering] | None = None
    tie = False
    tried: list[NDArray[np.float64]] = []
    for node, ink in bright:
        where = center[node, ink]
        reach = 0.5 * np.hypot(*(where - graph.xy_px[node]))
        if any(np.hypot(*(where - other)) < reach for other in tried):
            continue
        tried.append(where)
        marker, cell, outside, conflicts = _number_from(graph, triangles, lattice, int(node), GAP_AXIAL[ink])
        score = int((cell >= 0).sum()) - 3 * outside - conflicts
        found = Numbering(marker, cell, where, conflicts, False)
        if best is None or score > best[0]:
            tie = best is not None and score - best[0] < 2
            best = (score, found)
        elif best[0] - score < 2:
            tie = True
    if best is None:
        return None
    if tie:
        nothing = np.full_like(best[1].marker_of_corner, -1)
        return Numbering(
            nothing, np.full_like(best[1].cell_of_triangle, -1), best[1].white_px, best[1].conflicts, True
        )
    return best[1]
