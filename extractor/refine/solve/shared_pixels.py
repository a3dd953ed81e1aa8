"""What the gridlines that meet at a marker share: the pixels near it.

With two gridlines at the angle q the derivatives overlap by the integrals of t^i u^j exp(-|t a - u b|^2 / 4 s^2) /
4 pi s^2 over the two rays, which have closed forms.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, vectorized
from extractor.refine.synthesis.gridlines import ARRIVE, LEAVE, LENGTH, UX, UY
from extractor.refine.synthesis.residual_kernel import AA, BB

MIN_ANGLE = 0.4  # rad; the closed forms are for long gridlines, and two at a smaller angle are not
MIN_END_INFORMATION = 0.75  # of a gridline's information is left at least where its ends are blurred
# The gridlines at one marker side by side, zero where there are fewer: direction away from it, color, weight, 1 /
# length; sums over the others of their normals times the overlap: near with near end, theirs near with its far end.
AX, AY, C0, C1, C2, WEIGHT, INVERSE_LENGTH, NEAR_X, NEAR_Y, FAR_X, FAR_Y = range(0, 88, 8)


def _closed_forms() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """r a and r^3 b as polynomials in r = sqrt(1 - cosine), good to 1e-7, with s the sine and p the angle between one
    gridline and the other's continuation: a = p / s and b = (s + p cosine) / s^3 are the integrals for i + j = 0 and
    i = j = 1."""
    r = np.linspace(np.sqrt(1 - np.cos(MIN_ANGLE)), np.sqrt(2 - 1e-3), 400)
    cosine = 1 - r * r
    s, p = np.sqrt(1 - cosine * cosine), np.pi - np.arccos(cosine)
    forms = r * p / s, r**3 * (s + p * cosine) / s**3
    first, second = (
        tuple(float(c) for c in np.polynomial.Polynomial.fit(r, form, 8).convert().coef) for form in forms
    )
    return first, second


(A0, A1, A2, A3, A4, A5, A6, A7, A8), (B0, B1, B2, B3, B4, B5, B6, B7, B8) = _closed_forms()
MAX_COSINE = float(np.cos(MIN_ANGLE))


@vectorized
def overlap(cosine, first, second, sigma):  # type: ignore[no-untyped-def]
    """How much two gridlines from one marker overlap there, given 1 / length of both: near with near end, near with
    far end of the second, near with far end of the first."""
    rest = 1.0 - min(max(cosine, -1.0), MAX_COSINE)
    per = 1.0 / np.sqrt(rest)
    r = rest * per
    a = A0 + r * (A1 + r * (A2 + r * (A3 + r * (A4 + r * (A5 + r * (A6 + r * (A7 + r * A8)))))))
    b = B0 + r * (B1 + r * (B2 + r * (B3 + r * (B4 + r * (B5 + r * (B6 + r * (B7 + r * B8)))))))
    linear = sigma * per * per / (2.0 * np.sqrt(np.pi))
    square = sigma * sigma * per * per * per * b / np.pi * first * second
    near = per * a / (2.0 * np.pi) - linear * (first + second) + square
    return max(near, 0.0), linear * second - square, linear * first - square


@vectorized
def _accumulate_overlaps(rows, i, ax, ay, c0, c1, c2, weight, short, nx, ny, sigma):  # type: ignore[no-untyped-def]
    """Add what gridline i (its normal n) shares with all at its marker to their sums."""
    for k in range(8):
        color = c0 * rows[C0 + k] + c1 * rows[C1 + k] + c2 * rows[C2 + k]
        dot = 0.0 if k == i else color * min(weight, rows[WEIGHT + k])
        near, far, _ = overlap(ax * rows[AX + k] + ay * rows[AY + k], short, rows[INVERSE_LENGTH + k], sigma)
        near, far = dot * near, dot * far
        rows[NEAR_X + k] += near * nx
        rows[NEAR_Y + k] += near * ny
        rows[FAR_X + k] += far * nx
        rows[FAR_Y + k] += far * ny


@compiled
def _fill_gridlines_at_marker(m, sums, weight, lines, contrasts, edges, spokes, sigma, rows, seen):  # type: ignore[no-untyped-def]
    """Lay the gridlines at marker m side by side, their numbers into ``seen``; how many."""
    count = 0
    for k in range(spokes.shape[1]):
        e = spokes[m, k]
        if e < 0 or weight[e] == 0.0:
            continue
        # the direction in which the curved gridline leaves the marker
        out = 1.0 if edges[e, 0] == m else -1.0
        slope = lines[e, LEAVE] if out > 0.0 else lines[e, ARRIVE]
        size = out / np.sqrt(1.0 + slope * slope)
        rows[AX + count] = size * (lines[e, UX] - slope * lines[e, UY])
        rows[AY + count] = size * (lines[e, UY] + slope * lines[e, UX])
        # a gridline that the image's border cuts shares the less the less of it was read
        c0, c1, c2 = contrasts[e, 0], contrasts[e, 1], contrasts[e, 2]
        whole = (c0 * c0 + c1 * c1 + c2 * c2) * lines[e, LENGTH] / (6.0 * np.sqrt(np.pi) * sigma)
        part = min((sums[e, AA] if out > 0.0 else sums[e, BB]) / max(MIN_END_INFORMATION * whole, 1e-12), 1.0)
        rows[C0 + count], rows[C1 + count], rows[C2 + count] = part * c0, part * c1, part * c2
        rows[WEIGHT + count], rows[INVERSE_LENGTH + count] = weight[e], 1.0 / lines[e, LENGTH]
        seen[count] = e
        count += 1
    return count


@compiled
def add_shared_pixels(  # type: ignore[no-untyped-def]
    sums, weight, lines, contrasts, edges, spokes, sigma, variance, diagonal, beside
):
    """Add what gridlines share to the matrix's blocks, in units of the noise's variance."""
    rows, seen = np.zeros(88), np.empty(8, np.int64)
    for m in range(spokes.shape[0]):
        for k in range(88):
            rows[k] = 0.0
        count = _fill_gridlines_at_marker(m, sums, weight, lines, contrasts, edges, spokes, sigma, rows, seen)
        for i in range(count):
            nx, ny = -lines[seen[i], UY] / variance, lines[seen[i], UX] / variance
            color = rows[C0 + i], rows[C1 + i], rows[C2 + i]
            _accumulate_overlaps(
                rows,
                i,
                rows[AX + i],
                rows[AY + i],
                *color,
                rows[WEIGHT + i],
                rows[INVERSE_LENGTH + i],
                nx,
                ny,
                sigma,
            )
        for i in range(count):
            e = seen[i]
            nx, ny = -lines[e, UY], lines[e, UX]
            x, y = rows[NEAR_X + i], rows[NEAR_Y + i]
            diagonal[m, 0] += x * nx
            diagonal[m, 1] += x * ny
            diagonal[m, 2] += y * ny
            x, y, swap = rows[FAR_X + i], rows[FAR_Y + i], 0 if edges[e, 0] == m else 1
            beside[e, 0] += x * nx
            beside[e, 1 + swap] += x * ny
            beside[e, 2 - swap] += y * nx
            beside[e, 3] += y * ny
