"""The Fisher information matrix of the markers, its sparse solution and its inverse's diagonal blocks.

A marker's block joins all gridlines that end there. Along a gridline the weights are 1 - t and t; the sums over its
pixels are measured. Near a marker the gridlines share their pixels (``cells_per_marker``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled
from extractor.refine.solve.ring_elimination import (
    LANES,
    MIDDLE,
    NEIGHBOUR_ROWS,
    TAIL_ROWS,
    eliminated_blocks,
    fill_ring,
    neighbour_markers,
    update_without_ring,
)
from extractor.refine.solve.shared_pixels import add_shared_pixels
from extractor.refine.synthesis.gridlines import KNOWN, UX, UY
from extractor.refine.synthesis.residual_kernel import AA, AB, BB

MAX_STEPS = 80  # of the conjugate gradients
PRECISION = 1e-3  # of the solution
# A marker that moves alone bends the gridlines around it, through the smooth map, as a cardinal cubic does:
# 1 - 2.5 t^2 + 1.5 t^3 instead of 1 - t, and -t (1 - t)^2 / 2 beyond the next marker. Against the votes 1 - t that
# is 1.1 (.3667 for 1/3) at the marker itself and .9 (.175 - .025 for 1/6) at its neighbour.
SMOOTH_MAP_COUPLING = 0.1
HELD_INFORMATION = 1e12  # 1/px^2, known about a marker that is held where it is


class Information(NamedTuple):
    """Blocks in 1/px^2: diagonal (M, 3) as xx, xy, yy; beside (E, 4) from an edge's smaller to its larger marker."""

    diagonal: NDArray[np.float64]
    beside: NDArray[np.float64]


@compiled
def fill_information(  # type: ignore[no-untyped-def]
    sums, weight, overlapping, lines, contrasts, edges, spokes, sigma, variance, prior, diagonal, beside
):
    """Fill the matrix's blocks from what was read along the gridlines, in units of the noise's variance.

    ``overlapping``: the sums were taken up to the gridlines' ends, where they share their pixels.
    """
    beside[:] = 0.0
    for m in range(diagonal.shape[0]):
        diagonal[m, 0], diagonal[m, 1], diagonal[m, 2] = prior[m], 0.0, prior[m]
    for e in range(edges.shape[0]):
        w = weight[e] / variance
        if w == 0.0:
            continue
        nx, ny = -lines[e, UY], lines[e, UX]
        for side in range(2):
            m, value = (
                edges[e, side],
                w * (1.0 + SMOOTH_MAP_COUPLING) * (sums[e, AA] if side == 0 else sums[e, BB]),
            )
            diagonal[m, 0] += value * nx * nx
            diagonal[m, 1] += value * nx * ny
            diagonal[m, 2] += value * ny * ny
        value = w * (1.0 - SMOOTH_MAP_COUPLING) * sums[e, AB]
        beside[e, 0] += value * nx * nx
        beside[e, 1] += value * nx * ny
        beside[e, 2] += value * ny * nx
        beside[e, 3] += value * ny * ny
    if overlapping:
        add_shared_pixels(sums, weight, lines, contrasts, edges, spokes, sigma, variance, diagonal, beside)


