"""Offsets of the gridlines at virtual markers, measured where refinement last compared the image with the pattern."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined, inlined_no_refcount, vectorized
from extractor.refine.measure.gridline_weights import MIN_OFFSET_WEIGHT
from extractor.refine.measure.matched_filter import HALF, I1, I2, I3, I4, I5, SINE_A, SINE_B
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, sagitta
from extractor.refine.synthesis.pixel_rows import (
    ACROSS,
    ALONG,
    CHUNK,
    TO,
    Color,
    RowBlock,
    fill_projections,
    fill_rows,
    padded_count,
    pixel_geometry,
    row_frame,
    row_sizes,
)
from extractor.refine.synthesis.pixel_weights import BAND, C0, C1, C2, C3, C4, C5

CLEAR_SIGMA = 2.0  # in units of the blur, the least distance of the next gridline where nothing was drawn
MIN_WEIGHT_SUM = 0.08  # of the squared weights of pixels at a virtual marker
OFFSET, VARIANCE = range(2)
STATION, WEIGHTED_RESIDUAL, SQUARED_WEIGHT = (k * CHUNK for k in range(3))  # columns of a pixel


class GridlineReading(NamedTuple):
    """The gridlines and the levels beside them, where refinement last compared the image with the pattern.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        contrasts: (E, 3) gray levels.
        foot: (E,) in units of the contrast, the level beyond the gridline; where the pattern was drawn, the black and
            half of the correction of the levels.
        clearance: (E, 4), as ``channel_projections`` gives it; used where nothing was drawn.
        weight: (E,) 0 to 1.
        dot_gain_offset: (E,) px, the shift of the gridline towards (-uy, ux) by dot gain.
        sigma: px, the blur.
        noise: gray levels.
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


class OffsetBuffers(NamedTuple):
    """Memory for the pixels of one gridline and its stations.

    Attributes:
        first: (n,) int64, the first pixels of the rows. rows: their columns.
        image, model: (n,) float32, the pixels' levels along the contrast, in the image and in the drawing.
        weighted: three columns of the pixels.
        sums: (m, 2) the weighted residuals and the squared weights at each station.
    """

    first: NDArray[np.int64]
    rows: NDArray[np.float32]
    image: NDArray[np.float32]
    model: NDArray[np.float32]
    weighted: NDArray[np.float32]
    sums: NDArray[np.float64]


@compiled
def foot_levels(contrasts, black, level_shift):  # type: ignore[no-untyped-def]
    """(E,) in units of the contrast: the black (E, 3) and half of the change of the sides' levels (E,)."""
    out = np.zeros(contrasts.shape[0])
    for e in range(contrasts.shape[0]):
        strength = 0.0
        for channel in range(3):
            strength += contrasts[e, channel] ** 2
            out[e] += contrasts[e, channel] * black[e, channel]
        out[e] = (out[e] + 0.5 * level_shift[e]) / max(strength, 1e-9)
    return out


@vectorized
def _fill_weighted_residuals(rows, block, line, step_height, intervals, image, model, out):  # type: ignore[no-untyped-def]
    """Fill in each pixel's station, its weighted residual and its squared weight.

    Args:
        rows: columns of the rows. block: ``RowBlock``. line: ``PixelGeometry``.
        step_height: 1 to subtract a blurred step from the image, else 0.
        intervals: between the stations of a gridline and its ends.
        image, model: (n,) the levels along the contrast.
        out: three columns, filled.
    """
    zero, one, band = np.float32(0.0), np.float32(1.0), np.float32(BAND * BAND)
    leave, arrive, lanes = line.leave, line.arrive, padded_count(block.row_count)
    for j in range(block.row_length):
        own, drawn = image[j * lanes :], model[j * lanes :]
        weighted, step = out[j * lanes :], np.float32(j)
        for i in range(lanes):
            t = (rows[ALONG + i] + step * line.along_step) * line.inverse_length
            s = one - t
            bow = line.length * (t * s * (leave * s - arrive * t))
            z = (rows[ACROSS + i] + step * line.across_step - bow) * line.inverse_sigma
            zz = z * z
            within = (step <= rows[TO + i]) & (zz < band)
            g = C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5))))
            g = g if within else zero
            half = HALF - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))))
            half = half if within else zero  # beyond the band the polynomial does not hold
            weighted[STATION + i] = np.floor(t * intervals - HALF)
            weighted[WEIGHTED_RESIDUAL + i] = g * (own[i] - drawn[i] - step_height * half)
            weighted[SQUARED_WEIGHT + i] = g * g


@vectorized
def _sums_at_station(weighted, count, station):  # type: ignore[no-untyped-def]
    """The sums of the weighted residuals and of the squared weights of the pixels at a station."""
    zero = np.float32(0.0)
    residual, weight = zero, zero
    for k in range(count):
        here = weighted[STATION + k] == station
        residual += weighted[WEIGHTED_RESIDUAL + k] if here else zero
        weight += weighted[SQUARED_WEIGHT + k] if here else zero
    return residual, weight


