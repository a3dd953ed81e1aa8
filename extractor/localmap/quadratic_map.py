"""Where a cell that stands apart lies in the layout: by a quadratic map through the numbered cells nearest to it."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import (
    compiled,
    compiled_no_refcount,
    inlined_no_refcount,
    vectorized_no_refcount,
)
from extractor.numeric.median import median_of

SUPPORT_CELLS = 20  # numbered cells through which a map is laid
MAX_SUPPORT_DISTANCE = 4.5  # how far from the nearest of them a cell may stand, in cells
MAX_DEVIATION = 0.12  # of the map there, in cells
ROBUST_ROUNDS = 4  # what dirt has cut is among the witnesses, too
EXACT_MISFIT = 0.02  # of a cell: witnesses that fit so well are not judged
RIDGE = 1e-3  # holds the curvature of the map where the witnesses lie in a row
MIN_PIVOT = 1e-7  # of the normal matrix against its largest entry: below, they do lie in a row
TERMS = 6  # 1, x, y, xx, xy, yy
# A witness's products: of the terms with each other, those of one power together, and with its place in the layout.
PRODUCT_INDEX = np.array([[0, 1, 2, 3, 4, 5], [1, 3, 4, 6, 7, 8], [2, 4, 5, 7, 8, 9]])
PRODUCT_INDEX = np.concatenate(
    [PRODUCT_INDEX, [[3, 6, 7, 10, 11, 12], [4, 7, 8, 11, 12, 13], [5, 8, 9, 12, 13, 14]]]
)
PLACE_X, PLACE_Y, DISTANCE_WEIGHT, PRODUCT_COLUMNS = 15, 21, 27, 32


@compiled
def allocate_map_buffers():  # type: ignore[no-untyped-def]
    """What ``fill_quadratic_map`` needs for its numbers: the witnesses' products, weights and squares, a system and
    its sums."""
    of_witnesses = (
        np.zeros((SUPPORT_CELLS, PRODUCT_COLUMNS)),
        np.empty(SUPPORT_CELLS),
        np.empty(SUPPORT_CELLS),
    )
    return *of_witnesses, np.empty((TERMS, TERMS)), np.empty((3, TERMS)), np.empty(PRODUCT_COLUMNS)


@compiled_no_refcount
def fill_quadratic_map(center, i, known, near, square, cell, plan, room):  # type: ignore[no-untyped-def]
    """Where cell i lies in the layout by its witnesses (the nearest first), NaN where that is doubtful, and the size of
    a cell there, mm.

    In units of the witnesses' mean distance, with the cell at the origin, so that the map's first term is the place.
    """
    count, rows = near.shape[0], room[0]
    scale, size, middle_x, middle_y, share = 0.0, 0.0, 0.0, 0.0, 1.0 / count
    for k in range(count):
        u = cell[known[near[k]]]
        scale += np.sqrt(square[k]) * share
        size += plan.size_mm[u] * share
        middle_x += plan.center_mm[u, 0] * share
        middle_y += plan.center_mm[u, 1] * share
    unit = 1.0 / scale
    for k in range(count):
        j = known[near[k]]
        x, y, u = (center[j, 0] - center[i, 0]) * unit, (center[j, 1] - center[i, 1]) * unit, cell[j]
        _fill_products(rows[k], x, y, plan.center_mm[u, 0] - middle_x, plan.center_mm[u, 1] - middle_y)
        rows[k, DISTANCE_WEIGHT] = 1.0 / (0.3 + square[k] * unit**2)
    for k in range(count, SUPPORT_CELLS):
        rows[k, DISTANCE_WEIGHT] = 0.0
    terms, (variance, leverage) = room[4], _fill_robust_map(count, (EXACT_MISFIT * size) ** 2, room)
    slope = np.sqrt(abs(terms[0, 1] * terms[1, 2] - terms[0, 2] * terms[1, 1])) * unit
    sure = (
        np.sqrt(square[0]) * slope < MAX_SUPPORT_DISTANCE * size
        and np.sqrt(variance * (1.0 + leverage)) < MAX_DEVIATION * size
    )
    if not sure:
        return np.nan, np.nan, size
    return middle_x + terms[0, 0], middle_y + terms[1, 0], size


@inlined_no_refcount
def _fill_products(row, x, y, u, v):  # type: ignore[no-untyped-def]
    """Write the products of a witness's terms with each other and with its place (u, v)."""
    row[0], row[1], row[2], row[3], row[4], row[5] = 1.0, x, y, x * x, x * y, y * y
    row[6], row[7], row[8], row[9] = x * row[3], x * row[4], x * row[5], y * row[5]
    row[10], row[11], row[12] = row[3] * row[3], row[3] * row[4], row[3] * row[5]
    row[13], row[14] = row[4] * row[5], row[5] * row[5]
    for a in range(TERMS):
        row[PLACE_X + a], row[PLACE_Y + a] = row[a] * u, row[a] * v


