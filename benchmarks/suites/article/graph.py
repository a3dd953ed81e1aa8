"""The article's connection of triangles: corners that meet are merged into a graph of markers (eqs. 4-5).

The extractor numbers the cell mesh instead and is compared with this graph. Plain Python, not optimised.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.suites.article.corners import Triangles

# L of eq. 5 in units of the shortest edge at either corner. Corners of different markers are at least one edge apart.
MERGE_SHARE = 0.4
# Two triangles that meet at a corner lie in different directions from it: the cosine between these is below this.
MAX_SAME_SIDE_COSINE = 0.8


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


class CornerPairs(NamedTuple):
    """Pairs of corners that may be merged.

    Attributes:
        corners: (P, 2), as 3 * triangle + corner.
        ratio: (P,) float64, their distance / L.
    """

    corners: NDArray[np.intp]
    ratio: NDArray[np.float64]


def _candidate_pairs(corner_px: NDArray[np.float64], ink: NDArray[np.uint8]) -> CornerPairs:
    """The pairs of corners of different inks within L of each other, of triangles on different sides of them."""
    flat, side = corner_px.reshape(-1, 2), corner_px[:, [1, 2, 0]] - corner_px
    length = np.hypot(side[..., 0], side[..., 1])
    reach = MERGE_SHARE * np.minimum(length, length[:, [2, 0, 1]]).reshape(-1)
    pairs = cKDTree(flat).query_pairs(reach.max(), output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    i, j = pairs.T
    distance, limit = np.hypot(*(flat[i] - flat[j]).T), np.minimum(reach[i], reach[j])
    centre, common = corner_px.mean(axis=1), 0.5 * (flat[i] + flat[j])
    to_i, to_j = centre[i // 3] - common, centre[j // 3] - common
    same_side = (to_i * to_j).sum(axis=1) > MAX_SAME_SIDE_COSINE * np.hypot(*to_i.T) * np.hypot(*to_j.T)
    kept = (ink[i // 3] != ink[j // 3]) & (distance <= limit) & ~same_side
    return CornerPairs(pairs[kept], distance[kept] / limit[kept])


def _merge_corners(pairs: CornerPairs, ink: NDArray[np.uint8]) -> NDArray[np.intp]:
    """(3 T,) the node of every corner. The nearest pairs are merged first, no node with two corners of one ink."""
    parent = list(range(3 * len(ink)))
    inks = [1 << (own - 1) for own in ink.tolist() for _ in range(3)]

    def root(corner: int) -> int:
        while parent[corner] != corner:
            corner = parent[corner]
        return corner

    for one, other in pairs.corners[np.argsort(pairs.ratio, kind="stable")].tolist():
        a, b = root(one), root(other)
        if a != b and inks[a] & inks[b] == 0:
            parent[b] = a
            inks[a] |= inks[b]
    return np.unique([root(corner) for corner in range(3 * len(ink))], return_inverse=True)[1]


def connect_corners(triangles: Triangles) -> CornerGraph:
    """Stage 6: merge corners within L (eq. 5), at most one red, one green and one blue corner per node (eq. 4)."""
    count = len(triangles.ink)
    if count == 0:
        empty = np.empty((0, 3), np.int32)
        return CornerGraph(empty, empty, np.empty((0, 2)), False)
    node = _merge_corners(_candidate_pairs(triangles.corner_px, triangles.ink), triangles.ink)
    nodes = int(node.max()) + 1
    corner_of_node = np.full((nodes, 3), -1, np.int32)
    corner_of_node[node, np.repeat(triangles.ink - 1, 3)] = np.arange(3 * count, dtype=np.int32)
    flat = triangles.corner_px.reshape(-1, 2)
    members = np.bincount(node, minlength=nodes)
    xy = np.stack([np.bincount(node, weights=flat[:, a], minlength=nodes) / members for a in (0, 1)], axis=1)
    return CornerGraph(
        node.reshape(count, 3).astype(np.int32),
        corner_of_node,
        xy,
        _is_mirrored(triangles, corner_of_node, xy),
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
