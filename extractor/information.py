"""The Fisher information matrix of the markers, its sparse solution and its inverse's diagonal blocks.

A marker's block joins all gridlines that end there. Along a gridline the weights are 1 - t and t; the sums over its
pixels are measured. Near a marker the gridlines share their pixels: with two of them at the angle q the derivatives
overlap by the integrals of t^i u^j exp(-|t a - u b|^2 / 4 s^2) / 4 pi s^2 over the two rays, which have closed forms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY
from .synthesis import AA, AB, BB

MAX_STEPS = 80  # of the conjugate gradients
MIN_ANGLE = 0.4  # rad; the closed forms are for long gridlines, and two at a smaller angle are not
PRECISION = 1e-3  # of the solution
# A marker that moves alone bends the gridlines around it, through the smooth map, as a cardinal cubic does:
# 1 - 2.5 t^2 + 1.5 t^3 instead of 1 - t, and -t (1 - t)^2 / 2 beyond the next marker. Against the votes 1 - t that
# is 1.1 (.3667 for 1/3) at the marker itself and .9 (.175 - .025 for 1/6) at its neighbour.
SMOOTH = 0.1
ENDS = 0.75  # of a gridline's information is left at least where its ends are blurred


class Information(NamedTuple):
    """Blocks in 1/px^2: diagonal (M, 3) as xx, xy, yy; beside (E, 4) from an edge's smaller to its larger marker."""

    diagonal: NDArray[np.float64]
    beside: NDArray[np.float64]


@compiled
def overlap(cosine, first, second, sigma):  # type: ignore[no-untyped-def]
    """How much two gridlines of these lengths from one marker overlap there: near with near end, near with far end
    of the second, near with far end of the first."""
    cosine = min(cosine, np.cos(MIN_ANGLE))
    rest = np.pi - np.arccos(max(cosine, -1.0))
    if rest < 0.05:
        a, b = 1.0, 1.0 / 3.0
    else:
        sine = np.sqrt(1.0 - cosine * cosine)
        a = rest / sine
        b = (sine + rest * cosine) / sine**3
    zeroth = a / (2.0 * np.pi)
    linear = sigma * np.sqrt(np.pi) / (2.0 * np.pi * (1.0 - cosine))
    square = sigma * sigma * b / np.pi
    near = zeroth - linear / first - linear / second + square / (first * second)
    return (
        max(near, 0.0),
        linear / second - square / (first * second),
        linear / first - square / (first * second),
    )


