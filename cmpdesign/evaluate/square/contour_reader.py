"""The former CMP read as its users read it: contours, corners joined, numbers by connection, sub-pixel corners.

The reader of the article's baseline, for comparison with the multicolor pattern. The reference cell alone does not
tell a checkerboard's four orientations apart: which way its rows run is known from rest, and the reference cell's
corners are told by it. That holds up to a turn of 45 degrees (the article, eq. 2 with n = 4).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate.square.quads import Quads, find_quads
from cmpdesign.layout.layout import Layout

Points = NDArray[np.float64]
CORNER_JOIN_EDGES = 0.4  # corners of different quads closer than this, in edges of the smaller quad, are one
MIN_SEARCH_WINDOW_PX, SEARCH_WINDOW_EDGES = (
    2,
    0.2,
)  # half the window of the sub-pixel search, and the same in edges


@dataclass(frozen=True, eq=False)
class SquareReader:
    """Reads one view of a square pattern.

    Attributes:
        layout: a square pattern.
        edge_px: the edges' length at rest.
        axes_px: (2, 2); its rows are the directions, in the image, in which columns and rows count up at rest.
    """

    layout: Layout
    edge_px: float
    axes_px: Points

    def read(self, bgr: NDArray[np.uint8]) -> Points:
        """(M, 2) the markers' places in px, NaN where lost. A poor image is data, never an exception."""
        return read_square(bgr, self.layout, self.edge_px, self.axes_px)


def read_square(bgr: NDArray[np.uint8], layout: Layout, edge_px: float, axes_px: Points) -> Points:
    """(M, 2) the markers' places in px, NaN where lost; see ``SquareReader``."""
    xy_px = np.full((len(layout.marker_xy_mm), 2), np.nan)
    quads = find_quads(bgr, edge_px)
    if quads.reference is None:
        return xy_px
    nodes, places = join_corners(quads.corners_px)
    numbers = number_nodes(quads, nodes, layout, axes_px)
    found = np.array(sorted(numbers), dtype=np.int64)
    ids = np.array([numbers[node] for node in found], dtype=np.int64)
    xy_px[ids] = refine_corners(bgr, places[found], edge_px)
    return xy_px


def join_corners(corners_px: Points) -> tuple[NDArray[np.int64], Points]:
    """Nodes where corners of quads meet: (Q, 4) the node of every corner, and (N, 2) the nodes' places.

    A corner joins every corner of another quad that is close by; their node lies in their middle.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    points = corners_px.reshape(-1, 2)
    sides = np.linalg.norm(np.roll(corners_px, -1, axis=1) - corners_px, axis=2).min(axis=1)
    reach = np.repeat(CORNER_JOIN_EDGES * sides, 4)
    pairs = cKDTree(points).query_pairs(float(reach.max()), output_type="ndarray")
    apart = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    close = apart < np.minimum(reach[pairs[:, 0]], reach[pairs[:, 1]])
    pairs = pairs[close & (pairs[:, 0] // 4 != pairs[:, 1] // 4)]
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    count, node = connected_components(graph, directed=False)
    weight = np.bincount(node, minlength=count)[:, None]
    places = np.stack([np.bincount(node, points[:, axis], count) for axis in (0, 1)], axis=1) / weight
    return node.reshape(-1, 4).astype(np.int64), places


def number_nodes(quads: Quads, nodes: NDArray[np.int64], layout: Layout, axes_px: Points) -> dict[int, int]:
    """Node -> marker id, outward from the reference cell through shared corners, breadth first.

    A quad of the same shade touches in one corner, one of the other shade in two. A quad that contradicts what is
    numbered already is left out.
    """
    side = int(layout.marker_index.max()) + 1
    turn = _turn_sign(axes_px)
    around: dict[int, list[int]] = {}
    for quad, corner_nodes in enumerate(nodes.tolist()):
        for node in corner_nodes:
            around.setdefault(node, []).append(quad)

    assert quads.reference is not None
    first = int(layout.reference_marker)
    # ids[quad] are its corners' ids, in the order of its corners in the image.
    start = reference_cell_ids(quads.corners_px[quads.reference], axes_px, first, side)
    numbers = dict(zip(nodes[quads.reference].tolist(), start, strict=True))
    ids, queue = {quads.reference: start}, deque([quads.reference])
    while queue:
        known = queue.popleft()
        for quad in sorted({quad for node in nodes[known].tolist() for quad in around[node]}):
            if quad in ids:
                continue
            found = _neighbour_cell_ids(quad, known, quads, nodes, numbers, side, turn)
            if found is None or not _is_consistent(nodes[quad].tolist(), found, numbers):
                continue
            ids[quad] = found
            numbers |= dict(zip(nodes[quad].tolist(), found, strict=True))
            queue.append(quad)
    return numbers


def _turn_sign(axes_px: Points) -> int:
    """1 where top left, top right, bottom right, bottom left is clockwise in the image, -1 where it is not."""
    columns, rows = axes_px
    return 1 if columns[0] * rows[1] - columns[1] * rows[0] > 0 else -1


# Row and column of a cell's corners, in the order top left, top right, bottom right, bottom left.
_CORNER_OFFSETS = ((0, 0), (0, 1), (1, 1), (1, 0))


def _cell_corner_ids(row: int, column: int, role: int, turn: int, side: int) -> list[int] | None:
    """The ids of a cell's corners in image order, when its first corner plays ``role``; None outside."""
    if not (0 <= row < side - 1 and 0 <= column < side - 1):
        return None
    steps = [_CORNER_OFFSETS[(role + turn * i) % 4] for i in range(4)]
    return [(row + down) * side + column + right for down, right in steps]