@inlined_no_refcount
def _fill_robust_map(count, exact2, room):  # type: ignore[no-untyped-def]
    """Write the map's terms by robust least squares, x and y, into the room's right sides; the variance about it, and
    the leverage at the origin, infinite where the witnesses lie in a row."""
    rows, weight, squares, normal, right, sums = room
    for k in range(SUPPORT_CELLS):
        weight[k] = rows[k, DISTANCE_WEIGHT]
    variance, leverage = np.inf, np.inf
    for number in range(ROBUST_ROUNDS):
        sides = 3 if number == ROBUST_ROUNDS - 1 else 2
        _fill_weighted_sums(rows, weight, sums)
        if not _fill_solutions(sums, normal, right, sides):
            return np.inf, np.inf
        leverage = right[2, 0] * sums[0] / count
        _fill_squared_misfits(rows, right, count, squares)
        usual = 2.0 * median_of(squares, count) + exact2
        variance = _fill_robust_weights(rows, squares, usual, count, weight)
    return variance, leverage


@vectorized_no_refcount
def _fill_weighted_sums(rows, weight, out):  # type: ignore[no-untyped-def]
    """Write the weighted sums of the witnesses' products, four witnesses at once."""
    for m in range(PRODUCT_COLUMNS):
        out[m] = 0.0
    for k in range(0, SUPPORT_CELLS, 4):
        a, b, c, d = weight[k], weight[k + 1], weight[k + 2], weight[k + 3]
        for m in range(PRODUCT_COLUMNS):
            out[m] += a * rows[k, m] + b * rows[k + 1, m] + c * rows[k + 2, m] + d * rows[k + 3, m]


@inlined_no_refcount
def _fill_solutions(sums, normal, right, sides):  # type: ignore[no-untyped-def]
    """Write the solutions for the two coordinates, and if asked for the leverage; False where there is none to trust.

    Elimination without roots, and one quotient a term: each waits for the one before.
    """
    largest = 0.0
    for a in range(TERMS):
        for b in range(a + 1):
            normal[a, b] = sums[PRODUCT_INDEX[a, b]]
        normal[a, a] += RIDGE if a >= 3 else 0.0
        largest = max(largest, normal[a, a])
        right[0, a], right[1, a] = sums[PLACE_X + a], sums[PLACE_Y + a]
        if sides > 2:
            right[2, a] = 1.0 if a == 0 else 0.0
    for j in range(TERMS):
        if not normal[j, j] > MIN_PIVOT * largest:
            return False
        inverse = 1.0 / normal[j, j]
        for i in range(j + 1, TERMS):
            factor = normal[i, j] * inverse
            for k in range(j + 1, i + 1):
                normal[i, k] -= factor * normal[k, j]
            for side in range(sides):
                right[side, i] -= factor * right[side, j]
        normal[j, j] = inverse
    for j in range(TERMS - 1, -1, -1):
        for side in range(sides):
            right[side, j] *= normal[j, j]
            for i in range(j):
                right[side, i] -= normal[j, i] * right[side, j]
    return True


@vectorized_no_refcount
def _fill_squared_misfits(rows, right, count, out):  # type: ignore[no-untyped-def]
    """Write the squared distances between where the map puts the witnesses and where they belong."""
    for k in range(count):
        u, v = -rows[k, PLACE_X], -rows[k, PLACE_Y]
        for a in range(TERMS):
            u += rows[k, a] * right[0, a]
            v += rows[k, a] * right[1, a]
        out[k] = u * u + v * v


@vectorized_no_refcount
def _fill_robust_weights(rows, squares, usual, count, weight):  # type: ignore[no-untyped-def]
    """Write the witnesses' weights, by how near they are and how well they fit; the variance about the map."""
    total, about = 0.0, 0.0
    for k in range(count):
        weight[k] = rows[k, DISTANCE_WEIGHT] * usual / (usual + squares[k])
        total += weight[k]
        about += weight[k] * squares[k]
    return about / (2.0 * total)
