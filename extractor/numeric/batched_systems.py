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
def place(a, b):  # type: ignore[no-untyped-def]
    """Where a lower triangle has its number (a, b), b not after a."""
    return a * (a + 1) // 2 + b


@inlined
def add_product(rows, to, a, b, lanes):  # type: ignore[no-untyped-def]
    """Add a product of two rows to a third."""
    out, one, two = np.uint64(to * LANES), np.uint64(a * LANES), np.uint64(b * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] += rows[one + lane] * rows[two + lane]


@inlined
def _less(rows, to, a, b, lanes):  # type: ignore[no-untyped-def]
    """Take a product of two rows from a third."""
    out, one, two = np.uint64(to * LANES), np.uint64(a * LANES), np.uint64(b * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] -= rows[one + lane] * rows[two + lane]


@inlined
def _over(rows, to, by, lanes):  # type: ignore[no-untyped-def]
    """Divide a row by another."""
    out, one = np.uint64(to * LANES), np.uint64(by * LANES)
    for k in range(lanes):
        lane = np.uint64(k)
        rows[out + lane] /= rows[one + lane]


@compiled
def factor(rows, at, terms, least, sound, lanes):  # type: ignore[no-untyped-def]
    """Replace the matrices by their Cholesky factors; the row ``sound`` becomes 0 where a pivot is not above ``least``,
    and the factor is any then."""
    for i in range(terms):
        own = at + place(i, i)
        for j in range(i):
            for k in range(j):
                _less(rows, at + place(i, j), at + place(i, k), at + place(j, k), lanes)
            _over(rows, at + place(i, j), at + place(j, j), lanes)
            _less(rows, own, at + place(i, j), at + place(i, j), lanes)
        for lane in range(lanes):
            determined = rows[own * LANES + lane] > least
            rows[sound * LANES + lane] = rows[sound * LANES + lane] if determined else 0.0
            rows[own * LANES + lane] = np.sqrt(rows[own * LANES + lane] if determined else 1.0)


@compiled
def solve(rows, at, terms, side, lanes):  # type: ignore[no-untyped-def]
    """Replace the right sides by the solutions."""
    for i in range(terms):
        for k in range(i):
            _less(rows, side + i, at + place(i, k), side + k, lanes)
        _over(rows, side + i, at + place(i, i), lanes)
    for i in range(terms - 1, -1, -1):
        for k in range(i + 1, terms):
            _less(rows, side + i, at + place(k, i), side + k, lanes)
        _over(rows, side + i, at + place(i, i), lanes)
