"""Reader of the square pattern, the article's baseline: contours, joined corners, numbering, sub-pixel corners.

The reference cell alone does not determine which of four orientations a checkerboard has. The direction of the rows is
known from rest and identifies the reference cell's corners. This is valid up to a rotation of 45 degrees (the article,
eq. 2 with n = 4).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluation.square.quads import Quads, find_quads
from cmpdesign.layout.layout import Layout
from cmpdesign.libraries import extra
from extractor.image.response import Response, light_of_values

Points = NDArray[np.float64]
Gray = NDArray[np.float32]
CORNER_JOIN_EDGES = (
    0.4  # corners of different quads within this distance, in edges of the smaller quad, are joined
)
MIN_SEARCH_WINDOW_PX, SEARCH_WINDOW_EDGES = (
    2,
    0.2,
)  # half the window of the sub-pixel search, in px and in edges


@dataclass(frozen=True, eq=False)
class SquareReader:
    """Reads one view of a square pattern.

    Attributes:
        layout: a square pattern.
        edge_px: the edges' length at rest.
        axes_px: (2, 2) unit vectors in the image at rest: the direction of ascending columns, then of ascending rows.
        response: the camera's response, as of a scene's sensor; corners are refined in light.
    """

    layout: Layout
    edge_px: float
    axes_px: Points
    response: Response = "srgb"

    def read(self, bgr: NDArray[np.uint8]) -> Points:
        """(M, 2) the markers' positions in px, NaN where lost. A poor image never raises an exception."""
        xy_px = np.full((len(self.layout.marker_xy_mm), 2), np.nan)
        quads = find_quads(bgr, self.edge_px)
        if quads.reference is None:
            return xy_px
        nodes, places = join_corners(quads.corners_px)
        numbers = number_nodes(quads, nodes, self.layout, self.axes_px)
        found = np.array(sorted(numbers), dtype=np.int64)
        ids = np.array([numbers[node] for node in found], dtype=np.int64)
        xy_px[ids] = refine_corners(gray_light(bgr, self.response), places[found], self.edge_px)
        return xy_px


def gray_light(bgr: NDArray[np.uint8], response: Response) -> Gray:
    """(H, W) float32, 0 to 255: the light of an image (H, W, 3), in gray."""
    import cv2

    light = light_of_values(response).astype(np.float32)[bgr]
    return np.asarray(cv2.cvtColor(light, cv2.COLOR_BGR2GRAY), dtype=np.float32)


