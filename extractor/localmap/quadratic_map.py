"""Predicts a detached cell's place in the layout by a quadratic map through the numbered cells nearest to it.

These numbered cells are its support cells. The map goes from the image to the layout.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import (
    compiled,
    compiled_no_refcount,
    inlined_no_refcount,
    vectorized_no_refcount,
)
from extractor.numeric.median import median_of

SUPPORT_CELLS = 20  # numbered cells of a map
MAX_SUPPORT_DISTANCE = 4.5  # in cells, from the nearest support cell
MAX_DEVIATION = 0.12  # of the predicted place, in cells
ROBUST_ROUNDS = 4  # support cells cut by dirt are outliers
EXACT_MISFIT = 0.02  # in cells; smaller misfits keep the full weight
RIDGE = 1e-3  # regularises the curvature where the support cells lie in a row
MIN_PIVOT = 1e-7  # of the normal matrix, against its largest entry; below it the support cells lie in a row
TERMS = 6  # 1, x, y, xx, xy, yy
# Columns of a support cell's products: terms by terms, one column per monomial, then terms by its place in the layout.
PRODUCT_INDEX = np.array([[0, 1, 2, 3, 4, 5], [1, 3, 4, 6, 7, 8], [2, 4, 5, 7, 8, 9]])
PRODUCT_INDEX = np.concatenate(
    [PRODUCT_INDEX, [[3, 6, 7, 10, 11, 12], [4, 7, 8, 11, 12, 13], [5, 8, 9, 12, 13, 14]]]
)
PLACE_X, PLACE_Y, DISTANCE_WEIGHT, PRODUCT_COLUMNS = 15, 21, 27, 32


class MapBuffers(NamedTuple):
    """Memory for one quadratic map.

    Attributes:
        products: (``SUPPORT_CELLS``, ``PRODUCT_COLUMNS``) of the support cells.
        weights: (``SUPPORT_CELLS``,) by distance and misfit.
        squared_misfits: (``SUPPORT_CELLS``,) mm^2.
        normal: (``TERMS``, ``TERMS``) the normal matrix.
        right: (3, ``TERMS``) the right sides for x, y and the leverage, then the solutions.
        sums: (``PRODUCT_COLUMNS``,) the weighted sums of the products.
    """

    products: NDArray[np.float64]
    weights: NDArray[np.float64]
    squared_misfits: NDArray[np.float64]
    normal: NDArray[np.float64]
    right: NDArray[np.float64]
    sums: NDArray[np.float64]


class LayoutPlace(NamedTuple):
    """A place in the layout.

    Attributes:
        x_mm, y_mm: NaN where the place is uncertain.
        cell_size_mm: the mean side of the cells there.
    """

    x_mm: float
    y_mm: float
    cell_size_mm: float


@compiled
def allocate_map_buffers():  # type: ignore[no-untyped-def]
    """``MapBuffers`` for ``fill_quadratic_map``."""
    return MapBuffers(
        np.zeros((SUPPORT_CELLS, PRODUCT_COLUMNS)),
        np.empty(SUPPORT_CELLS),
        np.empty(SUPPORT_CELLS),
        np.empty((TERMS, TERMS)),
        np.empty((3, TERMS)),
        np.empty(PRODUCT_COLUMNS),
    )


@compiled_no_refcount
def fill_quadratic_map(center, i, support, nearest, squared_distance, cell, layout, buffers):  # type: ignore[no-untyped-def]
    """Predict the place of cell i in the layout.

    Lengths are in units of the support cells' mean distance, with cell i at the origin: the map's first
    term is the place.

    Args:
        center: (N, 2) px, the cells' centers.
        support: (K,) the numbered cells of the image.
        nearest: (C,) indices into ``support``, the nearest first; squared_distance: (C,) px^2.
        cell: (N,) int32, the layout's cell of each cell of the image.
        layout: ``LayoutCells``.
        buffers: ``MapBuffers``, written.

    Returns:
        ``LayoutPlace``.
    """
    count, products = nearest.shape[0], buffers.products
    scale, size, middle_x, middle_y, share = 0.0, 0.0, 0.0, 0.0, 1.0 / count
    for k in range(count):
        u = cell[support[nearest[k]]]
        scale += np.sqrt(squared_distance[k]) * share
        size += layout.size_mm[u] * share
        middle_x += layout.center_mm[u, 0] * share
        middle_y += layout.center_mm[u, 1] * share
    unit = 1.0 / scale
    for k in range(count):
        j = support[nearest[k]]
        x, y, u = (center[j, 0] - center[i, 0]) * unit, (center[j, 1] - center[i, 1]) * unit, cell[j]
        _fill_products(
            products[k], x, y, layout.center_mm[u, 0] - middle_x, layout.center_mm[u, 1] - middle_y
        )
        products[k, DISTANCE_WEIGHT] = 1.0 / (0.3 + squared_distance[k] * unit**2)
    for k in range(count, SUPPORT_CELLS):
        products[k, DISTANCE_WEIGHT] = 0.0
    terms, (variance, leverage) = buffers.right, _fill_robust_map(count, (EXACT_MISFIT * size) ** 2, buffers)
    slope = np.sqrt(abs(terms[0, 1] * terms[1, 2] - terms[0, 2] * terms[1, 1])) * unit
    is_certain = (
        np.sqrt(squared_distance[0]) * slope < MAX_SUPPORT_DISTANCE * size
        and np.sqrt(variance * (1.0 + leverage)) < MAX_DEVIATION * size
    )
    if not is_certain:
        return LayoutPlace(np.nan, np.nan, size)
    return LayoutPlace(middle_x + terms[0, 0], middle_y + terms[1, 0], size)


@inlined_no_refcount
def _fill_products(row, x, y, u, v):  # type: ignore[no-untyped-def]
    """Write the products of a support cell's terms with each other and with its place (u, v) in the layout."""
    row[0], row[1], row[2], row[3], row[4], row[5] = 1.0, x, y, x * x, x * y, y * y
    row[6], row[7], row[8], row[9] = x * row[3], x * row[4], x * row[5], y * row[5]
    row[10], row[11], row[12] = row[3] * row[3], row[3] * row[4], row[3] * row[5]
    row[13], row[14] = row[4] * row[5], row[5] * row[5]
    for a in range(TERMS):
        row[PLACE_X + a], row[PLACE_Y + a] = row[a] * u, row[a] * v


