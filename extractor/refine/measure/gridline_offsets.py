"""Offsets of the gridlines at virtual markers, measured where refinement last compared the image with the pattern."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.numeric.compilation import compiled, inlined, inlined_no_refcount, vectorized
from extractor.refine.measure.gridline_weights import MIN_OFFSET_WEIGHT
from extractor.refine.measure.matched_filter import SINE_A, SINE_B
from extractor.refine.synthesis.gridline_sides import value_contrasts
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, sagitta
from extractor.refine.synthesis.pixel_rows import (
    ACROSS,
    ALONG,
    CHUNK,
    TO,
    Residuals,
    RowBlock,
    allocate_residuals,
    fill_residuals,
    fill_rows,
    padded_count,
    pixel_geometry,
    row_frame,
    row_sizes,
    side_light,
)
from extractor.refine.synthesis.pixel_weights import BAND, C0, C1, C2, C3, C4, C5, half_share

CLEAR_SIGMA = 2.0  # in units of the blur, the least distance of the next gridline where nothing was drawn
MIN_WEIGHT_SUM = (
    0.08  # of the squared weights of pixels at a virtual marker, in units of the squared contrast
)
OFFSET, VARIANCE = range(2)
NO_MODEL = np.empty((0, 0, 3), np.float32)
STATION, WEIGHT, BEFORE_SHARE = (k * CHUNK for k in range(3))  # columns of a pixel


class GridlineReading(NamedTuple):
    """The gridlines and the levels beside them, where refinement last compared the image with the pattern.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        sides: (E, 6), the light on both sides, as ``gridline_sides`` gives it.
        added: (E, 6), the light to add to the drawing on both sides; the sides themselves where nothing was drawn.
        clearance: (E, 4), as ``gridline_clearance`` gives it; used where nothing was drawn.
        weight: (E,) 0 to 1.
        variance_ratio: (E,), as ``variance_ratios`` gives it.
        dot_gain_offset: (E,) px, the shift of the gridline towards (-uy, ux) by dot gain.
        sigma: px, the blur.
        noise: gray levels.
        drawn: the pattern was drawn.
    """

    lines: NDArray[np.float64]
    sides: NDArray[np.float64]
    added: NDArray[np.float64]
    clearance: NDArray[np.float64]
    weight: NDArray[np.float64]
    variance_ratio: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]
    sigma: float
    noise: float
    drawn: bool


class OffsetBuffers(NamedTuple):
    """Memory for the pixels of one gridline and its stations.

    Attributes:
        first: (n,) int64, the first pixels of the rows. rows: their columns.
        residuals: of the pixels.
        weighted: three columns of the pixels.
        sums: (m, 2) the weighted residuals and the information at each station.
    """

    first: NDArray[np.int64]
    rows: NDArray[np.float32]
    residuals: Residuals
    weighted: NDArray[np.float32]
    sums: NDArray[np.float64]


@vectorized
def _fill_stations(rows, block, line, intervals, out):  # type: ignore[no-untyped-def]
    """Fill in each pixel's station, its weight, and the share of the light before the gridline.

    Args:
        rows: columns of the rows. block: ``RowBlock``. line: ``PixelGeometry``.
        intervals: between the stations of a gridline and its ends.
        out: three columns, filled.
    """
    zero, half, one, band = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(BAND * BAND)
    leave, arrive, lanes = line.leave, line.arrive, padded_count(block.row_count)
    for j in range(block.row_length):
        own, step = out[j * lanes :], np.float32(j)
        for i in range(lanes):
            t = (rows[ALONG + i] + step * line.along_step) * line.inverse_length
            s = one - t
            bow = line.length * (t * s * (leave * s - arrive * t))
            z = (rows[ACROSS + i] + step * line.across_step - bow) * line.inverse_sigma
            zz = z * z
            within = (step <= rows[TO + i]) & (zz < band)
            g = C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5))))
            own[STATION + i] = np.floor(t * intervals - half)
            own[WEIGHT + i] = g if within else zero
            own[BEFORE_SHARE + i] = half_share(z) if within else zero  # the polynomial holds within the band


@vectorized
def _sums_at_station(weighted, residuals, count, station):  # type: ignore[no-untyped-def]
    """The sums of the weighted residuals and of the information of the pixels at a station."""
    zero = np.float32(0.0)
    residual, information = zero, zero
    for k in range(count):
        g = weighted[WEIGHT + k] if weighted[STATION + k] == station else zero
        residual += g * residuals.projection[k]
        information += g * g * residuals.information[k]
    return residual, information


@compiled
def measure_offsets(view, model, reading, count):  # type: ignore[no-untyped-def]
    """The offsets of the gridlines around their virtual markers.

    Args:
        view: ``PyramidLevel``.
        model: (H, W, 3) float32, the light of the drawn pattern; empty where nothing was drawn.
        reading: ``GridlineReading``.
        count: m, the virtual markers of a gridline.

    Returns:
        (E, m, 2): px, the offset towards (-uy, ux) less that of dot gain; px^2, its variance. NaN where the gridline
        has no contrast or little weight or leaves the image, or where another gridline is near what was not drawn.
    """
    lines, sigma = reading.lines, reading.sigma
    contrasts = value_contrasts(reading.sides, view.response.encoded)
    out = np.full((lines.shape[0], count, 2), np.nan)
    first, rows = np.empty(CHUNK, np.int64), np.empty(4 * CHUNK, np.float32)
    residuals = allocate_residuals()
    buffers = OffsetBuffers(first, rows, residuals, np.empty(3 * CHUNK, np.float32), np.zeros((count, 2)))
    flat_model, image, encoded = model.reshape(-1), view.image.reshape(-1), view.response.encoded
    height, width = view.image.shape[0], view.image.shape[1]
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength == 0.0 or reading.weight[e] < MIN_OFFSET_WEIGHT:
            continue
        _fill_station_sums(image, encoded, flat_model, width, height, reading, e, buffers)
        for j in range(count):
            information = buffers.sums[j, 1]
            clear = reading.drawn or _is_clear(reading, e, j, count)
            if information < MIN_WEIGHT_SUM * strength or not clear:
                continue
            out[e, j, OFFSET] = sigma * buffers.sums[j, 0] / information - reading.dot_gain_offset[e]
            variance = reading.variance_ratio[e] * reading.noise**2
            out[e, j, VARIANCE] = variance * sigma**2 / information
    return out


@inlined_no_refcount
def _is_clear(reading, e, station, count):  # type: ignore[no-untyped-def]
    """Whether the gridlines at both ends of gridline e keep clear of one of its stations."""
    from_start, from_end = (station + 0.5) / (count + 1.0), (count - station - 0.5) / (count + 1.0)
    start, end = from_start * reading.clearance[e, SINE_A], from_end * reading.clearance[e, SINE_B]
    return not reading.lines[e, LENGTH] * min(start, end) < CLEAR_SIGMA * reading.sigma


@inlined
def _fill_station_sums(image, encoded, model, width, height, reading, e, buffers):  # type: ignore[no-untyped-def]
    """Fill in the sums (m, 2) at the stations of gridline e; image and model are flat."""
    sigma, sums, rows, weighted = reading.sigma, buffers.sums, buffers.rows, buffers.weighted
    light = side_light(reading.sides, reading.added, e)
    frame = row_frame(reading.lines, e, (0, 0, width, height), width)
    line, reach, intervals = pixel_geometry(frame, sigma), BAND * sigma, sums.shape[0] + 1.0
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
        _fill_stations(rows, block, line, np.float32(intervals), weighted)
        fill_residuals(image, model, encoded, block, light, weighted[BEFORE_SHARE:], buffers.residuals)
        for j in range(sums.shape[0]):
            residual, information = _sums_at_station(weighted, buffers.residuals, pixels, np.float32(j))
            sums[j, 0] += residual
            sums[j, 1] += information


def measure_virtual_markers(
    view: PyramidLevel, model: NDArray[np.float32], reading: GridlineReading, count: int
) -> NDArray[np.float64]:
    """The virtual markers as the image shows them.

    Args:
        view: the image.
        model: (H, W, 3), the light of the drawn pattern.
        reading: of the same image.
        count: m, the virtual markers of a gridline.

    Returns:
        (E, m, 3): x and y, px at full scale, and the variance across the gridline, px^2; NaN where not measured.
    """
    if count == 0:
        return np.empty((len(reading.lines), 0, 3))
    offsets = measure_offsets(view, model if reading.drawn else NO_MODEL, reading, count)
    return np.asarray(_virtual_markers(reading.lines, offsets, view.scale))


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
