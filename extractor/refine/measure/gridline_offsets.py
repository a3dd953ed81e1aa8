"""How far the gridlines lie off, place by place, where refinement last compared the image with the pattern."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, vectorized
from extractor.refine.measure.gridline_weights import MIN_OFFSET_WEIGHT
from extractor.refine.measure.matched_filter import HALF, I1, I2, I3, I4, I5
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, sagitta
from extractor.refine.synthesis.pixel_rows import (
    ALONG,
    ASIDE,
    CHUNK,
    TO,
    fill_projections,
    fill_rows,
    padded_count,
    row_sizes,
)
from extractor.refine.synthesis.residual_kernel import C0, C1, C2, C3, C4, C5

BAND = 2.2  # how far from a gridline its pixels count, in units of the blur
CLEAR_SIGMA = 2.0  # how far the next gridline must be where nothing was drawn, in units of the blur
MIN_WEIGHT_SUM = 0.08  # of a pixel on the gridline
OFFSET, VARIANCE = range(2)
STATION, WEIGHTED_RESIDUAL, SQUARED_WEIGHT = (k * CHUNK for k in range(3))  # of pixels


class GridlineReading(NamedTuple):
    """Along what gridlines, and beside which colors, refinement last compared the image with the pattern.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        contrasts: (E, 3).
        foot: (E,) what a color beyond the gridline gives in units of the contrast; where drawn, black and half of what
            the levels were corrected by.
        room: (E, 4), as ``unmixing`` gives it; used where nothing was drawn.
        use: (E,) how far the gridline is trusted.
        aside: (E,) px, how far towards (-uy, ux) it is seen as the cells are swollen.
        sigma: the blur, px.
        noise: grey levels.
        drawn: the pattern was drawn.
    """

    lines: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    foot: NDArray[np.float64]
    clearance: NDArray[np.float64]
    weight: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]
    sigma: float
    noise: float
    drawn: bool


@compiled
def foot_levels(contrasts, black, off):  # type: ignore[no-untyped-def]
    """(E,) black (E, 3) and half of a change of the sides' levels (E,), in units of the contrast."""
    out = np.zeros(contrasts.shape[0])
    for e in range(contrasts.shape[0]):
        strength = 0.0
        for channel in range(3):
            strength += contrasts[e, channel] ** 2
            out[e] += contrasts[e, channel] * black[e, channel]
        out[e] = (out[e] + 0.5 * off[e]) / max(strength, 1e-9)
    return out


@vectorized
def _fill_weighted_residuals(  # type: ignore[no-untyped-def]
    rows, lanes, wide, du, dv, inverse, short, length, leave, arrive, step_seen, places, rest, under, votes
):
    """Fill in each pixel's place along the gridline in units of those between virtual markers, its weight times what it
    shows beyond what lies ``under`` it (and beyond ``step_seen`` times a blurred step), and its weight squared."""
    zero, one, band = np.float32(0.0), np.float32(1.0), np.float32(BAND * BAND)
    for j in range(wide):
        own, below, out, step = rest[j * lanes :], under[j * lanes :], votes[j * lanes :], np.float32(j)
        for i in range(lanes):
            t = (rows[ALONG + i] + step * du) * short
            s = one - t
            z = (rows[ASIDE + i] + step * dv - length * (t * s * (leave * s - arrive * t))) * inverse
            zz = z * z
            within = (step <= rows[TO + i]) & (zz < band)
            g = C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5))))
            g = g if within else zero
            half = HALF - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))))
            half = half if within else zero  # the polynomial may be anything beyond
            out[STATION + i] = np.floor(t * places - HALF)
            out[WEIGHTED_RESIDUAL + i], out[SQUARED_WEIGHT + i] = (
                g * (own[i] - below[i] - step_seen * half),
                g * g,
            )


@vectorized
def _sums_at_station(votes, count, place):  # type: ignore[no-untyped-def]
    """The sums of the weighed residuals and of the squared weights of the pixels at a place."""
    zero = np.float32(0.0)
    pull, weight = zero, zero
    for k in range(count):
        here = votes[STATION + k] == place
        pull += votes[WEIGHTED_RESIDUAL + k] if here else zero
        weight += votes[SQUARED_WEIGHT + k] if here else zero
    return pull, weight