def reference_cell_ids(corners_px: Points, axes_px: Points, first: int, side: int) -> list[int]:
    """The reference cell's ids: its corners are told by the directions known from rest."""
    expected = np.array([-axes_px[0] - axes_px[1], axes_px[0] - axes_px[1], axes_px.sum(axis=0)])
    expected = np.vstack([expected, axes_px[1] - axes_px[0]])
    arms = corners_px - corners_px.mean(axis=0)
    turn = _turn_sign(axes_px)
    fit = [sum(arms[i] @ expected[(role + turn * i) % 4] for i in range(4)) for role in range(4)]
    row, column = divmod(first, side)
    ids = _cell_corner_ids(row, column, int(np.argmax(fit)), turn, side)
    assert ids is not None
    return ids


def _neighbour_cell_ids(
    quad: int,
    known: int,
    quads: Quads,
    nodes: NDArray[np.int64],
    numbers: dict[int, int],
    side: int,
    turn: int,
) -> list[int] | None:
    """The ids that a quad must have, as it shares corners with a known one; None when they do not tell."""
    shared = [i for i, node in enumerate(nodes[quad].tolist()) if node in nodes[known]]
    held = [divmod(numbers[node], side) for node in nodes[known].tolist()]
    top, left = min(row for row, _ in held), min(column for _, column in held)
    if quads.light[quad] == quads.light[known]:
        if len(shared) != 1:
            return None
        corner = shared[0]
        row, column = divmod(numbers[int(nodes[quad][corner])], side)
        # The touching corner plays the opposite part in the other cell.
        cell = (row if row > top else row - 1, column if column > left else column - 1)
    else:
        if len(shared) != 2:
            return None
        corner = shared[0]
        (row, column), (row_2, column_2) = (divmod(numbers[int(nodes[quad][i])], side) for i in shared)
        if row == row_2:
            cell = (row if row > top else row - 1, left)
        elif column == column_2:
            cell = (top, column if column > left else column - 1)
        else:
            return None
    role = _CORNER_OFFSETS.index((row - cell[0], column - cell[1]))
    return _cell_corner_ids(*cell, (role - turn * corner) % 4, turn, side)


def _is_consistent(corner_nodes: list[int], ids: list[int], numbers: dict[int, int]) -> bool:
    """No corner has another number already, and no number another corner."""
    return all(numbers.get(node, marker) == marker for node, marker in zip(corner_nodes, ids, strict=True))


def refine_corners(bgr: NDArray[np.uint8], places: Points, edge_px: float) -> Points:
    """(N, 2) the places where gradients meet (cv2.cornerSubPix); as they were where it runs away.

    NaN outside the image.
    """

    inside = ((places >= 0) & (places <= np.array(bgr.shape[1::-1]) - 1)).all(axis=1)
    found = np.full(places.shape, np.nan)
    if inside.any():
        found[inside] = _refine_sub_pixel(bgr, places[inside], edge_px)
    return found


def _refine_sub_pixel(bgr: NDArray[np.uint8], places: Points, edge_px: float) -> Points:
    import cv2

    window = max(round(SEARCH_WINDOW_EDGES * edge_px), MIN_SEARCH_WINDOW_PX)
    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
    start = places.astype(np.float32)[:, None]
    fine = cv2.cornerSubPix(gray, start.copy(), (window, window), (-1, -1), stop)[:, 0].astype(np.float64)
    near = np.linalg.norm(fine - places, axis=1) <= window
    return np.where(near[:, None], fine, places)