@inlined_no_refcount
def _fill_robust_map(count, exact2, buffers):  # type: ignore[no-untyped-def]
    """Write the map's terms for x and y by robust least squares into ``buffers.right``.

    Returns the variance about the map, mm^2, and the leverage at the origin; infinite where the support cells lie in a
    row.
    """
    products, weights, right = buffers.products, buffers.weights, buffers.right
    for k in range(SUPPORT_CELLS):
        weights[k] = products[k, DISTANCE_WEIGHT]
    variance, leverage = np.inf, np.inf
    for number in range(ROBUST_ROUNDS):
        sides = 3 if number == ROBUST_ROUNDS - 1 else 2
        _fill_weighted_sums(products, weights, buffers.sums)
        if not _fill_solutions(buffers.sums, buffers.normal, right, sides):
            return np.inf, np.inf
        leverage = right[2, 0] * buffers.sums[0] / count
        _fill_squared_misfits(products, right, count, buffers.squared_misfits)
        scale2 = 2.0 * median_of(buffers.squared_misfits, count) + exact2
        variance = _fill_robust_weights(products, buffers.squared_misfits, scale2, count, weights)
    return variance, leverage


@vectorized_no_refcount
def _fill_weighted_sums(rows, weight, out):  # type: ignore[no-untyped-def]
    """Write the weighted sums of the products, four support cells at once."""
    for m in range(PRODUCT_COLUMNS):
        out[m] = 0.0
    for k in range(0, SUPPORT_CELLS, 4):
        a, b, c, d = weight[k], weight[k + 1], weight[k + 2], weight[k + 3]
        for m in range(PRODUCT_COLUMNS):
            out[m] += a * rows[k, m] + b * rows[k + 1, m] + c * rows[k + 2, m] + d * rows[k + 3, m]


@inlined_no_refcount
def _fill_solutions(sums, normal, right, sides):  # type: ignore[no-untyped-def]
    """Write the solutions of the first 2 or 3 ``sides``; False where a pivot is too small.

    Elimination without roots and with one quotient per term, because each step waits for the one before.
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
    """Write the squared distances, mm^2, between the support cells' places by the map and in the layout."""
    for k in range(count):
        u, v = -rows[k, PLACE_X], -rows[k, PLACE_Y]
        for a in range(TERMS):
            u += rows[k, a] * right[0, a]
            v += rows[k, a] * right[1, a]
        out[k] = u * u + v * v


@vectorized_no_refcount
def _fill_robust_weights(rows, squares, scale2, count, weight):  # type: ignore[no-untyped-def]
    """Write the weights by distance and misfit (scale ``scale2``, mm^2); returns the variance about the map, mm^2."""
    total, weighted = 0.0, 0.0
    for k in range(count):
        weight[k] = rows[k, DISTANCE_WEIGHT] * scale2 / (scale2 + squares[k])
        total += weight[k]
        weighted += weight[k] * squares[k]
    return weighted / (2.0 * total)
