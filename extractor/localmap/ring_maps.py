"""Quadratic maps from layout to image through the markers of two rings, for many markers at once.

Up to ``LANES`` markers are computed together, one in each lane. All numbers of an unknown neighbour are 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.neighbour_tables import LINEAR_TERMS, MIN_PIVOT, QUADRATIC_TERMS, RIGHT_SIDES
from extractor.numeric.batched_systems import (
    LANES,
    add_row_product,
    packed_index,
    update_to_cholesky_factors,
    update_to_solutions,
)
from extractor.numeric.compilation import compiled, inlined

# Rows of lanes: 0 to 5 the terms of one neighbour; its place in the image, px; the neighbours' mean distance in the
# layout, mm; 1 for a quadratic, 0 for a linear map; the sum of squared misfits, px^2; 1 where the map is determined;
PLACE_X, PLACE_Y, SCALE, IS_QUADRATIC, SQUARED_MISFIT, DETERMINED = 6, 7, 8, 9, 10, 11
# the lower triangle of the normal equations; their right sides, then the solutions.
NORMAL, RIGHT_SIDE = 12, 12 + QUADRATIC_TERMS * (QUADRATIC_TERMS + 1) // 2
ROWS = RIGHT_SIDE + RIGHT_SIDES * QUADRATIC_TERMS
KNOWN, X, Y, U, V, NEIGHBOUR_ROWS = 0, 1, 2, 3, 4, 5  # rows of each neighbour: 1 if known, mm, mm, px, px


class RingMapBuffers(NamedTuple):
    """Memory for ``LANES`` maps.

    Attributes:
        neighbours: flat (K, ``NEIGHBOUR_ROWS``, ``LANES``) float64, K neighbours of each marker.
        rows: flat (``ROWS``, ``LANES``) float64.
    """

    neighbours: NDArray[np.float64]
    rows: NDArray[np.float64]


@compiled
def allocate_ring_map_buffers(neighbours):  # type: ignore[no-untyped-def]
    """``RingMapBuffers`` for maps through so many neighbours."""
    rows = np.zeros(ROWS * LANES)
    rows[SCALE * LANES : (IS_QUADRATIC + 1) * LANES] = 1.0
    return RingMapBuffers(np.zeros(neighbours * NEIGHBOUR_ROWS * LANES), rows)


@inlined
def fill_neighbours(xy, m, lane, marker_mm, table, buffers):  # type: ignore[no-untyped-def]
    """Write the known neighbours of marker m into a lane.

    Args:
        xy: (M, 2) px, the markers' places, NaN unknown. marker_mm: (M, 2) in the layout.
        table: (M, K) int32, the neighbours of each marker, or -1.
        buffers: ``RingMapBuffers``.

    Returns:
        How many neighbours are known.
    """
    neighbours, rows = buffers.neighbours, buffers.rows
    scale, n = 0.0, 0
    for k in range(table.shape[1]):
        j, at = table[m, k], k * NEIGHBOUR_ROWS * LANES + lane
        if j < 0 or np.isnan(xy[j, 0]):
            for row in range(NEIGHBOUR_ROWS):
                neighbours[at + row * LANES] = 0.0
            continue
        x, y = marker_mm[j, 0] - marker_mm[m, 0], marker_mm[j, 1] - marker_mm[m, 1]
        neighbours[at + KNOWN * LANES], neighbours[at + X * LANES], neighbours[at + Y * LANES] = 1.0, x, y
        neighbours[at + U * LANES], neighbours[at + V * LANES] = xy[j, 0], xy[j, 1]
        scale += np.hypot(x, y)
        n += 1
    rows[SCALE * LANES + lane] = scale / n if n > 0 else 1.0
    return n


@compiled
def fill_map_solutions(buffers, lanes):  # type: ignore[no-untyped-def]
    """Fit the maps of the first ``lanes``; the right sides' rows receive the terms of x and y and the leverage."""
    neighbours, rows = buffers.neighbours, buffers.rows
    rows[SQUARED_MISFIT * LANES : DETERMINED * LANES], rows[NORMAL * LANES :] = 0.0, 0.0
    rows[DETERMINED * LANES : NORMAL * LANES] = 1.0
    for k in range(0, neighbours.shape[0], NEIGHBOUR_ROWS * LANES):
        _fill_terms(neighbours[k:], rows, lanes)
        _accumulate_normal_equations(rows, lanes)
    for lane in range(lanes):
        rows[(RIGHT_SIDE + 2 * QUADRATIC_TERMS) * LANES + lane] = 1.0
        for a in range(LINEAR_TERMS, QUADRATIC_TERMS):
            rows[(NORMAL + packed_index(a, a)) * LANES + lane] += 1.0 - rows[IS_QUADRATIC * LANES + lane]
    update_to_cholesky_factors(rows, NORMAL, QUADRATIC_TERMS, MIN_PIVOT, DETERMINED, lanes)
    for side in range(RIGHT_SIDE, ROWS, QUADRATIC_TERMS):
        update_to_solutions(rows, NORMAL, QUADRATIC_TERMS, side, lanes)
    for k in range(0, neighbours.shape[0], NEIGHBOUR_ROWS * LANES):
        _fill_terms(neighbours[k:], rows, lanes)
        _accumulate_squared_misfit(rows, lanes)


@compiled
def _fill_terms(neighbour, rows, lanes):  # type: ignore[no-untyped-def]
    """Write the terms and the place of one neighbour in every lane."""
    for lane in range(lanes):
        scale, is_quadratic = rows[SCALE * LANES + lane], rows[IS_QUADRATIC * LANES + lane]
        x, y = neighbour[X * LANES + lane] / scale, neighbour[Y * LANES + lane] / scale
        rows[lane] = neighbour[lane]
        rows[LANES + lane] = x
        rows[2 * LANES + lane] = y
        rows[3 * LANES + lane] = x * x * is_quadratic
        rows[4 * LANES + lane] = x * y * is_quadratic
        rows[5 * LANES + lane] = y * y * is_quadratic
        rows[PLACE_X * LANES + lane] = neighbour[U * LANES + lane]
        rows[PLACE_Y * LANES + lane] = neighbour[V * LANES + lane]


@compiled
def _accumulate_normal_equations(rows, lanes):  # type: ignore[no-untyped-def]
    """Add one neighbour of every lane to the normal equations."""
    for a in range(QUADRATIC_TERMS):
        for b in range(a + 1):
            add_row_product(rows, NORMAL + packed_index(a, b), a, b, lanes)
        add_row_product(rows, RIGHT_SIDE + a, a, PLACE_X, lanes)
        add_row_product(rows, RIGHT_SIDE + QUADRATIC_TERMS + a, a, PLACE_Y, lanes)


@compiled
def _accumulate_squared_misfit(rows, lanes):  # type: ignore[no-untyped-def]
    """Add the squared misfit, px^2, of one neighbour of every lane."""
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