@compiled
def measure_offsets(image, model, lines, contrasts, foot, room, use, aside, sigma, noise, drawn, count):  # type: ignore[no-untyped-def]
    """(E, m, 2): how far each gridline lies off towards (-uy, ux) around its virtual markers, beyond what it is seen
    ``dot_gain_offset`` (E,), px, and the variance.

    NaN where the gridline has no contrast, is not trusted, leaves the image, or where another one is too near for what
    was not drawn.
    """
    out = np.full((lines.shape[0], count, 2), np.nan)
    flat, shown, height, width = image.reshape(-1), model.reshape(-1), image.shape[0], image.shape[1]
    at, rows, votes = (
        np.empty(CHUNK, np.int64),
        np.empty(4 * CHUNK, np.float32),
        np.empty(3 * CHUNK, np.float32),
    )
    rest, under = np.zeros(CHUNK, np.float32), np.zeros(CHUNK, np.float32)
    inverse, reach, places = 1.0 / sigma, BAND * sigma, count + 1.0
    nothing, step_seen = np.float32(0.0), np.float32(0.0 if drawn else 1.0)
    sums = np.zeros((count, 2))
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength == 0.0 or use[e] < MIN_OFFSET_WEIGHT:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0, leave, arrive = lines[e, X], lines[e, Y], lines[e, LEAVE], lines[e, ARRIVE]
        u0, u1, u2 = contrasts[e, 0] / strength, contrasts[e, 1] / strength, contrasts[e, 2] / strength
        color = np.float32(u0), np.float32(u1), np.float32(u2)
        # columns of pixels are walked through where it runs along x rather than along y, else rows
        along_x = abs(ux) > abs(uy)
        p0, q0, up, uq = (x0, y0, ux, uy) if along_x else (y0, x0, uy, ux)
        p_end, q_end, step_p, step_q = (
            (width, height, 3, 3 * width) if along_x else (height, width, 3 * width, 3)
        )
        # the first and the last virtual marker are half a place from where their pixels begin and end
        from_p, to_p = p0 + (0.5 / places) * length * up, p0 + (1.0 - 0.5 / places) * length * up
        slack, half = reach * abs(uq), reach / abs(up)
        first = max(int(np.ceil(min(from_p, to_p) - slack)), 0)
        last = min(int(np.floor(max(from_p, to_p) + slack)), p_end - 1)
        wide, most = row_sizes(half, q_end)
        line = (p0, q0, up, uq, length, leave, arrive, half)
        steps = (
            np.float32(uq),
            np.float32(up if along_x else -up),
            np.float32(inverse),
            np.float32(1.0 / length),
        )
        shape = np.float32(length), np.float32(leave), np.float32(arrive), step_seen, np.float32(places)
        sums[:] = 0.0
        for begin in range(first, last + 1, most):
            own = min(most, last + 1 - begin)
            fill_rows(begin, 1, own, *line, 0, q_end - 1, wide, step_p, step_q, at, rows)
            fill_projections(flat, at, own, wide, step_q, color, np.float32(foot[e]), rest)
            if drawn:
                fill_projections(shown, at, own, wide, step_q, color, nothing, under)
            _fill_weighted_residuals(rows, padded_count(own), wide, *steps, *shape, rest, under, votes)
            for j in range(count):
                pull, weight = _sums_at_station(votes, padded_count(own) * wide, np.float32(j))
                sums[j, 0] += pull
                sums[j, 1] += weight
        for j in range(count):
            if sums[j, 1] < MIN_WEIGHT_SUM:
                continue
            if not drawn:
                near, far = (j + 0.5) / places, (count - j - 0.5) / places
                if length * min(near * room[e, 1], far * room[e, 2]) < CLEAR_SIGMA * sigma:
                    continue
            out[e, j, OFFSET] = sigma * sums[j, 0] / sums[j, 1] - aside[e]
            out[e, j, VARIANCE] = noise**2 * sigma**2 / (strength * sums[j, 1])
    return out


def measure_virtual_markers(
    image: NDArray[np.uint8], model: NDArray[np.float32], reading: GridlineReading, count: int, scale: int
) -> NDArray[np.float64]:
    """(E, m, 3): points on the gridlines as they were read, moved to where the image shows them, and their variances
    across, at the full scale of an image that was reduced by ``scale``; NaN where there are none."""
    if count == 0:
        return np.empty((len(reading.lines), 0, 3))
    offsets = measure_offsets(image, model, *reading, count)
    return np.asarray(_virtual_markers(reading.lines, offsets, scale))


@compiled
def _virtual_markers(lines, offsets, scale):  # type: ignore[no-untyped-def]
    """(E, m, 3) the measured points and their variance across the gridline."""
    edges, count = offsets.shape[0], offsets.shape[1]
    out = np.full((edges, count, 3), np.nan)
    for e in range(edges):
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        for j in range(count):
            t = (j + 1.0) / (count + 1.0)
            off = sagitta(t, length, lines[e, LEAVE], lines[e, ARRIVE]) + offsets[e, j, OFFSET]
            out[e, j, 0] = (lines[e, X] + t * length * ux - off * uy + 0.5) * scale - 0.5
            out[e, j, 1] = (lines[e, Y] + t * length * uy + off * ux + 0.5) * scale - 0.5
            out[e, j, 2] = offsets[e, j, VARIANCE] * scale * scale
    return out
