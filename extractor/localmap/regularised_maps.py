"""Quadratic maps through the markers of two rings, with regularised curvature, for many markers at once.

They serve markers whose rings are incomplete: at the pattern's rim and around damage. Up to ``LANES`` markers are
computed together, one in each lane. An unknown neighbour has no weight.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.batched_systems import (
    LANES,
    add_row_product,
    packed_index,
    update_to_cholesky_factors,
    update_to_solutions,
)
from extractor.numeric.compilation import compiled, inlined

TERMS = 5  # x, y, xx / 2, xy, yy / 2
# Rows of lanes: the terms of one neighbour, the weighted terms, its vector in the image, 1 if it is known; 1 where the
# neighbours determine the derivatives;
TERM, IMAGE_STEP, KNOWN, DETERMINED = 0, 10, 12, 13
# the lower triangle of the normal equations, and the right sides of x and y.
NORMAL, RIGHT_SIDE, ROWS = 14, 29, 39
MIN_SINE2 = 0.05  # least squared sine of the angle between the neighbours' directions


@compiled
def fill_quadratic_derivatives(xy, markers, ring_markers, ring_vectors, out):  # type: ignore[no-untyped-def]
    """Write the derivatives x, y, xx, xy, yy of the image coordinates where the neighbours determine them.

    Args:
        xy: (M, 2) px, the markers' places, NaN unknown.
        markers: (n,) the markers to evaluate.
        ring_markers: (M, K) int32, their neighbours, or -1. ring_vectors: (M, K, 2) the vectors to them in the layout.
        out: (M, 2, 5) float64, receives the derivatives of x and y.
    """
    rows, known = np.empty(ROWS * LANES), np.empty(LANES, np.int64)
    for start in range(0, markers.shape[0], LANES):
        batch = markers[start : start + LANES]
        lanes = batch.shape[0]
        rows[:], known[:] = 0.0, 0
        for k in range(ring_markers.shape[1]):
            for lane in range(lanes):
                m = batch[lane]
                known[lane] += _fill_neighbour(xy, m, ring_markers[m, k], ring_vectors[m, k], rows[lane:])
            _accumulate_normal_equations(rows, lanes)
        for lane in range(lanes):
            _update_regularisation(rows[lane:], known[lane])
        update_to_cholesky_factors(rows, NORMAL, TERMS, 0.0, DETERMINED, lanes)
        for side in (RIGHT_SIDE, RIGHT_SIDE + TERMS):
            update_to_solutions(rows, NORMAL, TERMS, side, lanes)
        for lane in range(lanes):
            if rows[DETERMINED * LANES + lane] > 0.0:
                for i in range(TERMS):
                    out[batch[lane], 0, i] = rows[(RIGHT_SIDE + i) * LANES + lane]
                    out[batch[lane], 1, i] = rows[(RIGHT_SIDE + TERMS + i) * LANES + lane]


@inlined
def _fill_neighbour(xy, m, n, vector, column):  # type: ignore[no-untyped-def]
    """Write the neighbour n of marker m, at ``vector`` (2,) in the layout, into a lane; returns whether it is known."""
    if n < 0 or not np.isfinite(xy[n, 0]):
        column[TERM * LANES], column[(TERM + 1) * LANES] = 1.0, 1.0
        column[IMAGE_STEP * LANES], column[(IMAGE_STEP + 1) * LANES], column[KNOWN * LANES] = 0.0, 0.0, 0.0
        return False
    column[TERM * LANES], column[(TERM + 1) * LANES] = vector[0], vector[1]
    column[IMAGE_STEP * LANES], column[(IMAGE_STEP + 1) * LANES] = xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1]
    column[KNOWN * LANES] = 1.0
    return True


@compiled
def _accumulate_normal_equations(rows, lanes):  # type: ignore[no-untyped-def]
    """Add one neighbour of every lane to the normal equations."""
    for lane in range(lanes):
        x, y = rows[TERM * LANES + lane], rows[(TERM + 1) * LANES + lane]
        weight = rows[KNOWN * LANES + lane] / (x * x + y * y) ** 2
        rows[(TERM + 2) * LANES + lane] = 0.5 * x * x
        rows[(TERM + 3) * LANES + lane] = x * y
        rows[(TERM + 4) * LANES + lane] = 0.5 * y * y
        for i in range(TERMS):
            rows[(TERM + TERMS + i) * LANES + lane] = weight * rows[(TERM + i) * LANES + lane]
    for i in range(TERMS):
        for j in range(i + 1):
            add_row_product(rows, NORMAL + packed_index(i, j), TERM + TERMS + i, TERM + j, lanes)
        for axis in range(2):
            add_row_product(rows, RIGHT_SIDE + axis * TERMS + i, TERM + TERMS + i, IMAGE_STEP + axis, lanes)


@inlined
def _update_regularisation(column, known):  # type: ignore[no-untyped-def]
    """Regularise the curvature of a lane, by its number of known neighbours, and write ``DETERMINED``."""
    xx, xy, yy = column[NORMAL * LANES], column[(NORMAL + 1) * LANES], column[(NORMAL + 2) * LANES]
    is_determined = known >= 2 and xx * yy - xy**2 >= MIN_SINE2 * xx * yy
    column[DETERMINED * LANES] = 1.0 if is_determined else 0.0
    ridge = (0.001 if known >= 8 else 0.02) if known >= 5 else 1e9
    for i in range(2, TERMS):
        column[(NORMAL + packed_index(i, i)) * LANES] += ridge