def join_corners(corners_px: Points) -> tuple[NDArray[np.int64], Points]:
    """Join the corners of quads to nodes: (Q, 4) the node of every corner, and (N, 2) px, the nodes' positions.

    A corner is joined with every close corner of another quad. A node lies at the mean of its corners.
    """
    with extra("evaluate"):
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree

    points = corners_px.reshape(-1, 2)
    sides = np.linalg.norm(np.roll(corners_px, -1, axis=1) - corners_px, axis=2).min(axis=1)
    reach = np.repeat(CORNER_JOIN_EDGES * sides, 4)
    pairs = cKDTree(points).query_pairs(float(reach.max()), output_type="ndarray")
    distance = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    close = distance < np.minimum(reach[pairs[:, 0]], reach[pairs[:, 1]])
    pairs = pairs[close & (pairs[:, 0] // 4 != pairs[:, 1] // 4)]
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    count, node = connected_components(graph, directed=False)
    weight = np.bincount(node, minlength=count)[:, None]
    places = np.stack([np.bincount(node, points[:, axis], count) for axis in (0, 1)], axis=1) / weight
    return node.reshape(-1, 4).astype(np.int64), places


def number_nodes(quads: Quads, nodes: NDArray[np.int64], layout: Layout, axes_px: Points) -> dict[int, int]:
    """Node -> marker id, outward from the reference cell through shared corners, breadth first.

    Quads of the same shade share one corner, quads of different shades share two. A quad that contradicts earlier
    numbers is skipped.
    """
    side = int(layout.marker_index.max()) + 1
    turn = _turn_sign(axes_px)
    quads_at_node: dict[int, list[int]] = {}
    for quad, corner_nodes in enumerate(nodes.tolist()):
        for node in corner_nodes:
            quads_at_node.setdefault(node, []).append(quad)

    assert quads.reference is not None
    first = int(layout.reference_marker)
    # ids[quad] are the ids of its corners, in the order of the corners in the image.
    start = reference_cell_ids(quads.corners_px[quads.reference], axes_px, first, side)
    numbers = dict(zip(nodes[quads.reference].tolist(), start, strict=True))
    ids, queue = {quads.reference: start}, deque([quads.reference])
    while queue:
        known = queue.popleft()
        for quad in sorted({quad for node in nodes[known].tolist() for quad in quads_at_node[node]}):
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
    """1 if top left, top right, bottom right, bottom left is clockwise in the image, else -1."""
    return 1 if axes_px[0, 0] * axes_px[1, 1] - axes_px[0, 1] * axes_px[1, 0] > 0 else -1


# Row and column of a cell's corners, in the order top left, top right, bottom right, bottom left.
_CORNER_OFFSETS = ((0, 0), (0, 1), (1, 1), (1, 0))


def _cell_corner_ids(row: int, column: int, role: int, turn: int, side: int) -> list[int] | None:
    """The ids of a cell's corners in image order, if its first corner has number ``role``; None outside the pattern."""
    if not (0 <= row < side - 1 and 0 <= column < side - 1):
        return None
    offsets = [_CORNER_OFFSETS[(role + turn * i) % 4] for i in range(4)]
    return [(row + down) * side + column + right for down, right in offsets]


def reference_cell_ids(corners_px: Points, axes_px: Points, first: int, side: int) -> list[int]:
    """The ids of the reference cell's corners, identified by the directions known from rest."""
    expected = np.array([-axes_px[0] - axes_px[1], axes_px[0] - axes_px[1], axes_px.sum(axis=0)])
    expected = np.vstack([expected, axes_px[1] - axes_px[0]])
    arms = corners_px - corners_px.mean(axis=0)
    turn = _turn_sign(axes_px)
    agreement = [sum(arms[i] @ expected[(role + turn * i) % 4] for i in range(4)) for role in range(4)]
    row, column = divmod(first, side)
    ids = _cell_corner_ids(row, column, int(np.argmax(agreement)), turn, side)
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
    """The ids of a quad's corners, from the corners it shares with a numbered quad; None if they are ambiguous."""
    shared = [i for i, node in enumerate(nodes[quad].tolist()) if node in nodes[known]]
    places = [divmod(numbers[node], side) for node in nodes[known].tolist()]
    top, left = min(row for row, _ in places), min(column for _, column in places)
    if quads.light[quad] == quads.light[known]:
        if len(shared) != 1:
            return None
        corner = shared[0]
        row, column = divmod(numbers[int(nodes[quad][corner])], side)
        # The shared corner is the opposite corner of the other cell.
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
    """Whether no corner has another number already."""
    return all(numbers.get(node, marker) == marker for node, marker in zip(corner_nodes, ids, strict=True))


def refine_corners(gray: Gray, places: Points, edge_px: float) -> Points:
    """(N, 2) px: positions refined by cv2.cornerSubPix, unchanged where the refinement leaves its window.

    NaN outside the image.
    """
    inside = ((places >= 0) & (places <= np.array(gray.shape[1::-1]) - 1)).all(axis=1)
    refined = np.full(places.shape, np.nan)
    if inside.any():
        refined[inside] = _refine_sub_pixel(gray, places[inside], edge_px)
    return refined


def _refine_sub_pixel(gray: Gray, places: Points, edge_px: float) -> Points:
    import cv2

    window = max(round(SEARCH_WINDOW_EDGES * edge_px), MIN_SEARCH_WINDOW_PX)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
    start = places.astype(np.float32)[:, None]
    refined = cv2.cornerSubPix(gray, start.copy(), (window, window), (-1, -1), stop)[:, 0].astype(np.float64)
    near = np.linalg.norm(refined - places, axis=1) <= window
    return np.where(near[:, None], refined, places)