@compiled
def gradient(to_a, to_b, weight, variance, lines, edges, count):  # type: ignore[no-untyped-def]
    """(M, 2): the votes of all gridlines at each marker, in units of the noise's variance."""
    out = np.zeros((count, 2))
    for e in range(edges.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        nx, ny = -lines[e, UY], lines[e, UX]
        for side in range(2):
            vote = weight[e] * (to_a[e] if side == 0 else to_b[e]) / variance
            out[edges[e, side], 0] += vote * nx
            out[edges[e, side], 1] += vote * ny
    return out


@compiled
def fill_product(diagonal, beside, edges, vector, out):  # type: ignore[no-untyped-def]
    """Write the matrix's product with a vector (M, 2)."""
    for m in range(diagonal.shape[0]):
        x, y = vector[m, 0], vector[m, 1]
        out[m, 0] = diagonal[m, 0] * x + diagonal[m, 1] * y
        out[m, 1] = diagonal[m, 1] * x + diagonal[m, 2] * y
    for e in range(edges.shape[0]):
        b0, b1, b2, b3 = beside[e, 0], beside[e, 1], beside[e, 2], beside[e, 3]
        if b0 == 0.0 and b3 == 0.0:
            continue
        a, b = edges[e, 0], edges[e, 1]
        out[a, 0] += b0 * vector[b, 0] + b1 * vector[b, 1]
        out[a, 1] += b2 * vector[b, 0] + b3 * vector[b, 1]
        out[b, 0] += b0 * vector[a, 0] + b2 * vector[a, 1]
        out[b, 1] += b1 * vector[a, 0] + b3 * vector[a, 1]


@compiled
def solve_shifts(diagonal, beside, edges, right):  # type: ignore[no-untyped-def]
    """(M, 2): the shifts, by conjugate gradients preconditioned with the diagonal blocks.

    ``diagonal`` must be positive definite; where the whole is not, the descent ends early.
    """
    count = diagonal.shape[0]
    inverse = np.zeros((count, 3))
    for m in range(count):
        xx, xy, yy = diagonal[m, 0], diagonal[m, 1], diagonal[m, 2]
        determinant = xx * yy - xy * xy
        inverse[m, 0], inverse[m, 1], inverse[m, 2] = yy / determinant, -xy / determinant, xx / determinant
    residual = right.copy()
    shift, search, product = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2))
    descent = np.empty((count, 2))
    before, start = 1.0, 0.0
    for step in range(MAX_STEPS):
        now = 0.0
        for m in range(count):
            descent[m, 0] = inverse[m, 0] * residual[m, 0] + inverse[m, 1] * residual[m, 1]
            descent[m, 1] = inverse[m, 1] * residual[m, 0] + inverse[m, 2] * residual[m, 1]
            now += residual[m, 0] * descent[m, 0] + residual[m, 1] * descent[m, 1]
        if step == 0:
            start = now
        if not now > PRECISION**2 * start:
            break
        blend = now / before if step > 0 else 0.0
        for m in range(count):
            search[m, 0] = descent[m, 0] + blend * search[m, 0]
            search[m, 1] = descent[m, 1] + blend * search[m, 1]
        fill_product(diagonal, beside, edges, search, product)
        curvature = 0.0
        for m in range(count):
            curvature += search[m, 0] * product[m, 0] + search[m, 1] * product[m, 1]
        if not curvature > 0.0:
            break
        length = now / curvature
        for m in range(count):
            for axis in range(2):
                shift[m, axis] += length * search[m, axis]
                residual[m, axis] -= length * product[m, axis]
        before = now
    return shift


@compiled
def covariances(diagonal, beside, edges, spokes, weak, which):  # type: ignore[no-untyped-def]
    """(M, 2, 2): diagonal blocks of the inverse, from each marker and its neighbours; NaN where nothing is known, and
    beyond ``gridlines`` (M,) bool.

    The markers beyond the neighbours are eliminated one by one, as if they were not connected to each other, then the
    neighbours. ``weak`` is the information (1/px^2) below which a marker counts as unknown.
    """
    out = np.full((diagonal.shape[0], 2, 2), np.nan)
    asked = np.flatnonzero(which & (diagonal[:, 0] + diagonal[:, 2] > weak))
    lost, left = eliminated_blocks(diagonal, beside, edges)
    others = neighbour_markers(beside, edges, spokes)
    # rows beyond those of five neighbours are written when the fifth is eliminated, and not read
    rows, tail = np.empty(6 * NEIGHBOUR_ROWS * LANES), np.empty(TAIL_ROWS * LANES)
    ring, spoke, own = np.empty(6, np.int64), np.empty(6, np.int64), np.empty((6, 3))
    for start in range(0, len(asked), LANES):
        some = asked[start : start + LANES]
        rows[:], tail[:] = 0.0, 0.0
        for k, m in enumerate(some):
            fill_ring(m, k, lost, left, beside, edges, spokes, others, ring, spoke, own, rows, tail)
            for c in range(3):
                tail[(MIDDLE + c) * LANES + k] = diagonal[m, c]
        update_without_ring(rows, tail)
        for k, m in enumerate(some):
            at = MIDDLE * LANES + k
            xx, xy, yy = tail[at], tail[at + LANES], tail[at + 2 * LANES]
            determinant = xx * yy - xy * xy
            if xx > 0.0 and determinant > 1e-6 * (xx + yy) ** 2 and xx + yy > weak:
                out[m, 0, 0], out[m, 1, 1] = yy / determinant, xx / determinant
                out[m, 0, 1], out[m, 1, 0] = -xy / determinant, -xy / determinant
    return out
