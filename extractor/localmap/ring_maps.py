"""Quadratic maps from layout to image through the markers of two rings: for many markers at once.

Up to ``LANES`` markers stand side by side. A neighbour that is not known is 0 throughout.
"""

from __future__ import annotations

import numpy as np

from extractor.layout.neighbour_tables import LINEAR_TERMS, MIN_PIVOT, QUADRATIC_TERMS, RIGHT_SIDES
from extractor.numeric.batched_systems import (
    LANES,
    add_row_product,
    packed_index,
    update_to_cholesky_factors,
    update_to_solutions,
)
from extractor.numeric.compilation import compiled, inlined

# Rows of lanes: of a neighbour the terms and its place in the image; the neighbours' mean distance in the layout; 1 for
# a quadratic, 0 for a linear map; the squares that the map leaves; 1 where the neighbours determine it;
PLACE_X, PLACE_Y, SCALE, IS_QUADRATIC, SQUARED_MISFIT, DETERMINED = 6, 7, 8, 9, 10, 11
# of the normal equations the lower triangle; their right sides, which the solutions replace.
NORMAL, RIGHT_SIDE = 12, 12 + QUADRATIC_TERMS * (QUADRATIC_TERMS + 1) // 2
ROWS = RIGHT_SIDE + RIGHT_SIDES * QUADRATIC_TERMS
KNOWN, X, Y, U, V, NEIGHBOUR_ROWS = 0, 1, 2, 3, 4, 5  # rows of what is laid of every neighbour


@compiled
def allocate_ring_map_buffers(neighbours):  # type: ignore[no-untyped-def]
    """What ``LANES`` maps through so many neighbours are computed in: these, and the rows, both flat."""
    rows = np.zeros(ROWS * LANES)
    rows[SCALE * LANES : (IS_QUADRATIC + 1) * LANES] = 1.0
    return np.zeros(neighbours * NEIGHBOUR_ROWS * LANES), rows


@inlined
def fill_neighbours(xy, m, lane, marker_mm, table, room):  # type: ignore[no-untyped-def]
    """Write the known neighbours of marker m into a lane; how many there are."""
    around, rows = room
    scale, n = 0.0, 0
    for k in range(table.shape[1]):
        j, at = table[m, k], k * NEIGHBOUR_ROWS * LANES + lane
        if j < 0 or np.isnan(xy[j, 0]):
            for row in range(NEIGHBOUR_ROWS):
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
def fill_map_solutions(room, lanes):  # type: ignore[no-untyped-def]
    """Lay the maps through the neighbours of the first lanes; terms of x, y and leverage are the right sides' rows."""
    around, rows = room
    rows[SQUARED_MISFIT * LANES : DETERMINED * LANES], rows[NORMAL * LANES :] = 0.0, 0.0
    rows[DETERMINED * LANES : NORMAL * LANES] = 1.0
    for k in range(0, around.shape[0], NEIGHBOUR_ROWS * LANES):
        _fill_terms(around[k:], rows, lanes)
        _accumulate_normal_equations(rows, lanes)
    for lane in range(lanes):
        rows[(RIGHT_SIDE + 2 * QUADRATIC_TERMS) * LANES + lane] = 1.0
        for a in range(LINEAR_TERMS, QUADRATIC_TERMS):
            rows[(NORMAL + packed_index(a, a)) * LANES + lane] += 1.0 - rows[IS_QUADRATIC * LANES + lane]
    update_to_cholesky_factors(rows, NORMAL, QUADRATIC_TERMS, MIN_PIVOT, DETERMINED, lanes)
    for side in range(RIGHT_SIDE, ROWS, QUADRATIC_TERMS):
        update_to_solutions(rows, NORMAL, QUADRATIC_TERMS, side, lanes)
    for k in range(0, around.shape[0], NEIGHBOUR_ROWS * LANES):
        _fill_terms(around[k:], rows, lanes)
        _accumulate_squared_misfit(rows, lanes)


@compiled
def _fill_terms(laid, rows, lanes):  # type: ignore[no-untyped-def]
    """Write the terms of a neighbour of every lane, and its place."""
    for lane in range(lanes):
        scale, bent = rows[SCALE * LANES + lane], rows[IS_QUADRATIC * LANES + lane]
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
def _accumulate_normal_equations(rows, lanes):  # type: ignore[no-untyped-def]
    """Add a neighbour of every lane to the normal equations."""
    for a in range(QUADRATIC_TERMS):
        for b in range(a + 1):
            add_row_product(rows, NORMAL + packed_index(a, b), a, b, lanes)
        add_row_product(rows, RIGHT_SIDE + a, a, PLACE_X, lanes)
        add_row_product(rows, RIGHT_SIDE + QUADRATIC_TERMS + a, a, PLACE_Y, lanes)


@compiled
def _accumulate_squared_misfit(rows, lanes):  # type: ignore[no-untyped-def]
    """Add the squared distance of a neighbour of every lane from where the map puts it."""
    for lane in range(lanes):
        one, x, y = rows[lane], rows[LANES + lane], rows[2 * LANES + lane]
        xx, xy, yy = rows[3 * LANES + lane], rows[4 * LANES + lane], rows[5 * LANES + lane]
        u = rows[PLACE_X * LANES + lane] - rows[RIGHT_SIDE * LANES + lane] * one
        v = rows[PLACE_Y * LANES + lane] - rows[(RIGHT_SIDE + 6) * LANES + lane] * one
        u -= rows[(RIGHT_SIDE + 1) * LANES + lane] * x
        v -= rows[(RIGHT_SIDE + 7) * LANES + lane] * x
        u -= rows[(RIGHT_SIDE + 2) * LANES + lane] * y
        v -= rows[(RIGHT_SIDE + 8) * LANES + lane] * y
        u -= rows[(RIGHT_SIDE + 3) * LANES + lane] * xx
        v -= rows[(RIGHT_SIDE + 9) * LANES + lane] * xx
        u -= rows[(RIGHT_SIDE + 4) * LANES + lane] * xy
        v -= rows[(RIGHT_SIDE + 10) * LANES + lane] * xy
        u -= rows[(RIGHT_SIDE + 5) * LANES + lane] * yy
        v -= rows[(RIGHT_SIDE + 11) * LANES + lane] * yy
        rows[SQUARED_MISFIT * LANES + lane] += u * u + v * v
