"""Predicts a marker's place from its neighbours by a local quadratic map from layout to image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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

CUBIC_TERMS = 10  # 1, x, y, x^2, xy, y^2, x^3, x^2 y, x y^2, y^3
MIN_CUBIC_NEIGHBOURS = 16  # neighbours of a cubic map with enough degrees of freedom


@inlined_no_refcount
def is_neighbour_outlier(xy_px, m, limit_px, weights, table):  # type: ignore[no-untyped-def]
    """Whether a known marker lies farther than the limit from its prediction by the neighbours.

    Also true where the neighbours are too few or not all known.

    Args:
        xy_px: (M, 2); m: the marker; limit_px: the largest distance.
        weights: (M, K) float64, of the neighbours in ``table`` (M, K) int32, as ``Lattice.ring_weights``.
    """
    x, y = xy_px[m, 0], xy_px[m, 1]
    for k in range(table.shape[1]):
        if table[m, k] >= 0:
            x -= weights[m, k] * xy_px[table[m, k], 0]
            y -= weights[m, k] * xy_px[table[m, k], 1]
    return not x * x + y * y <= limit_px**2  # true for NaN


@compiled
def _update_to_cholesky_factor(matrix, terms):  # type: ignore[no-untyped-def]
    """Replace a matrix by its Cholesky factor; False when the neighbours do not determine the map."""
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
    """Replace a vector by the solution with a Cholesky factor."""
    for i in range(terms):
        for k in range(i):
            vector[i] -= factor[i, k] * vector[k]
        vector[i] /= factor[i, i]
    for i in range(terms - 1, -1, -1):
        for k in range(i + 1, terms):
            vector[i] -= factor[k, i] * vector[k]
        vector[i] /= factor[i, i]


class MarkerPredictions(NamedTuple):
    """Predictions of M markers by their neighbours; NaN where the neighbours are too few or on a line.

    Attributes:
        xy_px: (M, 2) float64, the predicted places.
        variance_px2: (M,) float64, the residual variance per axis of the neighbours.
        leverage: (M,) float64, the factor from the variance of the neighbours to that of the prediction.
        neighbour_count: (M,) int32, the number of known neighbours.
    """

    xy_px: NDArray[np.float64]
    variance_px2: NDArray[np.float64]
    leverage: NDArray[np.float64]
    neighbour_count: NDArray[np.int32]


@compiled
def predict_markers(xy_px, wanted, marker_mm, table):  # type: ignore[no-untyped-def]
    """Predict the wanted markers from their neighbours; a marker's own place is not used.

    Args:
        xy_px: (M, 2) the markers' places, NaN unknown.
        wanted: (M,) bool.
        marker_mm: (M, 2) the markers in the layout.
        table: (M, K) int32, the neighbours of each marker, or -1.

    Returns:
        ``MarkerPredictions``.
    """
    count = xy_px.shape[0]
    out = MarkerPredictions(
        np.full((count, 2), np.nan),
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.zeros(count, np.int32),
    )
    buffers, filled, members = allocate_ring_map_buffers(table.shape[1]), 0, np.empty(LANES, np.int64)
    for m in range(count):
        if not wanted[m]:
            continue
        n = fill_neighbours(xy_px, m, filled, marker_mm, table, buffers)
        out.neighbour_count[m] = n
        if n >= MIN_LINEAR_NEIGHBOURS:
            buffers.rows[IS_QUADRATIC * LANES + filled] = n >= MIN_QUADRATIC_NEIGHBOURS
            members[filled] = m
            filled += 1
        if filled == LANES:
            _fill_predictions(members, buffers, out)
            filled = 0
    if filled > 0:
        _fill_predictions(members[:filled], buffers, out)
    return out


@compiled
def _fill_predictions(members, buffers, out):  # type: ignore[no-untyped-def]
    """Write the ``MarkerPredictions`` of the markers ``members``, which are in the first lanes."""
    fill_map_solutions(buffers, members.shape[0])
    for lane in range(members.shape[0]):
        column = buffers.rows[lane:]
        if column[DETERMINED * LANES] > 0.0:
            m, is_quadratic = members[lane], column[IS_QUADRATIC * LANES] > 0.0
            terms = QUADRATIC_TERMS if is_quadratic else LINEAR_TERMS
            out.xy_px[m, 0] = column[RIGHT_SIDE * LANES]
            out.xy_px[m, 1] = column[(RIGHT_SIDE + QUADRATIC_TERMS) * LANES]
            out.leverage[m] = column[(RIGHT_SIDE + 2 * QUADRATIC_TERMS) * LANES]
            degrees = 2.0 * max(out.neighbour_count[m] - terms, 1)
            out.variance_px2[m] = column[SQUARED_MISFIT * LANES] / degrees


@compiled
def cubic_variance(xy_px, wanted, marker_mm, table):  # type: ignore[no-untyped-def]
    """(M,) px^2, the residual variance per axis of a cubic map through the neighbours of the wanted markers.

    Infinite with fewer than ``MIN_CUBIC_NEIGHBOURS`` neighbours. Arguments as in ``predict_markers``.

    Cubic terms are odd about the marker. If its rings are (nearly) complete, they hardly change a quadratic prediction:
    on a bent surface a quadratic map has large residuals at the neighbours and is right in the middle.
    """
    out = np.full(xy_px.shape[0], np.inf)
    rows, places = np.ones((table.shape[1], CUBIC_TERMS)), np.empty((table.shape[1], 2))
    for m in np.flatnonzero(wanted):
        n = _fill_neighbour_rows(xy_px, m, marker_mm, table, rows, places)
        if n >= MIN_CUBIC_NEIGHBOURS:
            out[m] = _fill_rows_for_cubic_variance(rows[:n], places[:n])
    return out


@compiled
def _fill_neighbour_rows(xy_px, m, marker_mm, table, rows, places):  # type: ignore[no-untyped-def]
    """Write the known neighbours of marker m; returns their number.

    Columns 1 and 2 of ``rows`` receive x and y in the layout, in units of their mean distance; ``places`` (K, 2) those
    in the image, px.
    """
    scale, n = 0.0, 0
    for j in table[m]:
        if j >= 0 and not np.isnan(xy_px[j, 0]):
            rows[n, 1], rows[n, 2] = marker_mm[j] - marker_mm[m]
            places[n] = xy_px[j]
            scale += np.hypot(rows[n, 1], rows[n, 2])
            n += 1
    rows[:n, 1:3] *= n / max(scale, 1e-12)
    return n


@compiled
def _fill_rows_for_cubic_variance(rows, places):  # type: ignore[no-untyped-def]
    """The residual variance per axis, px^2, of the cubic map through ``places`` (n, 2).

    Columns 1 and 2 of ``rows`` (n, 10) are x and y in the layout; columns 3 to 9 are written.
    """
    normal, sides = np.zeros((CUBIC_TERMS, CUBIC_TERMS)), np.zeros((2, CUBIC_TERMS))
    for k in range(rows.shape[0]):
        x, y = rows[k, 1], rows[k, 2]
        rows[k, 3], rows[k, 4], rows[k, 5] = x * x, x * y, y * y
        rows[k, 6], rows[k, 7], rows[k, 8], rows[k, 9] = x * x * x, x * x * y, x * y * y, y * y * y
        for a in range(CUBIC_TERMS):
            for axis in range(2):
                sides[axis, a] += rows[k, a] * places[k, axis]
            for b in range(a + 1):
                normal[a, b] += rows[k, a] * rows[k, b]
    if not _update_to_cholesky_factor(normal, CUBIC_TERMS):
        return np.inf
    squares = 0.0
    for axis in range(2):
        _update_to_solution(normal, CUBIC_TERMS, sides[axis])
        for k in range(rows.shape[0]):
            misfit = places[k, axis]
            for a in range(CUBIC_TERMS):
                misfit -= rows[k, a] * sides[axis, a]
            squares += misfit * misfit
    return squares / (2.0 * (rows.shape[0] - CUBIC_TERMS))
