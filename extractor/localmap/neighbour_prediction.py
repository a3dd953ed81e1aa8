"""Where a marker must lie as its neighbours see it: a local quadratic map from layout to image."""

from __future__ import annotations

import numpy as np

from extractor.layout.neighbour_tables import (
    LINEAR_TERMS,
    MIN_LINEAR_NEIGHBOURS,
    MIN_PIVOT,
    MIN_QUADRATIC_NEIGHBOURS,
    QUADRATIC_TERMS,
)
from extractor.localmap.ring_maps import (
    DETERMINED,
    IS_QUADRATIC,
    RIGHT_SIDE,
    SQUARED_MISFIT,
    allocate_ring_map_buffers,
    fill_map_solutions,
    fill_neighbours,
)
from extractor.numeric.batched_systems import LANES
from extractor.numeric.compilation import compiled, inlined_no_refcount

CUBIC_TERMS = 10  # the same terms and x^3, x^2 y, x y^2, y^3
MIN_CUBIC_NEIGHBOURS = 16  # neighbours, which leave a cubic something to miss


@inlined_no_refcount
def is_neighbour_outlier(xy_px, m, limit_px, weights, table):  # type: ignore[no-untyped-def]
    """Whether a known marker lies farther than the limit from where its neighbours put it, or these are not all known,
    or too few."""
    x, y = xy_px[m, 0], xy_px[m, 1]
    for k in range(table.shape[1]):
        if table[m, k] >= 0:
            x -= weights[m, k] * xy_px[table[m, k], 0]
            y -= weights[m, k] * xy_px[table[m, k], 1]
    return not x * x + y * y <= limit_px**2  # also where that is not a number


@compiled
def _update_to_cholesky_factor(matrix, terms):  # type: ignore[no-untyped-def]
    """Cholesky factor in place; False when the neighbours do not determine the map."""
    for i in range(terms):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not total > MIN_PIVOT:
                    return False
                matrix[i, i] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return True


@compiled
def _update_to_solution(factor, terms, vector):  # type: ignore[no-untyped-def]
    """Solve in place with a Cholesky factor."""
    for i in range(terms):
        for k in range(i):
            vector[i] -= factor[i, k] * vector[k]
        vector[i] /= factor[i, i]
    for i in range(terms - 1, -1, -1):
        for k in range(i + 1, terms):
            vector[i] -= factor[k, i] * vector[k]
        vector[i] /= factor[i, i]


@compiled
def predict_markers(xy_px, wanted, marker_mm, table):  # type: ignore[no-untyped-def]
    """Where the wanted markers lie by their neighbours in two rings, themselves not counted.

    Returns:
        (M, 2) places in px; (M,) the variance per axis that the fit leaves in its neighbours, px^2; (M,) the
        leverage, by which the neighbours' own errors are multiplied; (M,) the number of neighbours. NaN where
        the neighbours are too few or on a line.
    """
    count = xy_px.shape[0]
    out = (
        np.full((count, 2), np.nan),
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.zeros(count, np.int32),
    )
    room, filled, members = allocate_ring_map_buffers(table.shape[1]), 0, np.empty(LANES, np.int64)
    for m in range(count):
        if not wanted[m]:
            continue
        n = fill_neighbours(xy_px, m, filled, marker_mm, table, room)
        out[3][m] = n
        if n >= MIN_LINEAR_NEIGHBOURS:
            room[1][IS_QUADRATIC * LANES + filled], members[filled] = n >= MIN_QUADRATIC_NEIGHBOURS, m
            filled += 1
        if filled == LANES:
            _fill_predictions(members, room, out)
            filled = 0
    if filled > 0:
        _fill_predictions(members[:filled], room, out)
    return out


