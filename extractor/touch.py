"""Cells that touch: neighbours in the pattern share a corner, and a triangle's ink and corner tell which cell it is.

Nothing is extrapolated here but one cell's own triangle over its neighbour, and back: cells that hang together by
corners are numbered alike, wherever damage has cut the mesh (the article's eqs. 4 and 5).
"""

from __future__ import annotations

import numpy as np

from .engine import compiled
from .near import bucketed, nearest

SHARED = 0.3  # of the shorter edge, between the corners of two triangles at one marker
MAX_ASIDE = 0.35  # of the way between two neighbours' centers, where each one's triangle expects the other
MAX_TURNED = (
    0.5  # of a map's size, between two cells' maps of the layout to the image; turned by a third it is 1.7
)
CLOSE = 1.6  # of an edge, between the centers of neighbours where a triangle is missing to tell
# Along ``lattice.SIX`` a cell and its neighbour share this corner of the cell, and that of the neighbour.
OWN = np.array([1, 2, 2, 0, 0, 1])
THEIRS = np.array([0, 0, 1, 1, 2, 2])


@compiled
def edge_of(area):  # type: ignore[no-untyped-def]
    """The edge of an equilateral triangle."""
    return np.sqrt(area * 4.0 / np.sqrt(3.0))


@compiled
def own_map(center, corner, arms, turn, step, out):  # type: ignore[no-untyped-def]
    """Write the image step per layout step that carries a cell's arms onto its triangle, counted from ``turn``."""
    a, b = arms[0], arms[1]
    area = a[0] * b[1] - a[1] * b[0]
    for axis in range(2):
        p, q = corner[turn, axis] - center[axis], corner[(turn + step) % 3, axis] - center[axis]
        out[axis, 0] = (p * b[1] - q * a[1]) / area
        out[axis, 1] = (q * a[0] - p * b[0]) / area


@compiled
def touching(center, corner, area, whole, cell, seen_as, tables, step):  # type: ignore[no-untyped-def]
    """(N, 6) int32, the whole numbered cells that are a whole numbered cell's neighbours and share that corner with it
    by which they are, or -1; close by where a triangle is missing."""
    center_mm, arms_mm, beside = tables
    out = np.full((cell.shape[0], 6), -1, np.int32)
    for i in range(cell.shape[0]):
        if cell[i] < 0 or not whole[i]:
            continue
        for k in range(3):  # the other way from the other cell
            v = beside[cell[i], k]
            if v < 0 or seen_as[v] < 0 or not whole[seen_as[v]]:
                continue
            j = seen_as[v]
            edge = edge_of(min(area[i], area[j]))
            x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
            if np.isnan(corner[i, 0, 0]) or np.isnan(corner[j, 0, 0]):
                touch = x * x + y * y < (CLOSE * edge) ** 2
            else:
                touch = False
                for a in range(3):
                    for b in range(3):
                        u, w = corner[j, b, 0] - corner[i, a, 0], corner[j, b, 1] - corner[i, a, 1]
                        if u * u + w * w < (SHARED * edge) ** 2:
                            here = center[i], corner[i], arms_mm[cell[i]], (a + 6 - step * OWN[k]) % 3
                            there = center[j], corner[j], arms_mm[v], (b + 6 - step * THEIRS[k]) % 3
                            way = center_mm[v] - center_mm[cell[i]]
                            touch = touch or (
                                _leads(here, x, y, way, step) and _leads(there, -x, -y, -way, step)
                            )
            if touch:
                out[i, k], out[j, k + 3] = j, i
    return out


@compiled
def _leads(triangle, x, y, way, step):  # type: ignore[no-untyped-def]
    """Whether a triangle, counted from its turn, carries this way in the layout near (x, y) from its center."""
    center, corner, arms, turn = triangle
    own = np.empty((2, 2))
    own_map(center, corner, arms, turn, step, own)
    u, v = own[0, 0] * way[0] + own[0, 1] * way[1] - x, own[1, 0] * way[0] + own[1, 1] * way[1] - y
    return u * u + v * v < MAX_ASIDE**2 * (x * x + y * y)


@compiled
def turn_like(center, corner, arms, step, wanted, out):  # type: ignore[no-untyped-def]
    """From which corner a triangle is counted for its map, written to ``out``, to be like the wanted one; -1 where
    none is, or it has none."""
    if np.isnan(corner[0, 0]) or np.isnan(wanted[0, 0]):
        return -1
    best, found = MAX_TURNED * np.sqrt((wanted**2).sum()), -1
    for turn in range(3):
        own_map(center, corner, arms, turn, step, out)
        apart = np.sqrt(((out - wanted) ** 2).sum())
        if apart < best:
            best, found = apart, turn
    if found >= 0:
        own_map(center, corner, arms, found, step, out)
    return found


@compiled
def spread(center, corner, area, ink, loose, cell, free, turn, maps, fresh, tables, step):  # type: ignore[no-untyped-def]
    """Number, in place, the loose whole cells that touch numbered ones, the cells that touch these, and so on.

    Args:
        loose: the cells without a number that have a triangle. fresh: the numbered ones to begin at.
        turn: (N,) from which corner each numbered cell's triangle is counted, -1 unknown; maps: (N, 2, 2), by it.

    Returns:
        The cells that were numbered.
    """
    center_mm, ink_of, arms_mm, beside = tables
    queue = np.empty(fresh.shape[0] + loose.shape[0], np.int64)
    begin, end = 0, 0
    for i in fresh:
        if turn[i] >= 0:
            queue[end] = i
            end += 1
    first = end
    if end == 0 or loose.shape[0] == 0:
        return queue[:0]
    xy = center[loose]
    grid = bucketed(xy)
    index, square, back = np.empty(2, np.int32), np.empty(2), np.empty((2, 2))
    while begin < end:
        i = queue[begin]
        begin += 1
        u = cell[i]
        for k in range(6):
            v = beside[u, k]
            if v < 0 or not free[v]:
                continue
            x, y = center_mm[v, 0] - center_mm[u, 0], center_mm[v, 1] - center_mm[u, 1]
            px = center[i, 0] + maps[i, 0, 0] * x + maps[i, 0, 1] * y
            py = center[i, 1] + maps[i, 1, 0] * x + maps[i, 1, 1] * y
            at = corner[i, (turn[i] + step * OWN[k]) % 3]
            for n in range(nearest(xy, grid, px, py, index, square)):
                j = loose[index[n]]
                if cell[j] >= 0 or ink[j] != ink_of[v]:
                    continue
                way2 = (center[j, 0] - center[i, 0]) ** 2 + (center[j, 1] - center[i, 1]) ** 2
                if square[n] > MAX_ASIDE**2 * way2:
                    continue
                limit = (SHARED * edge_of(min(area[i], area[j]))) ** 2
                for c in range(3):
                    if (corner[j, c, 0] - at[0]) ** 2 + (corner[j, c, 1] - at[1]) ** 2 > limit:
                        continue
                    turned = (c + 6 - step * THEIRS[k]) % 3
                    there = center[j], corner[j], arms_mm[v], turned
                    back_x, back_y = center[i, 0] - center[j, 0], center[i, 1] - center[j, 1]
                    if not _leads(there, back_x, back_y, center_mm[u] - center_mm[v], step):
                        continue
                    own_map(center[j], corner[j], arms_mm[v], turned, step, back)
                    cell[j], free[v], turn[j] = v, False, turned
                    maps[j] = back
                    queue[end] = j
                    end += 1
                    break
                if cell[j] >= 0:
                    break
    return queue[first:end]
