"""The pixels near a marker, which the gridlines that meet there share.

The derivatives by two gridlines with the directions a and b overlap by the integrals of
t^i u^j exp(-|t a - u b|^2 / 4 s^2) / 4 pi s^2 over the two rays, which have closed forms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from extractor.numeric.compilation import compiled, vectorized
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY
from extractor.refine.synthesis.residual_kernel import AA, BB

MIN_ANGLE = 0.4  # rad; the closed forms hold for long gridlines, which two at a smaller angle are not
MIN_END_INFORMATION = 0.75  # least share of a gridline's information that is left where its ends are blurred
# Rows of the gridlines at one marker, zero where there are fewer: direction away from the marker, color, weight,
# 1 / length; sums over the other gridlines of their normals times the overlap: near end with near end, their near end
# with its far end.
AX, AY, C0, C1, C2, WEIGHT, INVERSE_LENGTH, NEAR_X, NEAR_Y, FAR_X, FAR_Y = range(0, 88, 8)


class GridlineEnd(NamedTuple):
    """A gridline at one marker.

    Attributes:
        x, y: its direction away from the marker.
        red, green, blue: its contrast, gray levels.
        weight: 0 to 1.
        inverse_length: 1/px.
    """

    x: float
    y: float
    red: float
    green: float
    blue: float
    weight: float
    inverse_length: float


def _closed_forms() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Coefficients of r a and r^3 b as polynomials in r = sqrt(1 - cosine), accurate to 1e-7.

    With s the sine and p the angle between one gridline and the continuation of the other, a = p / s is the integral
    for i = j = 0 and b = (s + p cosine) / s^3 that for i = j = 1.
    """
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
    """The overlap of the derivatives by two gridlines that leave one marker.

    Args:
        cosine: of the angle between them.
        first, second: 1/px, 1 / length of each.
        sigma: the blur, px.

    Returns:
        The overlap of near end with near end, of near end with the far end of the second, and of near end with the far
        end of the first.
    """
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
def _accumulate_overlaps(rows, i, gridline, nx, ny, sigma):  # type: ignore[no-untyped-def]
    """Add the overlaps of gridline i (``GridlineEnd``, normal n) with all gridlines at its marker to their sums."""
    weight, inverse_length = gridline.weight, gridline.inverse_length
    for k in range(8):
        color = gridline.red * rows[C0 + k] + gridline.green * rows[C1 + k] + gridline.blue * rows[C2 + k]
        dot = 0.0 if k == i else color * min(weight, rows[WEIGHT + k])
        cosine = gridline.x * rows[AX + k] + gridline.y * rows[AY + k]
        near, far, _ = overlap(cosine, inverse_length, rows[INVERSE_LENGTH + k], sigma)
        near, far = dot * near, dot * far
        rows[NEAR_X + k] += near * nx
        rows[NEAR_Y + k] += near * ny
        rows[FAR_X + k] += far * nx
        rows[FAR_Y + k] += far * ny


@compiled
def _fill_gridlines_at_marker(m, system, rows, numbers):  # type: ignore[no-untyped-def]
    """Write the gridlines at marker m into ``rows`` and their numbers into ``numbers`` (8,); return their count."""
    sums, lines, contrasts, edges, spokes = (
        system.sums,
        system.lines,
        system.contrasts,
        system.edges,
        system.spokes,
    )
    sigma, count = system.sigma, 0
    for k in range(spokes.shape[1]):
        e = spokes[m, k]
        if e < 0 or system.weight[e] * lines[e, KNOWN] == 0.0:
            continue
        # the direction in which the curved gridline leaves the marker
        sense = 1.0 if edges[e, 0] == m else -1.0
        slope = lines[e, LEAVE] if sense > 0.0 else lines[e, ARRIVE]
        size = sense / np.sqrt(1.0 + slope * slope)
        rows[AX + count] = size * (lines[e, UX] - slope * lines[e, UY])
        rows[AY + count] = size * (lines[e, UY] + slope * lines[e, UX])
        # the smaller the measured part of a gridline that the image's border cuts, the less it shares
        c0, c1, c2 = contrasts[e, 0], contrasts[e, 1], contrasts[e, 2]
        uncut = (c0 * c0 + c1 * c1 + c2 * c2) * lines[e, LENGTH] / (6.0 * np.sqrt(np.pi) * sigma)
        end_sum = sums[e, AA] if sense > 0.0 else sums[e, BB]
        part = min(end_sum / max(MIN_END_INFORMATION * uncut, 1e-12), 1.0)
        rows[C0 + count], rows[C1 + count], rows[C2 + count] = part * c0, part * c1, part * c2
        rows[WEIGHT + count], rows[INVERSE_LENGTH + count] = system.weight[e], 1.0 / lines[e, LENGTH]
        numbers[count] = e
        count += 1
    return count


@compiled
def add_shared_pixels(system, diagonal, off_diagonal):  # type: ignore[no-untyped-def]
    """Add the information of shared pixels to the matrix.

    Args:
        system: ``GridlineSystem``.
        diagonal, off_diagonal: (M, 3) and (E, 4) 1/px^2, as in ``Information``; written.
    """
    lines, edges, variance = system.lines, system.edges, system.variance
    rows, numbers = np.zeros(88), np.empty(8, np.int64)
    for m in range(system.spokes.shape[0]):
        for k in range(88):
            rows[k] = 0.0
        count = _fill_gridlines_at_marker(m, system, rows, numbers)
        for i in range(count):
            nx, ny = -lines[numbers[i], UY] / variance, lines[numbers[i], UX] / variance
            gridline = GridlineEnd(
                rows[AX + i],
                rows[AY + i],
                rows[C0 + i],
                rows[C1 + i],
                rows[C2 + i],
                rows[WEIGHT + i],
                rows[INVERSE_LENGTH + i],
            )
            _accumulate_overlaps(rows, i, gridline, nx, ny, system.sigma)
        for i in range(count):
            e = numbers[i]
            nx, ny = -lines[e, UY], lines[e, UX]
            x, y = rows[NEAR_X + i], rows[NEAR_Y + i]
            diagonal[m, 0] += x * nx
            diagonal[m, 1] += x * ny
            diagonal[m, 2] += y * ny
            x, y, swap = rows[FAR_X + i], rows[FAR_Y + i], 0 if edges[e, 0] == m else 1
            off_diagonal[e, 0] += x * nx
            off_diagonal[e, 1 + swap] += x * ny
            off_diagonal[e, 2 - swap] += y * nx
            off_diagonal[e, 3] += y * ny
