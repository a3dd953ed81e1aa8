"""Polynomials of third degree over an image, fitted robustly to the levels of one ink's cells."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, vectorized
from extractor.numeric.dense_systems import update_to_cholesky_solution

MEDIAN_CHI2 = 0.79  # median of a chi-square of 3 degrees over 3
TERMS = 10  # 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy
OUTLIER_TOLERANCE = 4.0  # deviations of the scatter, beyond which a cell is an outlier
MAX_FIT_ROUNDS = 10  # of weighting
FALLING_VARIANCE = 0.9  # rounds end when the scatter falls to no less than this share


@compiled
def fill_monomials(x, y, out):  # type: ignore[no-untyped-def]
    """Fill in the ten terms at (x, y)."""
    out[0], out[1], out[2] = 1.0, x, y
    out[3], out[4], out[5] = x * x, x * y, y * y
    out[6], out[7], out[8], out[9] = x * x * x, x * x * y, x * y * y, y * y * y


@vectorized
def _fill_normal_equations(terms, values, weight, gram, right):  # type: ignore[no-untyped-def]
    """Fill in the sums over all cells of weight times term times term (lower triangle), and of weight times term times
    value."""
    weighted = np.empty(weight.shape[0])
    for j in range(TERMS):
        for i in range(weight.shape[0]):
            weighted[i] = weight[i] * terms[j, i]
        for k in range(j, TERMS):
            other, total = terms[k], 0.0
            for i in range(weight.shape[0]):
                total += weighted[i] * other[i]
            gram[k, j] = total
        for channel in range(3):
            other, total = values[channel], 0.0
            for i in range(weight.shape[0]):
                total += weighted[i] * other[i]
            right[channel, j] = total


@compiled
def _fill_polynomial_fit(terms, values, weight, count, gram, right):  # type: ignore[no-untyped-def]
    """Fill ``right`` (3, 10) with the weighted least squares polynomial of the first ``count`` terms, slightly
    regularised towards 0."""
    _fill_normal_equations(terms, values, weight, gram, right)
    right[:, count:] = 0.0
    if not gram[0, 0] > 0.0:
        right[:] = 0.0
        return
    for j in range(1, count):
        gram[j, j] += 1e-6 * gram[0, 0]
    update_to_cholesky_solution(gram, right, count)


@vectorized
def _fill_misfits(terms, values, polynomial, out):  # type: ignore[no-untyped-def]
    """Fill in the mean squared distance of each cell's level from the polynomial, gray levels^2."""
    residual = np.empty(out.shape[0])
    out[:] = 0.0
    for channel in range(3):
        residual[:] = values[channel]
        for k in range(TERMS):
            factor, row = polynomial[channel, k], terms[k]
            for i in range(out.shape[0]):
                residual[i] -= factor * row[i]
        for i in range(out.shape[0]):
            out[i] += residual[i] * residual[i] / 3.0


@compiled
def robust_polynomial(terms, values, noise, count):  # type: ignore[no-untyped-def]
    """A robust polynomial of one ink.

    The rounds of weighting begin at the medians of the channels, which many outliers on one side do not move.

    Args:
        terms: (10, n). values: (4, n) gray levels in three channels, and the number of pixels.
        noise: gray levels. count: terms to fit.

    Returns:
        (3, 10) the polynomial; the variance of the cells about it beyond noise, gray levels^2; (n,) bool, outliers.
    """
    n = terms.shape[1]
    weight, misfit = np.empty(n), np.zeros(n)
    for i in range(n):
        weight[i] = values[3, i] / (1.0 + 0.1 * values[3, i])
    start, gram, polynomial = weight.copy(), np.empty((TERMS, TERMS)), np.zeros((3, TERMS))
    for channel in range(3):
        polynomial[channel, 0] = np.median(values[channel])
    variance = np.inf
    for _ in range(MAX_FIT_ROUNDS):
        _fill_misfits(terms, values, polynomial, misfit)
        before, variance = variance, np.median(misfit) / MEDIAN_CHI2
        if variance > FALLING_VARIANCE * before:
            break
        for i in range(n):
            weight[i] = start[i] / (1.0 + misfit[i] / (6.0 * variance + 1e-9)) ** 2
        _fill_polynomial_fit(terms, values, weight, count, gram, polynomial)
    expected = noise * noise / np.median(values[3])
    is_outlier = np.zeros(n, np.bool_)
    for i in range(n):
        is_outlier[i] = misfit[i] > OUTLIER_TOLERANCE**2 * (variance + noise * noise / values[3, i]) + 4.0
    return polynomial, max(variance * n / max(n - count, 1) - 1.15 * expected, 0.0), is_outlier