@compiled
def measure_offsets(image, model, reading, count):  # type: ignore[no-untyped-def]
    """The offsets of the gridlines around their virtual markers.

    Args:
        image: (H, W, 3) uint8.
        model: (H, W, 3) float32, the drawn pattern over black; not used where nothing was drawn.
        reading: ``GridlineReading``.
        count: m, the virtual markers of a gridline.

    Returns:
        (E, m, 2): px, the offset towards (-uy, ux) less that of dot gain; px^2, its variance. NaN where the gridline
        has no contrast or little weight or leaves the image, or where another gridline is near what was not drawn.
    """
    lines, contrasts, sigma = reading.lines, reading.contrasts, reading.sigma
    out = np.full((lines.shape[0], count, 2), np.nan)
    flat, flat_model, width, height = image.reshape(-1), model.reshape(-1), image.shape[1], image.shape[0]
    first, rows = np.empty(CHUNK, np.int64), np.empty(4 * CHUNK, np.float32)
    levels, drawn, weighted = (
        np.zeros(CHUNK, np.float32),
        np.zeros(CHUNK, np.float32),
        np.empty(3 * CHUNK, np.float32),
    )
    buffers = OffsetBuffers(first, rows, levels, drawn, weighted, np.zeros((count, 2)))
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength == 0.0 or reading.weight[e] < MIN_OFFSET_WEIGHT:
            continue
        _fill_station_sums(flat, flat_model, width, height, reading, e, buffers)
        for j in range(count):
            if buffers.sums[j, 1] < MIN_WEIGHT_SUM or not (reading.drawn or _is_clear(reading, e, j, count)):
                continue
            out[e, j, OFFSET] = sigma * buffers.sums[j, 0] / buffers.sums[j, 1] - reading.dot_gain_offset[e]
            out[e, j, VARIANCE] = reading.noise**2 * sigma**2 / (strength * buffers.sums[j, 1])
    return out


@inlined_no_refcount
def _is_clear(reading, e, station, count):  # type: ignore[no-untyped-def]
    """Whether the gridlines at both ends of gridline e keep clear of one of its stations."""
    from_start, from_end = (station + 0.5) / (count + 1.0), (count - station - 0.5) / (count + 1.0)
    start, end = from_start * reading.clearance[e, SINE_A], from_end * reading.clearance[e, SINE_B]
    return not reading.lines[e, LENGTH] * min(start, end) < CLEAR_SIGMA * reading.sigma


@inlined
def _fill_station_sums(flat, flat_model, width, height, reading, e, buffers):  # type: ignore[no-untyped-def]
    """Fill in the sums (m, 2) at the stations of gridline e; image and model are flat."""
    contrasts, sigma, sums = reading.contrasts, reading.sigma, buffers.sums
    rows, levels, drawn, weighted = buffers.rows, buffers.image, buffers.model, buffers.weighted
    strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
    color = Color(
        np.float32(contrasts[e, 0] / strength),
        np.float32(contrasts[e, 1] / strength),
        np.float32(contrasts[e, 2] / strength),
    )
    frame = row_frame(reading.lines, e, 0, 0, width, height)
    line, reach, intervals = pixel_geometry(frame, sigma), BAND * sigma, sums.shape[0] + 1.0
    step_height = np.float32(0.0 if reading.drawn else 1.0)
    # the pixels of the first and of the last station reach half an interval beyond these
    from_p = frame.p + (0.5 / intervals) * frame.length * frame.up
    to_p = frame.p + (1.0 - 0.5 / intervals) * frame.length * frame.up
    slack, half = reach * abs(frame.uq), reach / abs(frame.up)
    begin = max(int(np.ceil(min(from_p, to_p) - slack)), 0)
    last = min(int(np.floor(max(from_p, to_p) + slack)), frame.p_count - 1)
    wide, most = row_sizes(half, frame.q_count)
    sums[:] = 0.0
    for first in range(begin, last + 1, most):
        block = RowBlock(buffers.first, min(most, last + 1 - first), wide, frame.step_q)
        pixels = padded_count(block.row_count) * wide
        fill_rows(block, first, frame, half, rows)
        fill_projections(flat, block, color, np.float32(reading.foot[e]), levels)
        if reading.drawn:
            fill_projections(flat_model, block, color, np.float32(0.0), drawn)
        _fill_weighted_residuals(
            rows, block, line, step_height, np.float32(intervals), levels, drawn, weighted
        )
        for j in range(sums.shape[0]):
            residual, weight = _sums_at_station(weighted, pixels, np.float32(j))
            sums[j, 0] += residual
            sums[j, 1] += weight


def measure_virtual_markers(
    image: NDArray[np.uint8], model: NDArray[np.float32], reading: GridlineReading, count: int, scale: int
) -> NDArray[np.float64]:
    """The virtual markers as the image shows them.

    Args:
        image: (H, W, 3), reduced by ``scale``.
        model: (H, W, 3), the drawn pattern over black.
        reading: of the same image.
        count: m, the virtual markers of a gridline.

    Returns:
        (E, m, 3): x and y, px at full scale, and the variance across the gridline, px^2; NaN where not measured.
    """
    if count == 0:
        return np.empty((len(reading.lines), 0, 3))
    offsets = measure_offsets(image, model, reading, count)
    return np.asarray(_virtual_markers(reading.lines, offsets, scale))


@compiled
def _virtual_markers(lines, offsets, scale):  # type: ignore[no-untyped-def]
    """(E, m, 3) x and y, px at full scale, and the variance across the gridline, px^2."""
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
