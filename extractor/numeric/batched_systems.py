"""Small symmetric systems of equations, those of many markers side by side: one by one, they wait for every root and
quotient.

A row holds one number of each system, in ``LANES`` lanes; the lower triangle of the matrices is ``terms`` rows after
each other, row (a, b) at ``at + place(a, b)``. The machine takes several lanes at once in loops whose length is known
only as they run, and that hold no other.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined

LANES = 16


@inlined
def packed_index(a, b):  # type: ignore[no-untyped-def]
    """Where a lower triangle has its number (a, b), b not after a."""
    return a * (a + 1) // 2 + b


@inlined
def add_row_product(rows, to, a, b, lanes):  # type: ignore[no-untyped-def]
    """Add a product of two rows to a third."""
    out, one, two = np.uint64(to * LANES), np.uint64(a * LANES), np.uint64(b * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] += rows[one + lane] * rows[two + lane]


@inlined
def _update_minus_product(rows, to, a, b, lanes):  # type: ignore[no-untyped-def]
    """Take a product of two rows from a third."""
    out, one, two = np.uint64(to * LANES), np.uint64(a * LANES), np.uint64(b * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] -= rows[one + lane] * rows[two + lane]


@inlined
def _update_row_quotient(rows, to, by, lanes):  # type: ignore[no-untyped-def]
    """Divide a row by another."""
    out, one = np.uint64(to * LANES), np.uint64(by * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] /= rows[one + lane]


@compiled
def update_to_cholesky_factors(rows, at, terms, least, sound, lanes):  # type: ignore[no-untyped-def]
    """Replace the matrices by their Cholesky factors; the row ``is_complete`` becomes 0 where a pivot is not above
    ``min_places``,
    and the factor is any then."""
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
            determined = rows[own * LANES + lane] > least
            rows[sound * LANES + lane] = rows[sound * LANES + lane] if determined else 0.0
            rows[own * LANES + lane] = np.sqrt(rows[own * LANES + lane] if determined else 1.0)


@compiled
def update_to_solutions(rows, at, terms, side, lanes):  # type: ignore[no-untyped-def]
    """Replace the right sides by the solutions."""
    for i in range(terms):
        for k in range(i):
            _update_minus_product(rows, side + i, at + packed_index(i, k), side + k, lanes)
        _update_row_quotient(rows, side + i, at + packed_index(i, i), lanes)
    for i in range(terms - 1, -1, -1):
        for k in range(i + 1, terms):
            _update_minus_product(rows, side + i, at + packed_index(k, i), side + k, lanes)
        _update_row_quotient(rows, side + i, at + packed_index(i, i), lanes)