@compiled
def assemble(  # type: ignore[no-untyped-def]
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
            m, value = edges[e, side], w * (1.0 + SMOOTH) * (sums[e, AA] if side == 0 else sums[e, BB])
            diagonal[m, 0] += value * nx * nx
            diagonal[m, 1] += value * nx * ny
            diagonal[m, 2] += value * ny * ny
        value = w * (1.0 - SMOOTH) * sums[e, AB]
        beside[e, 0] += value * nx * nx
        beside[e, 1] += value * nx * ny
        beside[e, 2] += value * ny * nx
        beside[e, 3] += value * ny * ny
    if not overlapping:
        return
    away, seen = np.empty((6, 2)), np.empty(6)
    for m in range(spokes.shape[0]):
        for i in range(6):
            e = spokes[m, i]
            if e < 0 or weight[e] == 0.0:
                continue
            # the direction in which the curved gridline leaves the marker
            out = 1.0 if edges[e, 0] == m else -1.0
            slope = lines[e, LEAVE] if out > 0.0 else lines[e, ARRIVE]
            size = out / np.sqrt(1.0 + slope * slope)
            away[i, 0] = size * (lines[e, UX] - slope * lines[e, UY])
            away[i, 1] = size * (lines[e, UY] + slope * lines[e, UX])
            # a gridline that the image's border cuts shares the less the less of it was read
            strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
            whole = strength * lines[e, LENGTH] / (6.0 * np.sqrt(np.pi) * sigma)
            seen[i] = min((sums[e, AA] if out > 0.0 else sums[e, BB]) / max(ENDS * whole, 1e-12), 1.0)
            for j in range(i):
                f = spokes[m, j]
                if f < 0 or weight[f] == 0.0:
                    continue
                dot = contrasts[e, 0] * contrasts[f, 0] + contrasts[e, 1] * contrasts[f, 1]
                dot = (dot + contrasts[e, 2] * contrasts[f, 2]) * min(weight[e], weight[f]) / variance
                dot *= seen[i] * seen[j]
                if dot != 0.0:
                    cosine = away[i, 0] * away[j, 0] + away[i, 1] * away[j, 1]
                    near, far_f, far_e = overlap(cosine, lines[e, LENGTH], lines[f, LENGTH], sigma)
                    _couple(m, e, f, dot * near, dot * far_f, dot * far_e, lines, edges, diagonal, beside)


@compiled
def _couple(m, e, f, near, far_f, far_e, lines, edges, diagonal, beside):  # type: ignore[no-untyped-def]
    """Add what two gridlines that meet at marker m share."""
    enx, eny, fnx, fny = -lines[e, UY], lines[e, UX], -lines[f, UY], lines[f, UX]
    diagonal[m, 0] += 2.0 * near * enx * fnx
    diagonal[m, 1] += near * (enx * fny + eny * fnx)
    diagonal[m, 2] += 2.0 * near * eny * fny
    _couple_far(m, f, far_f, enx, eny, fnx, fny, edges, beside)
    _couple_far(m, e, far_e, fnx, fny, enx, eny, edges, beside)


@compiled
def _couple_far(m, g, value, nx, ny, ox, oy, edges, beside):  # type: ignore[no-untyped-def]
    """Add the overlap of another gridline's near end (normal n) at m with the far end of gridline g (normal o)."""
    beside[g, 0] += value * nx * ox
    beside[g, 3] += value * ny * oy
    if edges[g, 0] == m:
        beside[g, 1] += value * nx * oy
        beside[g, 2] += value * ny * ox
    else:
        beside[g, 1] += value * ny * ox
        beside[g, 2] += value * nx * oy


@compiled
def gradient(to_a, to_b, lines, edges, count):  # type: ignore[no-untyped-def]
    """(M, 2): the votes of all gridlines at each marker."""
    out = np.zeros((count, 2))
    for e in range(edges.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        nx, ny = -lines[e, UY], lines[e, UX]
        for side in range(2):
            vote = to_a[e] if side == 0 else to_b[e]
            out[edges[e, side], 0] += vote * nx
            out[edges[e, side], 1] += vote * ny
    return out


@compiled
def _multiply(diagonal, beside, edges, vector, out):  # type: ignore[no-untyped-def]
    for m in range(diagonal.shape[0]):
        x, y = vector[m]
        out[m, 0] = diagonal[m, 0] * x + diagonal[m, 1] * y
        out[m, 1] = diagonal[m, 1] * x + diagonal[m, 2] * y
    for e in range(edges.shape[0]):
        b0, b1, b2, b3 = beside[e]
        if b0 == 0.0 and b3 == 0.0:
            continue
        a, b = edges[e]
        out[a, 0] += b0 * vector[b, 0] + b1 * vector[b, 1]
        out[a, 1] += b2 * vector[b, 0] + b3 * vector[b, 1]
        out[b, 0] += b0 * vector[a, 0] + b2 * vector[a, 1]
        out[b, 1] += b1 * vector[a, 0] + b3 * vector[a, 1]


@compiled
def solve(diagonal, beside, edges, right):  # type: ignore[no-untyped-def]
    """(M, 2): the shifts, by conjugate gradients preconditioned with the diagonal blocks.

    ``diagonal`` must be positive definite; where the whole is not, the descent ends early.
    """
    count = diagonal.shape[0]
    inverse = np.zeros((count, 3))
    for m in range(count):
        xx, xy, yy = diagonal[m]
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
        _multiply(diagonal, beside, edges, search, product)
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
def _put(matrix, i, j, beside, forward):  # type: ignore[no-untyped-def]
    """Place an edge's block at block (i, j) of a small symmetric matrix, i < j."""
    b0, b1, b2, b3 = beside
    if not forward:
        b1, b2 = b2, b1
    matrix[2 * i, 2 * j], matrix[2 * i, 2 * j + 1] = b0, b1
    matrix[2 * i + 1, 2 * j], matrix[2 * i + 1, 2 * j + 1] = b2, b3


@compiled
def covariances(diagonal, beside, edges, spokes, weak):  # type: ignore[no-untyped-def]
    """(M, 2, 2): diagonal blocks of the inverse, from each marker and its neighbours; NaN where nothing is known.

    The markers beyond the neighbours are eliminated one by one, as if they were not connected to each other.
    ``weak`` is the information (1/px^2) below which a marker counts as unknown.
    """
    count = diagonal.shape[0]
    out = np.full((count, 2, 2), np.nan)
    matrix = np.zeros((14, 14))
    ring = np.empty(6, np.int64)
    for m in range(count):
        if not diagonal[m, 0] + diagonal[m, 2] > weak:
            continue
        matrix[:] = 0.0
        k = 0
        for s in range(6):
            e = spokes[m, s]
            if e >= 0 and (beside[e, 0] != 0.0 or beside[e, 3] != 0.0):
                ring[k] = edges[e, 0] + edges[e, 1] - m
                _put(matrix, k, 6, beside[e], edges[e, 0] == ring[k])
                k += 1
        for i in range(k):
            n = ring[i]
            xx, xy, yy = diagonal[n]
            for s in range(6):
                e = spokes[n, s]
                if e < 0 or (beside[e, 0] == 0.0 and beside[e, 3] == 0.0):
                    continue
                p = edges[e, 0] + edges[e, 1] - n
                if p == m:
                    continue
                inside = -1
                for j in range(k):
                    if ring[j] == p:
                        inside = j
                if inside >= 0:
                    if inside < i:
                        _put(matrix, inside, i, beside[e], edges[e, 0] == p)
                    continue
                px, pxy, py = diagonal[p]
                determinant = px * py - pxy * pxy
                b0, b1, b2, b3 = beside[e]
                if edges[e, 0] != n:
                    b1, b2 = b2, b1
                xx -= (py * b0 * b0 - 2 * pxy * b0 * b1 + px * b1 * b1) / determinant
                xy -= (py * b0 * b2 - pxy * (b0 * b3 + b1 * b2) + px * b1 * b3) / determinant
                yy -= (py * b2 * b2 - 2 * pxy * b2 * b3 + px * b3 * b3) / determinant
            matrix[2 * i, 2 * i], matrix[2 * i, 2 * i + 1], matrix[2 * i + 1, 2 * i + 1] = xx, xy, yy
        # eliminate the neighbours in turn; what is left at the end is the marker's own block
        last_xx, last_xy, last_yy = diagonal[m]
        matrix[12, 12], matrix[12, 13], matrix[13, 13] = last_xx, last_xy, last_yy
        for c in range(2 * k):
            pivot = matrix[c, c]
            if not pivot > 0.0:
                continue
            for r in range(c + 1, 14):
                factor = matrix[c, r] / pivot
                if factor != 0.0:
                    for j in range(r, 14):
                        matrix[r, j] -= factor * matrix[c, j]
        xx, xy, yy = matrix[12, 12], matrix[12, 13], matrix[13, 13]
        determinant = xx * yy - xy * xy
        if xx > 0.0 and determinant > 1e-6 * (xx + yy) ** 2 and xx + yy > weak:
            out[m, 0, 0], out[m, 1, 1] = yy / determinant, xx / determinant
            out[m, 0, 1], out[m, 1, 0] = -xy / determinant, -xy / determinant
    return out
