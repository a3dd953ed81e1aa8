"""Heavy omission (the article's Fig. 8): a quadratic through the markers of one layer within a sextant."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled
from extractor.numeric.dense_systems import update_to_cholesky_solution

MIN_LAYER_MARKERS = 5  # known markers of a layer within a sextant, for a quadratic with a residual
TERMS = 3  # of the quadratic: 1, s, s^2, with s from -1 to 1 along the sextant


@compiled
def predict_by_layer(xy, layers):  # type: ignore[no-untyped-def]
    """Places of the unknown markers between known ones, on the quadratic through their layer and sextant.

    Args:
        xy: (M, 2) px, NaN where unknown.
        layers: number of layers.

    Returns:
        (M, 2) px, NaN where there are too few markers; and (M,) the variance of these places, px^2 per axis, from the
        residual of the fit, infinite without a place. For a corner of the layer, which two sextants share, the place
        with the smaller variance is taken.
    """
    predicted, variance = np.full(xy.shape, np.nan), np.full(xy.shape[0], np.inf)
    ids = np.empty(layers + 1, np.int64)
    for layer in range(1, layers + 1):
        first, count = 3 * layer * (layer - 1) + 1, 6 * layer
        for sextant in range(6):
            unknown = 0
            for k in range(layer + 1):
                ids[k] = first + (sextant * layer + k) % count
                unknown += np.isnan(xy[ids[k], 0])
            if unknown > 0:
                _fill_by_layer_quadratic(xy, ids[: layer + 1], predicted, variance)
    return predicted, variance


@compiled
def _fill_by_layer_quadratic(xy, ids, predicted, variance):  # type: ignore[no-untyped-def]
    """Fit x and y as quadratics of s, and write places and variances of the unknown markers between known ones."""
    last = ids.shape[0] - 1
    normal, right = np.zeros((TERMS, TERMS)), np.zeros((2, TERMS))
    row, unit = np.ones(TERMS), np.empty((1, TERMS))
    count, begin, end = 0, -1, -1
    for k in range(last + 1):
        if np.isnan(xy[ids[k], 0]):
            continue
        begin, end, count = k if begin < 0 else begin, k, count + 1
        row[1] = 2.0 * k / last - 1.0
        row[2] = row[1] * row[1]
        for a in range(TERMS):
            for b in range(TERMS):
                normal[a, b] += row[a] * row[b]
            right[0, a] += row[a] * xy[ids[k], 0]
            right[1, a] += row[a] * xy[ids[k], 1]
    if count < MIN_LAYER_MARKERS:
        return
    update_to_cholesky_solution(normal.copy(), right, TERMS)
    residual = 0.0
    for k in range(begin, end + 1):
        if not np.isnan(xy[ids[k], 0]):
            s = 2.0 * k / last - 1.0
            for axis in range(2):
                left = xy[ids[k], axis] - right[axis, 0]
                residual += (left - s * (right[axis, 1] + s * right[axis, 2])) ** 2
    residual /= 2.0 * (count - TERMS)
    for k in range(begin, end + 1):
        if not np.isnan(xy[ids[k], 0]):
            continue
        s = 2.0 * k / last - 1.0
        unit[0, 0], unit[0, 1], unit[0, 2] = 1.0, s, s * s
        update_to_cholesky_solution(normal.copy(), unit, TERMS)
        own_variance = residual * (1.0 + unit[0, 0] + s * (unit[0, 1] + s * unit[0, 2]))
        if not own_variance < variance[ids[k]]:
            continue
        variance[ids[k]] = own_variance
        for axis in range(2):
            predicted[ids[k], axis] = right[axis, 0] + s * (right[axis, 1] + s * right[axis, 2])
