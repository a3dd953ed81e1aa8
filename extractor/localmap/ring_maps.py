"""Quadratic maps from layout to image through the markers of two rings: for many markers at once.

Up to ``LANES`` markers stand side by side. A neighbour that is not known is 0 throughout.
"""

from __future__ import annotations

import numpy as np

from extractor.layout.neighbour_tables import PIVOT, PLANE, SIDES, TERMS
from extractor.numeric.batched_systems import LANES, add_product, factor, place, solve
from extractor.numeric.compilation import compiled, inlined

# Rows of lanes: of a neighbour the terms and its place in the image; the neighbours' mean distance in the layout; 1 for
# a quadratic, 0 for a linear map; the squares that the map leaves; 1 where the neighbours determine it;
PLACE_X, PLACE_Y, SCALE, BENT, LEFT, SOUND = 6, 7, 8, 9, 10, 11
# of the normal equations the lower triangle; their right sides, which the solutions replace.
NORMAL, SIDE = 12, 12 + TERMS * (TERMS + 1) // 2
ROWS = SIDE + SIDES * TERMS
KNOWN, X, Y, U, V, LAID = 0, 1, 2, 3, 4, 5  # rows of what is laid of every neighbour


@compiled
def room_for_maps(neighbours):  # type: ignore[no-untyped-def]
    """What ``LANES`` maps through so many neighbours are computed in: these, and the rows, both flat."""
    rows = np.zeros(ROWS * LANES)
    rows[SCALE * LANES : (BENT + 1) * LANES] = 1.0
    return np.zeros(neighbours * LAID * LANES), rows


@inlined
def lay_neighbours(xy, m, lane, marker_mm, table, room):  # type: ignore[no-untyped-def]
    """Write the known neighbours of marker m into a lane; how many there are."""
    around, rows = room
    scale, n = 0.0, 0
    for k in range(table.shape[1]):
        j, at = table[m, k], k * LAID * LANES + lane
        if j < 0 or np.isnan(xy[j, 0]):
            for row in range(LAID):
                around[at + row * LANES] = 0.0
            continue
        x, y = marker_mm[j, 0] - marker_mm[m, 0], marker_mm[j, 1] - marker_mm[m, 1]
        around[at + KNOWN * LANES], around[at + X * LANES], around[at + Y * LANES] = 1.0, x, y
        around[at + U * LANES], around[at + V * LANES] = xy[j, 0], xy[j, 1]
        scale += np.hypot(x, y)
        n += 1
    rows[SCALE * LANES + lane] = scale / n if n > 0 else 1.0
    return n


@compiled
def solve_maps(room, lanes):  # type: ignore[no-untyped-def]
    """Lay the maps through the neighbours of the first lanes; terms of x, y and leverage are the right sides' rows."""
    around, rows = room
    rows[LEFT * LANES : SOUND * LANES], rows[NORMAL * LANES :] = 0.0, 0.0
    rows[SOUND * LANES : NORMAL * LANES] = 1.0
    for k in range(0, around.shape[0], LAID * LANES):
        _take(around[k:], rows, lanes)
        _add(rows, lanes)
    for lane in range(lanes):
        rows[(SIDE + 2 * TERMS) * LANES + lane] = 1.0
        for a in range(PLANE, TERMS):
            rows[(NORMAL + place(a, a)) * LANES + lane] += 1.0 - rows[BENT * LANES + lane]
    factor(rows, NORMAL, TERMS, PIVOT, SOUND, lanes)
    for side in range(SIDE, ROWS, TERMS):
        solve(rows, NORMAL, TERMS, side, lanes)
    for k in range(0, around.shape[0], LAID * LANES):
        _take(around[k:], rows, lanes)
        _leave(rows, lanes)


@compiled
def _take(laid, rows, lanes):  # type: ignore[no-untyped-def]
    """Write the terms of a neighbour of every lane, and its place."""
    for lane in range(lanes):
        scale, bent = rows[SCALE * LANES + lane], rows[BENT * LANES + lane]
        x, y = laid[X * LANES + lane] / scale, laid[Y * LANES + lane] / scale
        rows[lane] = laid[lane]
        rows[LANES + lane] = x
        rows[2 * LANES + lane] = y
        rows[3 * LANES + lane] = x * x * bent
        rows[4 * LANES + lane] = x * y * bent
        rows[5 * LANES + lane] = y * y * bent
        rows[PLACE_X * LANES + lane] = laid[U * LANES + lane]
        rows[PLACE_Y * LANES + lane] = laid[V * LANES + lane]


@compiled
def _add(rows, lanes):  # type: ignore[no-untyped-def]
    """Add a neighbour of every lane to the normal equations."""
    for a in range(TERMS):
        for b in range(a + 1):
            add_product(rows, NORMAL + place(a, b), a, b, lanes)
        add_product(rows, SIDE + a, a, PLACE_X, lanes)
        add_product(rows, SIDE + TERMS + a, a, PLACE_Y, lanes)


@compiled
def _leave(rows, lanes):  # type: ignore[no-untyped-def]
    """Add the squared distance of a neighbour of every lane from where the map puts it."""
    for lane in range(lanes):
        one, x, y = rows[lane], rows[LANES + lane], rows[2 * LANES + lane]
        xx, xy, yy = rows[3 * LANES + lane], rows[4 * LANES + lane], rows[5 * LANES + lane]
        u = rows[PLACE_X * LANES + lane] - rows[SIDE * LANES + lane] * one
        v = rows[PLACE_Y * LANES + lane] - rows[(SIDE + 6) * LANES + lane] * one
        u -= rows[(SIDE + 1) * LANES + lane] * x
        v -= rows[(SIDE + 7) * LANES + lane] * x
        u -= rows[(SIDE + 2) * LANES + lane] * y
        v -= rows[(SIDE + 8) * LANES + lane] * y
        u -= rows[(SIDE + 3) * LANES + lane] * xx
        v -= rows[(SIDE + 9) * LANES + lane] * xx
        u -= rows[(SIDE + 4) * LANES + lane] * xy
        v -= rows[(SIDE + 10) * LANES + lane] * xy
        u -= rows[(SIDE + 5) * LANES + lane] * yy
        v -= rows[(SIDE + 11) * LANES + lane] * yy
        rows[LEFT * LANES + lane] += u * u + v * v
