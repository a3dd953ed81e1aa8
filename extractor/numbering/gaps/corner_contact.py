"""Cells that touch: neighbours in the pattern share a corner, and a triangle's ink and corner tell which cell it is.

Nothing is extrapolated here but one cell's own triangle over its neighbour, and back: cells that hang together by
corners are numbered alike, wherever damage has cut the mesh (the article's eqs. 4 and 5).
"""

from __future__ import annotations

import numpy as np

from extractor.localmap.affine_maps import fill_linear_map
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points

MAX_CORNER_DISTANCE = 0.3  # of the shorter edge, between the corners of two triangles at one marker
MAX_PREDICTED_DISTANCE = (
    0.35  # of the way between two neighbours' centers, where each one's triangle expects the other
)
MAX_MAP_DIFFERENCE = (
    0.5  # of a map's size, between two cells' maps of the layout to the image; turned by a third it is 1.7
)
TURN_NOT_EVALUATED = -2
MAX_NEIGHBOUR_DISTANCE = (
    1.6  # of an edge, between the centers of neighbours where a triangle is missing to tell
)
# Along ``lattice.SIX`` a cell and its neighbour share this corner of the cell, and that of the neighbour.
OWN_CORNER = np.array([1, 2, 2, 0, 0, 1])
NEIGHBOUR_CORNER = np.array([0, 0, 1, 1, 2, 2])


@inlined_no_refcount
def equilateral_edge(area):  # type: ignore[no-untyped-def]
    """The edge of an equilateral triangle."""
    return np.sqrt(area * 4.0 / np.sqrt(3.0))


@inlined_no_refcount
def triangle_map(center, corner, i, arms, u, turn, step):  # type: ignore[no-untyped-def]
    """The image step per layout step, row by row, that carries the arms of the layout's cell u onto cell i's triangle,
    counted from ``orientation``."""
    ax, ay, bx, by = arms[u, 0, 0], arms[u, 0, 1], arms[u, 1, 0], arms[u, 1, 1]
    area, after = ax * by - ay * bx, (turn + step) % 3
    px, qx = corner[i, turn, 0] - center[i, 0], corner[i, after, 0] - center[i, 0]
    py, qy = corner[i, turn, 1] - center[i, 1], corner[i, after, 1] - center[i, 1]
    return (
        (px * by - qx * ay) / area,
        (qx * ax - px * bx) / area,
        (py * by - qy * ay) / area,
        (qy * ax - py * bx) / area,
    )


@compiled
def corner_neighbours(center, corner, area, whole, cell, seen_as, plan, step):  # type: ignore[no-untyped-def]
    """(N, 6) int32, the whole numbered cells that are a whole numbered cell's neighbours and share that corner with it
    by which they are, or -1; close by where a triangle is missing."""
    out = np.full((cell.shape[0], 6), -1, np.int32)
    update_corner_neighbours(
        np.ones(cell.shape[0], np.bool_), center, corner, area, whole, cell, seen_as, plan, step, out
    )
    return out


@compiled
def update_corner_neighbours(fresh, center, corner, area, whole, cell, seen_as, plan, step, out):  # type: ignore[no-untyped-def]
    """Write, in place, what ``fresh`` cells (N,), numbered now, add to what ``corner_neighbours`` gave."""
    for i in range(cell.shape[0]):
        if cell[i] < 0 or not whole[i]:
            continue
        for k in range(3):  # the other way from the other cell
            v = plan.cell_neighbours[cell[i], k]
            if v < 0 or seen_as[v] < 0 or not whole[seen_as[v]]:
                continue
            j = seen_as[v]
            if (fresh[i] or fresh[j]) and _has_shared_corner(
                center, corner, area, i, j, cell[i], v, k, plan, step
            ):
                out[i, k], out[j, k + 3] = j, i


@inlined_no_refcount
def _has_shared_corner(center, corner, area, i, j, u, v, k, plan, step):  # type: ignore[no-untyped-def]
    """Whether cells i and j, if they are the layout's u and its neighbour v along k, touch as these do."""
    edge = equilateral_edge(min(area[i], area[j]))
    if np.isnan(corner[i, 0, 0]) or np.isnan(corner[j, 0, 0]):
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        return x * x + y * y < (MAX_NEIGHBOUR_DISTANCE * edge) ** 2
    limit = (MAX_CORNER_DISTANCE * edge) ** 2
    for a in range(3):
        for b in range(3):
            x, y = corner[j, b, 0] - corner[i, a, 0], corner[j, b, 1] - corner[i, a, 1]
            if x * x + y * y < limit:
                here, there = (a + 6 - step * OWN_CORNER[k]) % 3, (b + 6 - step * NEIGHBOUR_CORNER[k]) % 3
                if _is_neighbour_predicted(
                    center, corner, i, j, u, v, here, plan, step
                ) and _is_neighbour_predicted(center, corner, j, i, v, u, there, plan, step):
                    return True
    return False


@inlined_no_refcount
def _is_neighbour_predicted(center, corner, i, j, u, v, turn, plan, step):  # type: ignore[no-untyped-def]
    """Whether cell i's triangle, counted from its turn, carries the way from u to v in the layout near cell j."""
    a, b, c, d = triangle_map(center, corner, i, plan.corner_vectors_mm, u, turn, step)
    x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
    way_x, way_y = (
        plan.center_mm[v, 0] - plan.center_mm[u, 0],
        plan.center_mm[v, 1] - plan.center_mm[u, 1],
    )
    aside_x, aside_y = a * way_x + b * way_y - x, c * way_x + d * way_y - y
    return aside_x * aside_x + aside_y * aside_y < MAX_PREDICTED_DISTANCE**2 * (x * x + y * y)


