"""Small vectors and dense systems of equations, for use inside compiled loops."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled


@compiled
def dot3(a, b):  # type: ignore[no-untyped-def]
    """The scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def update_to_cholesky_solution(gram, right, count):  # type: ignore[no-untyped-def]
    """Replace the rows of ``right`` by the solutions x of gram x = row.

    Args:
        gram: (n, n), n >= count, symmetric and positive definite; the lower triangle of the first ``count`` rows is
            read, and replaced by the Cholesky factor.
        right: (R, n) the right sides.
        count: number of equations.
    """
    for j in range(count):
        for k in range(j):
            gram[j, j] -= gram[j, k] ** 2
        gram[j, j] = np.sqrt(gram[j, j])
        for i in range(j + 1, count):
            for k in range(j):
                gram[i, j] -= gram[i, k] * gram[j, k]
            gram[i, j] /= gram[j, j]
    for row in range(right.shape[0]):
        for j in range(count):
            for k in range(j):
                right[row, j] -= gram[j, k] * right[row, k]
            right[row, j] /= gram[j, j]
        for j in range(count - 1, -1, -1):
            for k in range(j + 1, count):
                right[row, j] -= gram[k, j] * right[row, k]
            right[row, j] /= gram[j, j]
