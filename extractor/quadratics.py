"""Quadratic maps through the markers of two rings, bending held towards 0: for many markers at once.

They are laid where a ring is not whole: at the pattern's rim, and all around damage. ``LANES`` markers stand side by
side, and each operation is done for all of them; a neighbour that is not known has no weight.
"""

from __future__ import annotations

import numpy as np

from .engine import compiled, inlined

LANES, TERMS = 8, 5  # markers; x, y, xx / 2, xy, yy / 2
# Rows of lanes: of a neighbour the terms, these times its weight, its distances in the image and whether it is known;
TERM, OFF, SEEN = 0, 10, 12
# of the normal equations the lower triangle, and the right sides of x and y.
GRAM, RIGHT, ROWS = 13, 28, 38
MIN_SINE2 = 0.05  # of the angle between the two directions that neighbours tell at least


@compiled
def lay_quadratics(xy, markers, near, offset, out):  # type: ignore[no-untyped-def]
    """Write the five derivatives of x and y at ``markers`` (n,) into ``out`` (M, 2, 5), where their neighbours tell
    them."""
    rows, known = np.empty(ROWS * LANES), np.empty(LANES, np.int64)
    for start in range(0, markers.shape[0], LANES):
        some = markers[start : start + LANES]
        rows[:] = 0.0
        rows[: 2 * LANES] = 1.0  # lanes that stay empty are far from any neighbour
        known[:] = 0
        for k in range(near.shape[1]):
            for lane, m in enumerate(some):
                known[lane] += _look(xy, m, near[m, k], offset[m, k], rows[lane:])
            _add(rows)
        told = np.empty(LANES, np.bool_)
        for lane in range(LANES):
            told[lane] = _hold(rows[lane:], known[lane])
        _solve(rows)
        for lane, m in enumerate(some):
            if told[lane]:
                for i in range(TERMS):
                    out[m, 0, i] = rows[(RIGHT + i) * LANES + lane]
                    out[m, 1, i] = rows[(RIGHT + TERMS + i) * LANES + lane]


@inlined
def _look(xy, m, n, offset, column):  # type: ignore[no-untyped-def]
    """Fill in a neighbour n of marker m; whether it is known."""
    if n < 0 or not np.isfinite(xy[n, 0]):
        column[TERM * LANES], column[(TERM + 1) * LANES] = 1.0, 1.0
        column[OFF * LANES], column[(OFF + 1) * LANES], column[SEEN * LANES] = 0.0, 0.0, 0.0
        return False
    column[TERM * LANES], column[(TERM + 1) * LANES] = offset[0], offset[1]
    column[OFF * LANES], column[(OFF + 1) * LANES] = xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1]
    column[SEEN * LANES] = 1.0
    return True


@compiled
def _add(rows):  # type: ignore[no-untyped-def]
    """Add a neighbour of every marker to its normal equations."""
    for lane in range(LANES):
        x, y = rows[TERM * LANES + lane], rows[(TERM + 1) * LANES + lane]
        weight = rows[SEEN * LANES + lane] / (x * x + y * y) ** 2
        rows[(TERM + 2) * LANES + lane] = 0.5 * x * x
        rows[(TERM + 3) * LANES + lane] = x * y
        rows[(TERM + 4) * LANES + lane] = 0.5 * y * y
        for i in range(TERMS):
            rows[(TERM + TERMS + i) * LANES + lane] = weight * rows[(TERM + i) * LANES + lane]
    for lane in range(LANES):
        for i in range(TERMS):
            v = rows[(TERM + TERMS + i) * LANES + lane]
            for j in range(i + 1):
                rows[(GRAM + i * (i + 1) // 2 + j) * LANES + lane] += v * rows[(TERM + j) * LANES + lane]
            for axis in range(2):
                rows[(RIGHT + axis * TERMS + i) * LANES + lane] += v * rows[(OFF + axis) * LANES + lane]


@inlined
def _hold(column, known):  # type: ignore[no-untyped-def]
    """Hold a marker's bending towards 0; whether its neighbours tell the derivatives at all."""
    xx, xy, yy = column[GRAM * LANES], column[(GRAM + 1) * LANES], column[(GRAM + 2) * LANES]
    told = known >= 2 and xx * yy - xy**2 >= MIN_SINE2 * xx * yy
    if not told:  # then anything that can be solved
        for k in range(GRAM, RIGHT):
            column[k * LANES] = 0.0
    held = (0.001 if known >= 8 else 0.02) if known >= 5 else 1e9
    for i in range(2 if told else 0, TERMS):
        column[(GRAM + i * (i + 3) // 2) * LANES] += held
    return told


@inlined
def _less(rows, to, a, b):  # type: ignore[no-untyped-def]
    """Take a product of two rows from a third."""
    for lane in range(LANES):
        rows[to * LANES + lane] -= rows[a * LANES + lane] * rows[b * LANES + lane]


@inlined
def _over(rows, to, by):  # type: ignore[no-untyped-def]
    """Divide a row by another."""
    for lane in range(LANES):
        rows[to * LANES + lane] /= rows[by * LANES + lane]


@compiled
def _solve(rows):  # type: ignore[no-untyped-def]
    """Replace the right sides by the solutions, by Cholesky's decomposition: ``cholesky_solve``, for all markers."""
    for j in range(TERMS):
        own = GRAM + j * (j + 1) // 2
        for k in range(j):
            _less(rows, own + j, own + k, own + k)
        for lane in range(LANES):
            rows[(own + j) * LANES + lane] = np.sqrt(rows[(own + j) * LANES + lane])
        for i in range(j + 1, TERMS):
            other = GRAM + i * (i + 1) // 2
            for k in range(j):
                _less(rows, other + j, other + k, own + k)
            _over(rows, other + j, own + j)
    for right in (RIGHT, RIGHT + TERMS):
        for j in range(TERMS):
            own = GRAM + j * (j + 1) // 2
            for k in range(j):
                _less(rows, right + j, own + k, right + k)
            _over(rows, right + j, own + j)
        for j in range(TERMS - 1, -1, -1):
            for k in range(j + 1, TERMS):
                _less(rows, right + j, GRAM + k * (k + 1) // 2 + j, right + k)
            _over(rows, right + j, GRAM + j * (j + 3) // 2)
