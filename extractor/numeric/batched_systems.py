"""Solves many small symmetric systems of equations together, because one alone waits for every root and quotient.

``rows`` is a flat (R, ``LANES``) array: a row holds the same number of each system, one system per lane. The lower
triangle of the matrices begins at row ``at``; its entry (a, b) is row ``at + packed_index(a, b)``. The compiler
vectorises innermost loops over lanes of a length known at run time only.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined

LANES = 16


@inlined
def packed_index(a, b):  # type: ignore[no-untyped-def]
    """The index of the entry (a, b), b <= a, in a packed lower triangle."""
    return a * (a + 1) // 2 + b


@inlined
def add_row_product(rows, to, a, b, lanes):  # type: ignore[no-untyped-def]
    """Add the product of the rows a and b to the row ``to``, in the first lanes."""
    out, one, two = np.uint64(to * LANES), np.uint64(a * LANES), np.uint64(b * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] += rows[one + lane] * rows[two + lane]


@inlined
def _update_minus_product(rows, to, a, b, lanes):  # type: ignore[no-untyped-def]
    """Subtract the product of the rows a and b from the row ``to``, in the first lanes."""
    out, one, two = np.uint64(to * LANES), np.uint64(a * LANES), np.uint64(b * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] -= rows[one + lane] * rows[two + lane]


@inlined
def _update_row_quotient(rows, to, by, lanes):  # type: ignore[no-untyped-def]
    """Divide the row ``to`` by the row ``by``, in the first lanes."""
    out, one = np.uint64(to * LANES), np.uint64(by * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] /= rows[one + lane]


@compiled
def update_to_cholesky_factors(rows, at, terms, min_pivot, determined, lanes):  # type: ignore[no-untyped-def]
    """Replace the matrices by their Cholesky factors.

    Args:
        rows: flat (R, ``LANES``) float64.
        at: first row of the matrices; terms: their size.
        min_pivot: a factor with a pivot not above this is meaningless.
        determined: the row that is set to 0 in the lanes of such factors.
        lanes: number of systems.
    """
    for i in range(terms):
        own = at + packed_index(i, i)
        for j in range(i):
            for k in range(j):
                _update_minus_product(
                    rows, at + packed_index(i, j), at + packed_index(i, k), at + packed_index(j, k), lanes
                )
            _update_row_quotient(rows, at + packed_index(i, j), at + packed_index(j, j), lanes)
            _update_minus_product(rows, own, at + packed_index(i, j), at + packed_index(i, j), lanes)
        for lane in range(lanes):
            is_large = rows[own * LANES + lane] > min_pivot
            rows[determined * LANES + lane] = rows[determined * LANES + lane] if is_large else 0.0
            rows[own * LANES + lane] = np.sqrt(rows[own * LANES + lane] if is_large else 1.0)


@compiled
def update_to_solutions(rows, at, terms, side, lanes):  # type: ignore[no-untyped-def]
    """Replace right sides, ``terms`` rows from ``side`` on, by the solutions with Cholesky factors at row ``at``."""
    for i in range(terms):
        for k in range(i):
            _update_minus_product(rows, side + i, at + packed_index(i, k), side + k, lanes)
        _update_row_quotient(rows, side + i, at + packed_index(i, i), lanes)
    for i in range(terms - 1, -1, -1):
        for k in range(i + 1, terms):
            _update_minus_product(rows, side + i, at + packed_index(k, i), side + k, lanes)
        _update_row_quotient(rows, side + i, at + packed_index(i, i), lanes)
