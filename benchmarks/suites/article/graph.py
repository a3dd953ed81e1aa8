"""The article's connection of triangles: corners that meet are merged into a graph of markers (eqs. 4-5).

The extractor numbers the cell mesh instead and is compared with this graph.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.cells.triangle_fit import Triangles
from extractor.numeric.compilation import compiled

# L of eq. 5 in units of the shortest edge at either corner. Corners of different markers are at least one edge apart.
MERGE_SHARE = 0.4
# Two triangles that meet at a corner lie in different directions from it: the cosine between these is below this.
MAX_SAME_SIDE_COSINE = 0.8
NEIGHBOURS = 8


@dataclass(frozen=True, eq=False)
class CornerGraph:
    """The result of stage 6: nodes (candidate markers) and the triangles around each node.

    Attributes:
        node_of_corner: (T, 3) int32, the node of each triangle's corners.
        corner_of_node: (N, 3) int32 by ink (red, green, blue): 3 * triangle + corner, or -1.
        xy_px: (N, 2) float64, the mean of the merged corners.
        mirrored: red, green and blue run counter-clockwise around the nodes, as seen in the image.
    """

    node_of_corner: NDArray[np.int32]
    corner_of_node: NDArray[np.int32]
    xy_px: NDArray[np.float64]
    mirrored: bool


@compiled
def _candidate_pairs(corner_px, ink):  # type: ignore[no-untyped-def]
    """(P, 2) int32 pairs of corners of different inks within L of each other, and (P,) distance / L."""
    count = corner_px.shape[0]
    flat = corner_px.reshape(-1, 2)
    reach = np.empty(3 * count)
    centre = np.empty((count, 2))
    for i in range(count):
        centre[i, 0] = corner_px[i, :, 0].mean()
        centre[i, 1] = corner_px[i, :, 1].mean()
        for k in range(3):
            a, b = corner_px[i, (k + 1) % 3], corner_px[i, (k + 2) % 3]
            p = corner_px[i, k]
            reach[3 * i + k] = MERGE_SHARE * min(
                np.hypot(a[0] - p[0], a[1] - p[1]), np.hypot(b[0] - p[0], b[1] - p[1])
            )
    # A grid of buckets as wide as the longest reach: candidates lie in the 3 x 3 buckets around a corner.
    width = max(reach.max(), 1e-9)
    low_x, low_y = flat[:, 0].min(), flat[:, 1].min()
    width = max(width, (flat[:, 0].max() - low_x) / 2000.0, (flat[:, 1].max() - low_y) / 2000.0)
    columns = int((flat[:, 0].max() - low_x) / width) + 3
    rows = int((flat[:, 1].max() - low_y) / width) + 3
    head = np.full(rows * columns, -1, np.int32)
    following = np.full(3 * count, -1, np.int32)
    bucket = np.empty(3 * count, np.int32)
    for i in range(3 * count):
        b = (int((flat[i, 1] - low_y) / width) + 1) * columns + int((flat[i, 0] - low_x) / width) + 1
        bucket[i] = b
        following[i] = head[b]
        head[b] = i
    pairs = np.empty((3 * count * NEIGHBOURS, 2), np.int32)
    ratio = np.empty(3 * count * NEIGHBOURS)
    found = 0
    for i in range(3 * count):
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                j = head[bucket[i] + dy * columns + dx]
                while j >= 0:
                    if j > i and ink[i // 3] != ink[j // 3] and found < pairs.shape[0]:
                        limit = min(reach[i], reach[j])
                        distance = np.hypot(flat[i, 0] - flat[j, 0], flat[i, 1] - flat[j, 1])
                        if distance <= limit and not _is_same_side(flat, centre, i, j):
                            pairs[found, 0] = i
                            pairs[found, 1] = j
                            ratio[found] = distance / limit
                            found += 1
                    j = following[j]
    return pairs[:found], ratio[:found]


@compiled
def _is_same_side(flat, centre, i, j):  # type: ignore[no-untyped-def]
    """Whether the triangles of two corners lie on the same side of the corners' common point."""
    x, y = 0.5 * (flat[i, 0] + flat[j, 0]), 0.5 * (flat[i, 1] + flat[j, 1])
    ax, ay = centre[i // 3, 0] - x, centre[i // 3, 1] - y
    bx, by = centre[j // 3, 0] - x, centre[j // 3, 1] - y
    return ax * bx + ay * by > MAX_SAME_SIDE_COSINE * np.hypot(ax, ay) * np.hypot(bx, by)


@compiled
def _merge_corners(pairs, order, ink):  # type: ignore[no-untyped-def]
    """Merge corners, nearest pairs first, so that no node has two corners of one ink.

    Returns:
        (3 T,) int32, the node of every corner, and the number of nodes.
    """
    corners = 3 * ink.shape[0]
    parent = np.arange(corners).astype(np.int32)
    inks = np.empty(corners, np.uint8)
    for i in range(corners):
        inks[i] = 1 << (ink[i // 3] - 1)
    for p in order:
        a, b = pairs[p, 0], pairs[p, 1]
        while parent[a] != a:
            a = parent[a]
        while parent[b] != b:
            b = parent[b]
        if a != b and inks[a] & inks[b] == 0:
            parent[b] = a
            inks[a] |= inks[b]
    node = np.full(corners, -1, np.int32)
    count = 0
    for i in range(corners):
        if parent[i] == i:
            node[i] = count
            count += 1
    for i in range(corners):
        root = i
        while parent[root] != root:
            root = parent[root]
        node[i] = node[root]
    return node, count


def connect_corners(triangles: Triangles) -> CornerGraph:
    """Stage 6: merge corners within L (eq. 5), at most one red, one green and one blue corner per node (eq. 4)."""
    count = len(triangles.ink)
    if count == 0:
        empty = np.empty((0, 3), np.int32)
        return CornerGraph(empty, empty, np.empty((0, 2)), False)
    pairs, ratio = _candidate_pairs(triangles.corner_px, triangles.ink)
    node, nodes = _merge_corners(pairs, np.argsort(ratio, kind="stable"), triangles.ink)
    corner_of_node = np.full((nodes, 3), -1, np.int32)
    corner_of_node[node, np.repeat(triangles.ink - 1, 3)] = np.arange(3 * count, dtype=np.int32)
    flat = triangles.corner_px.reshape(-1, 2)
    members = np.bincount(node, minlength=nodes)
    xy = np.stack([np.bincount(node, weights=flat[:, a], minlength=nodes) / members for a in (0, 1)], axis=1)
    return CornerGraph(
        node.reshape(count, 3), corner_of_node, xy, _is_mirrored(triangles, corner_of_node, xy)
    )


def _is_mirrored(triangles: Triangles, corner_of_node: NDArray[np.int32], xy: NDArray[np.float64]) -> bool:
    """Whether red, green, blue run counter-clockwise (y down) around most complete nodes: the pattern's back."""
    complete = np.flatnonzero((corner_of_node >= 0).all(axis=1))
    if len(complete) == 0:
        return False
    offset = triangles.corner_px.mean(axis=1)[corner_of_node[complete] // 3] - xy[complete, None]
    x, y = offset[..., 0], offset[..., 1]
    turn = sum(np.sign(x[:, a] * y[:, b] - y[:, a] * x[:, b]) for a, b in ((0, 1), (1, 2), (2, 0)))
    return bool(np.sum(turn) < 0)