@inlined_no_refcount
def fill_map_by_similarity(center, corner, i, arms, u, step, wanted, out):  # type: ignore[no-untyped-def]
    """From which corner the triangle of cell i, the layout's u, is counted for its map, written to ``out``, to be like
    the wanted one; -1 where none is, or it has none."""
    if np.isnan(corner[i, 0, 0]) or np.isnan(wanted[0, 0]):
        return -1
    w0, w1, w2, w3 = wanted[0, 0], wanted[0, 1], wanted[1, 0], wanted[1, 1]
    best, found = MAX_MAP_DIFFERENCE * np.sqrt(w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3), -1
    for turn in range(3):
        a, b, c, d = triangle_map(center, corner, i, arms, u, turn, step)
        apart = np.sqrt((a - w0) ** 2 + (b - w1) ** 2 + (c - w2) ** 2 + (d - w3) ** 2)
        if apart < best:
            best, found = apart, turn
            out[0, 0], out[0, 1], out[1, 0], out[1, 1] = a, b, c, d
    return found


@inlined_no_refcount
def fill_map_by_neighbours(center, corner, i, u, seen, plan, step, out):  # type: ignore[no-untyped-def]
    """From which corner the triangle of cell i, the layout's u, is counted by the cells ``seen`` (U,) around it; its
    map is written to ``out``."""
    fill_linear_map(i, center, u, seen, plan.center_mm, plan.cell_neighbours, out)
    return fill_map_by_similarity(center, corner, i, plan.corner_vectors_mm, u, step, out, out)


@compiled
def update_numbers_by_contact(  # type: ignore[no-untyped-def]
    center, corner, area, ink, loose, cell, free, turn, maps, seen, fresh, plan, step
):
    """Number, in place, the loose whole cells that touch numbered ones, the cells that touch these, and so on.

    Args:
        loose: the cells without a number that have a triangle. fresh: the numbered ones to begin at.
        turn: (N,) from which corner each numbered cell's triangle is counted, -1 unknown, ``TURN_NOT_EVALUATED``
            before it is
            asked; maps: (N, 2, 2), by it. seen: (U,) the cells of the image by which it is asked.

    Returns:
        The cells that were numbered.
    """
    queue = np.empty(fresh.shape[0] + loose.shape[0], np.int64)
    begin, end = 0, 0
    if loose.shape[0] > 0:
        for i in fresh:
            if _has_free_neighbour(plan.cell_neighbours, cell[i], free):
                if turn[i] == TURN_NOT_EVALUATED:
                    turn[i] = fill_map_by_neighbours(center, corner, i, cell[i], seen, plan, step, maps[i])
                if turn[i] >= 0:
                    queue[end] = i
                    end += 1
    first = end
    if end == 0:
        return queue[:0]
    xy = center[loose]
    grid = bucket_grid(xy)
    index, square = np.empty(2, np.int32), np.empty(2)
    while begin < end:
        i = queue[begin]
        begin += 1
        u = cell[i]
        for k in range(6):
            v = plan.cell_neighbours[u, k]
            if v < 0 or not free[v]:
                continue
            x, y = plan.center_mm[v, 0] - plan.center_mm[u, 0], plan.center_mm[v, 1] - plan.center_mm[u, 1]
            px = center[i, 0] + maps[i, 0, 0] * x + maps[i, 0, 1] * y
            py = center[i, 1] + maps[i, 1, 0] * x + maps[i, 1, 1] * y
            for n in range(fill_nearest_points(xy, grid, px, py, index, square)):
                j = loose[index[n]]
                if cell[j] >= 0 or ink[j] != plan.ink[v]:
                    continue
                way2 = (center[j, 0] - center[i, 0]) ** 2 + (center[j, 1] - center[i, 1]) ** 2
                if square[n] > MAX_PREDICTED_DISTANCE**2 * way2:
                    continue
                turned = _turn_at_shared_corner(center, corner, area, i, j, u, v, k, turn[i], plan, step)
                if turned >= 0:
                    cell[j], free[v], turn[j] = v, False, turned
                    a, b, c, d = triangle_map(center, corner, j, plan.corner_vectors_mm, v, turned, step)
                    maps[j, 0, 0], maps[j, 0, 1], maps[j, 1, 0], maps[j, 1, 1] = a, b, c, d
                    queue[end] = j
                    end += 1
                    break
    return queue[first:end]


@inlined_no_refcount
def _has_free_neighbour(beside, u, free):  # type: ignore[no-untyped-def]
    """Whether a place of the layout beside u is free."""
    for k in range(6):
        v = beside[u, k]
        if v >= 0 and free[v]:
            return True
    return False


@inlined_no_refcount
def _turn_at_shared_corner(center, corner, area, i, j, u, v, k, turn, plan, step):  # type: ignore[no-untyped-def]
    """From which corner cell j's triangle is counted if it is v, the neighbour along k of u, which is cell i counted
    from ``orientation``; -1 where it does not touch as v does."""
    at, limit = (
        (turn + step * OWN_CORNER[k]) % 3,
        (MAX_CORNER_DISTANCE * equilateral_edge(min(area[i], area[j]))) ** 2,
    )
    for c in range(3):
        x, y = corner[j, c, 0] - corner[i, at, 0], corner[j, c, 1] - corner[i, at, 1]
        if x * x + y * y <= limit:
            turned = (c + 6 - step * NEIGHBOUR_CORNER[k]) % 3
            if _is_neighbour_predicted(center, corner, j, i, v, u, turned, plan, step):
                return turned
    return -1
