"""The Fisher information matrix of the markers, its sparse solution and the diagonal blocks of its inverse.

A marker's block adds up all gridlines that end there. Along a gridline the derivatives are weighted by 1 - t and t; the
sums over its pixels are measured. Near a marker the gridlines share their pixels (``shared_pixels``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled
from extractor.refine.solve.ring_elimination import (
    LANES,
    MIDDLE,
    allocate_ring_buffers,
    fill_ring,
    prepare_elimination,
    update_without_ring,
)
from extractor.refine.solve.shared_pixels import add_shared_pixels
from extractor.refine.synthesis.gridlines import KNOWN, UX, UY
from extractor.refine.synthesis.residual_kernel import AA, AB, BB

MAX_STEPS = 80  # of the conjugate gradients
PRECISION = 1e-3  # of the solution, relative
# A marker that moves alone bends the gridlines around it, through the smooth map, as a cardinal cubic does:
# 1 - 2.5 t^2 + 1.5 t^3 instead of 1 - t, and -t (1 - t)^2 / 2 beyond the next marker. Relative to the weights 1 - t
# that is 1.1 (.3667 for 1/3) at the marker itself and .9 (.175 - .025 for 1/6) at its neighbour.
SMOOTH_MAP_COUPLING = 0.1
HELD_INFORMATION = 1e12  # 1/px^2, of a marker that is held in place


class Information(NamedTuple):
    """Blocks of the information matrix, 1/px^2.

    Attributes:
        diagonal: (M, 3) xx, xy, yy of every marker.
        off_diagonal: (E, 4) xx, xy, yx, yy from an edge's smaller to its larger marker.
    """

    diagonal: NDArray[np.float64]
    off_diagonal: NDArray[np.float64]


class GridlineSystem(NamedTuple):
    """Gridlines with the measurements along them, and the markers that they join.

    Attributes:
        sums: (E, 24) sums over the pixels, columns of ``residual_kernel``.
        weight: (E,) 0 to 1. A gridline that is not drawn counts as 0.
        lines: (E, 8), as ``gridlines`` gives them.
        contrasts: (E, 3) gray levels.
        edges: (E, 2) the markers at the gridlines' ends.
        spokes: (M, 6) the gridlines at each marker, -1 for none.
        sigma: the blur, px.
        variance: of the noise, squared gray levels, one channel.
    """

    sums: NDArray[np.float64]
    weight: NDArray[np.float64]
    lines: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    edges: NDArray[np.int32]
    spokes: NDArray[np.int32]
    sigma: float
    variance: float


@compiled
def fisher_information(system, prior, overlapping):  # type: ignore[no-untyped-def]
    """The information about the markers.

    Args:
        system: ``GridlineSystem``.
        prior: (M,) 1/px^2, information about each marker before the measurement.
        overlapping: the sums include the gridlines' ends, where gridlines share their pixels.

    Returns:
        ``Information``.
    """
    sums, lines, edges = system.sums, system.lines, system.edges
    diagonal, off_diagonal = np.empty((len(system.spokes), 3)), np.zeros((len(edges), 4))
    for m in range(diagonal.shape[0]):
        diagonal[m, 0], diagonal[m, 1], diagonal[m, 2] = prior[m], 0.0, prior[m]
    for e in range(edges.shape[0]):
        w = system.weight[e] * lines[e, KNOWN] / system.variance
        if w == 0.0:
            continue
        nx, ny = -lines[e, UY], lines[e, UX]
        for side in range(2):
            end_sum = sums[e, AA] if side == 0 else sums[e, BB]
            m, value = edges[e, side], w * (1.0 + SMOOTH_MAP_COUPLING) * end_sum
            diagonal[m, 0] += value * nx * nx
            diagonal[m, 1] += value * nx * ny
            diagonal[m, 2] += value * ny * ny
        value = w * (1.0 - SMOOTH_MAP_COUPLING) * sums[e, AB]
        off_diagonal[e, 0] += value * nx * nx
        off_diagonal[e, 1] += value * nx * ny
        off_diagonal[e, 2] += value * ny * nx
        off_diagonal[e, 3] += value * ny * ny
    if overlapping:
        add_shared_pixels(system, diagonal, off_diagonal)
    return Information(diagonal, off_diagonal)


@compiled
def gradient(system, gradient_start, gradient_end):  # type: ignore[no-untyped-def]
    """(M, 2) 1/px: the gradient of the log-likelihood at each marker.

    Args:
        system: ``GridlineSystem``.
        gradient_start, gradient_end: (E,) squared gray levels / px, along the normal of each gridline at its ends.
    """
    out, lines, edges = np.zeros((len(system.spokes), 2)), system.lines, system.edges
    for e in range(edges.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        nx, ny = -lines[e, UY], lines[e, UX]
        for side in range(2):
            value = system.weight[e] * (gradient_start[e] if side == 0 else gradient_end[e]) / system.variance
            out[edges[e, side], 0] += value * nx
            out[edges[e, side], 1] += value * ny
    return out


@compiled
def fill_product(diagonal, off_diagonal, edges, vector, out):  # type: ignore[no-untyped-def]
    """Write the product of the matrix and a vector (M, 2) into ``out`` (M, 2)."""
    for m in range(diagonal.shape[0]):
        x, y = vector[m, 0], vector[m, 1]
        out[m, 0] = diagonal[m, 0] * x + diagonal[m, 1] * y
        out[m, 1] = diagonal[m, 1] * x + diagonal[m, 2] * y
    for e in range(edges.shape[0]):
        b0, b1 = off_diagonal[e, 0], off_diagonal[e, 1]
        b2, b3 = off_diagonal[e, 2], off_diagonal[e, 3]
        if b0 == 0.0 and b3 == 0.0:
            continue
        a, b = edges[e, 0], edges[e, 1]
        out[a, 0] += b0 * vector[b, 0] + b1 * vector[b, 1]
        out[a, 1] += b2 * vector[b, 0] + b3 * vector[b, 1]
        out[b, 0] += b0 * vector[a, 0] + b2 * vector[a, 1]
        out[b, 1] += b1 * vector[a, 0] + b3 * vector[a, 1]


@compiled
def solve_shifts(diagonal, off_diagonal, edges, right):  # type: ignore[no-untyped-def]
    """The shifts of the markers, by conjugate gradients preconditioned with the diagonal blocks.

    The descent ends early where the whole matrix is not positive definite.

    Args:
        diagonal: (M, 3) 1/px^2, positive definite blocks.
        off_diagonal: (E, 4) 1/px^2.
        edges: (E, 2) the markers that each off-diagonal block joins.
        right: (M, 2) 1/px, the gradient.

    Returns:
        (M, 2) px.
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
        fill_product(diagonal, off_diagonal, edges, search, product)
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
def covariances(diagonal, off_diagonal, edges, spokes, min_information, selected):  # type: ignore[no-untyped-def]
    """The markers' covariances: diagonal blocks of the inverse, from each marker and its neighbours.

    The markers beyond the neighbours are eliminated one by one, as if they were not connected to each other, then the
    neighbours.

    Args:
        diagonal, off_diagonal: (M, 3) and (E, 4) 1/px^2, as in ``Information``.
        edges, spokes: (E, 2) and (M, 6), as in ``Topology``.
        min_information: 1/px^2, below which a marker counts as unknown.
        selected: (M,) bool, the markers to compute.

    Returns:
        (M, 2, 2) px^2, NaN where nothing is known and where not selected.
    """
    out = np.full((diagonal.shape[0], 2, 2), np.nan)
    asked = np.flatnonzero(selected & (diagonal[:, 0] + diagonal[:, 2] > min_information))
    blocks, ring = prepare_elimination(diagonal, off_diagonal, edges, spokes), allocate_ring_buffers()
    tail = ring.tail
    for start in range(0, len(asked), LANES):
        markers = asked[start : start + LANES]
        ring.rows[:], tail[:] = 0.0, 0.0
        for lane, m in enumerate(markers):
            fill_ring(m, lane, blocks, ring)
            for c in range(3):
                tail[(MIDDLE + c) * LANES + lane] = diagonal[m, c]
        update_without_ring(ring.rows, tail)
        for lane, m in enumerate(markers):
            at = MIDDLE * LANES + lane
            xx, xy, yy = tail[at], tail[at + LANES], tail[at + 2 * LANES]
            determinant = xx * yy - xy * xy
            if xx > 0.0 and determinant > 1e-6 * (xx + yy) ** 2 and xx + yy > min_information:
                out[m, 0, 0], out[m, 1, 1] = yy / determinant, xx / determinant
                out[m, 0, 1], out[m, 1, 0] = -xy / determinant, -xy / determinant
    return out