@compiled
def _fill_predictions(members, room, out):  # type: ignore[no-untyped-def]
    """Write what ``predict_markers`` returns of these markers, which have the first lanes."""
    fill_map_solutions(room, members.shape[0])
    place, variance, leverage, support = out
    for lane in range(members.shape[0]):
        one = room[1][lane:]
        if one[DETERMINED * LANES] > 0.0:
            m, terms = members[lane], QUADRATIC_TERMS if one[IS_QUADRATIC * LANES] > 0.0 else LINEAR_TERMS
            place[m, 0], place[m, 1] = one[RIGHT_SIDE * LANES], one[(RIGHT_SIDE + QUADRATIC_TERMS) * LANES]
            leverage[m] = one[(RIGHT_SIDE + 2 * QUADRATIC_TERMS) * LANES]
            variance[m] = one[SQUARED_MISFIT * LANES] / (2.0 * max(support[m] - terms, 1))


@compiled
def cubic_variance(xy_px, wanted, marker_mm, table):  # type: ignore[no-untyped-def]
    """(M,) px^2, the variance per axis that a cubic map leaves in the neighbours of the wanted markers; infinite where
    these are fewer than ``MIN_CUBIC_NEIGHBOURS``.

    What is odd about the marker, as cubic terms are, hardly moves where a quadratic puts it, if its rings are (nearly)
    whole: a quadratic misses much of its neighbours on a surface that is bent, and is right about the middle.
    """
    out = np.full(xy_px.shape[0], np.inf)
    rows, seen = np.ones((table.shape[1], CUBIC_TERMS)), np.empty((table.shape[1], 2))
    for m in np.flatnonzero(wanted):
        n = _fill_neighbour_rows(xy_px, m, marker_mm, table, rows, seen)
        if n >= MIN_CUBIC_NEIGHBOURS:
            out[m] = _fill_rows_for_cubic_variance(rows[:n], seen[:n])
    return out


@compiled
def _fill_neighbour_rows(xy_px, m, marker_mm, table, rows, seen):  # type: ignore[no-untyped-def]
    """Write x and y of the known neighbours of a marker, in units of their mean distance, into the columns 1 and 2 of
    ``rows``, and where they are seen; their number."""
    scale, n = 0.0, 0
    for j in table[m]:
        if j >= 0 and not np.isnan(xy_px[j, 0]):
            rows[n, 1], rows[n, 2] = marker_mm[j] - marker_mm[m]
            seen[n] = xy_px[j]
            scale += np.hypot(rows[n, 1], rows[n, 2])
            n += 1
    rows[:n, 1:3] *= n / max(scale, 1e-12)
    return n


@compiled
def _fill_rows_for_cubic_variance(rows, seen):  # type: ignore[no-untyped-def]
    """The variance per axis about the cubic through places ``seen`` (n, 2); their x and y are columns 1 and 2 of
    ``rows`` (n, 10), whose others are written here."""
    normal, sides = np.zeros((CUBIC_TERMS, CUBIC_TERMS)), np.zeros((2, CUBIC_TERMS))
    for k in range(rows.shape[0]):
        x, y = rows[k, 1], rows[k, 2]
        rows[k, 3], rows[k, 4], rows[k, 5] = x * x, x * y, y * y
        rows[k, 6], rows[k, 7], rows[k, 8], rows[k, 9] = x * x * x, x * x * y, x * y * y, y * y * y
        for a in range(CUBIC_TERMS):
            for axis in range(2):
                sides[axis, a] += rows[k, a] * seen[k, axis]
            for b in range(a + 1):
                normal[a, b] += rows[k, a] * rows[k, b]
    if not _update_to_cholesky_factor(normal, CUBIC_TERMS):
        return np.inf
    squares = 0.0
    for axis in range(2):
        _update_to_solution(normal, CUBIC_TERMS, sides[axis])
        for k in range(rows.shape[0]):
            miss = seen[k, axis]
            for a in range(CUBIC_TERMS):
                miss -= rows[k, a] * sides[axis, a]
            squares += miss * miss
    return squares / (2.0 * (rows.shape[0] - CUBIC_TERMS))
