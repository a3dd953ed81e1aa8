"""The matched filter across the gridlines: rows of pixels are compared with a blurred step.

The weight of a pixel is the derivative of the step, so that the weighted sums give the offset of the gridline from its
expected place.

A row is a column of the image where the gridline runs along x rather than along y, else a row of the image; p counts
rows, q the pixels of a row. One gridline has few rows. Therefore the rows of many gridlines are handled side by side,
first pixel after first pixel, then the second ones; at last every gridline adds up its own rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.response import table_place
from extractor.numeric.compilation import compiled, inlined
from extractor.refine.synthesis.gridline_sides import BEFORE, BEYOND
from extractor.refine.synthesis.gridlines import KNOWN, LENGTH
from extractor.refine.synthesis.pixel_rows import row_frame
from extractor.refine.synthesis.pixel_weights import C0, C1, C2, C3, C4, C5, half_share
from extractor.refine.synthesis.residual_kernel import (
    AA,
    AB,
    AC,
    AD,
    BB,
    BC,
    BD,
    CC,
    CD,
    DD,
    MISFIT,
    PIXELS,
    SUMS,
    A,
    B,
    C,
    D,
)

REACH_SIGMA = 1.3  # in units of the blur, the reach of a row
CLEAR_SIGMA = 2.6  # in units of the blur, the least distance of the other gridline of a corner
MAX_REACH = 0.33  # of the cell's height, the reach of a row at most
POLYNOMIAL_RANGE = np.float32(2.6)  # in units of the blur, the range of the polynomials
ZERO, ONE, SMALLEST = np.float32(0.0), np.float32(1.0), np.float32(1e-9)
LANES = 8  # rows in one vector of the processor
MAX_ROWS = 240  # rows side by side; a power of 2 would put all columns on one cache line
COLUMN = MAX_ROWS + LANES
DOUBLE_SUMS = 5  # sums in float64, those that move the markers: AA, AB, BB, A, B
# columns of a row: px along and across the chord at its first pixel, and from one pixel to the next; the number of its
# last pixel, -1 for none; of its gridline length, 1 / length, slopes; of three channels the light before the gridline
# less that beyond, and the light beyond
ALONG, ACROSS, ALONG_STEP, ACROSS_STEP, LAST = (k * COLUMN for k in range(5))
SIZE, SHORT, AT_START, AT_END, CONTRAST = (k * COLUMN for k in range(5, 10))
FOOT, COLUMNS = 12 * COLUMN, 15 * COLUMN
FIRST, STEP, END = (k * COLUMN for k in range(3))  # places in the flat image: first pixel, step, last pixel
HEIGHT, SINE_A, SINE_B, SQUARED_CONTRAST = range(4)  # columns of a gridline's clearance


class RowPixels(NamedTuple):
    """One pixel of every row, columns of ``COLUMN``.

    Attributes:
        along: the place along the gridline, 0 to 1. density: the normal density at the pixel.
        residual, slope: three columns, the residual of the value, and the derivative of the value by the light.
        pull, information: the residual times the derivative by the share of the light before the gridline, and that
            derivative squared.
        place: three columns, int32, of the drawn light in the table of values.
    """

    along: NDArray[np.float32]
    density: NDArray[np.float32]
    residual: NDArray[np.float32]
    slope: NDArray[np.float32]
    pull: NDArray[np.float32]
    information: NDArray[np.float32]
    place: NDArray[np.int32]


class FilterBuffers(NamedTuple):
    """Memory for rows side by side.

    Attributes:
        place: three columns of the rows, places in the flat image. rows: fifteen columns of the rows.
        pixels: one pixel of every row.
        double_sums: (5, n) float64, flat. sums: (24, n) float32, flat.
        owner: (n,) the gridlines. begin: (n + 1,) their first rows.
    """

    place: NDArray[np.int64]
    rows: NDArray[np.float32]
    pixels: RowPixels
    double_sums: NDArray[np.float64]
    sums: NDArray[np.float32]
    owner: NDArray[np.int64]
    begin: NDArray[np.int64]


class GridlineRows(NamedTuple):
    """The rows of one gridline, from ``begin`` to ``end``.

    Attributes:
        most: px, the largest offset that is accepted.
    """

    begin: int
    end: int
    most: float


@inlined
def _fill_rows(first, every, count, frame, half, side, place, rows):  # type: ignore[no-untyped-def]
    """Fill in the rows p = first, first + every ... of a gridline.

    A row has the pixels up to ``half`` px off the gridline, none where these leave the image. ``side`` (6,) is the
    light on both sides. ``place`` and ``rows`` begin at the gridline's first row.
    """
    p0, q0, up, uq, length = frame.p, frame.q, frame.up, frame.uq, frame.length
    leave, arrive, sense = frame.leave, frame.arrive, frame.sense
    lean, per_length, bulge = uq / up, 1.0 / (up * length), sense * length / up
    for i in range((count + LANES - 1) // LANES * LANES):
        p = first + i * every
        f = p - p0
        t = f * per_length
        inside = min(max(t, 0.0), 1.0)
        off = inside * (1.0 - inside) * (leave * (1.0 - inside) - arrive * inside)
        middle = q0 + lean * f + bulge * (off + leave * min(t, 0.0) + arrive * max(t - 1.0, 0.0))
        start, stop = np.ceil(middle - half), np.floor(middle + half)
        empty = (i >= count) | (start < 0.0) | (stop >= frame.q_count) | (stop < start)
        last = -1.0 if empty else stop - start
        g = start - q0
        rows[ALONG + i], rows[ALONG_STEP + i] = f * up + g * uq, uq
        rows[ACROSS + i], rows[ACROSS_STEP + i] = sense * (g * up - f * uq), sense * up
        rows[LAST + i] = last
        rows[SIZE + i], rows[SHORT + i] = length, 1.0 / length
        rows[AT_START + i], rows[AT_END + i] = leave, arrive
        for channel in range(3):
            rows[CONTRAST + channel * COLUMN + i] = side[BEFORE + channel] - side[BEYOND + channel]
            rows[FOOT + channel * COLUMN + i] = side[BEYOND + channel]
        at = np.int64(0) if empty else p * frame.step_p + np.int64(start) * frame.step_q
        place[FIRST + i], place[STEP + i] = at, frame.step_q
        place[END + i] = at + np.int64(max(last, 0.0)) * frame.step_q


@compiled
def _fill_densities(rows, step, count, inverse, pixels):  # type: ignore[no-untyped-def]
    """Fill in the place along the gridline, the density and the places in the table of values for one pixel of every
    row; ``inverse`` is 1 / blur."""
    density, along, place = pixels.density, pixels.along, pixels.place
    for i in range(count):
        keep = ONE if step <= rows[LAST + i] else ZERO
        t = (rows[ALONG + i] + step * rows[ALONG_STEP + i]) * rows[SHORT + i]
        s = ONE - t
        off = rows[SIZE + i] * (t * s * (rows[AT_START + i] * s - rows[AT_END + i] * t))
        z = (rows[ACROSS + i] + step * rows[ACROSS_STEP + i] - off) * inverse
        z = min(max(z, -POLYNOMIAL_RANGE), POLYNOMIAL_RANGE)
        zz = z * z
        along[i] = t
        density[i] = keep * (C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))))
        half = half_share(z)
        place[i] = table_place(rows[FOOT + i] + rows[CONTRAST + i] * half)
        place[COLUMN + i] = table_place(rows[FOOT + COLUMN + i] + rows[CONTRAST + COLUMN + i] * half)
        place[2 * COLUMN + i] = table_place(
            rows[FOOT + 2 * COLUMN + i] + rows[CONTRAST + 2 * COLUMN + i] * half
        )


@compiled
def _fill_residuals(flat, rows, step, count, encoded, buffers):  # type: ignore[no-untyped-def]
    """Fill in the residual along the contrast and the information of one pixel of every row."""
    place, pixels, one = buffers.place, buffers.pixels, np.uint64(1)
    residual, slope = pixels.residual, pixels.slope
    for i in range(count):
        k = np.uint64(min(place[FIRST + i] + step * place[STEP + i], place[END + i]))
        for channel in range(3):
            at, to = np.uint64(pixels.place[channel * COLUMN + i]), channel * COLUMN + i
            residual[to] = np.float32(flat[k + np.uint64(channel)]) - encoded[at]
            slope[to] = encoded[at + one]
    for i in range(count):
        d0, d1 = rows[CONTRAST + i] * slope[i], rows[CONTRAST + COLUMN + i] * slope[COLUMN + i]
        d2 = rows[CONTRAST + 2 * COLUMN + i] * slope[2 * COLUMN + i]
        pixels.pull[i] = d0 * residual[i] + d1 * residual[COLUMN + i] + d2 * residual[2 * COLUMN + i]
        pixels.information[i] = d0 * d0 + d1 * d1 + d2 * d2


@compiled
def _accumulate_row_sums(rows, step, count, pixels, double_sums, sums):  # type: ignore[no-untyped-def]
    """Add one pixel of every row to the row's sums, in units of the blur.

    In float64 the order of summing hardly changes the sums that move the markers.
    """
    for i in range(count):
        keep = ONE if step <= rows[LAST + i] else ZERO
        t, g, pull, own = pixels.along[i], pixels.density[i], pixels.pull[i], pixels.information[i]
        s = ONE - t
        sums[PIXELS * COLUMN + i] += keep
        sums[MISFIT * COLUMN + i] += keep * pull * pull / max(own, SMALLEST)
        a, b = g * s, g * t
        c = a * t
        d = c * (s - t)
        double_sums[A * COLUMN + i] += a * pull
        double_sums[B * COLUMN + i] += b * pull
        sums[C * COLUMN + i] += c * pull
        sums[D * COLUMN + i] += d * pull
        by_a, by_b, by_c, by_d = own * a, own * b, own * c, own * d
        double_sums[AA * COLUMN + i] += a * by_a
        double_sums[AB * COLUMN + i] += a * by_b
        double_sums[BB * COLUMN + i] += b * by_b
        sums[AC * COLUMN + i] += a * by_c
        sums[AD * COLUMN + i] += a * by_d
        sums[BC * COLUMN + i] += b * by_c
        sums[BD * COLUMN + i] += b * by_d
        sums[CC * COLUMN + i] += c * by_c
        sums[CD * COLUMN + i] += c * by_d
        sums[DD * COLUMN + i] += d * by_d


@inlined
def _fill_gridline_sums(double_sums, sums, own, sigma, out, e):  # type: ignore[no-untyped-def]
    """Write the sums over the rows of gridline e; False, and nothing written, where its offset exceeds ``own.most``."""
    zero = np.float64(0.0)
    aa, ab, bb, a, b, squares, pixels = zero, zero, zero, zero, zero, zero, zero
    for i in range(np.uint64(own.begin), np.uint64(own.end)):
        aa += double_sums[AA, i]
        ab += double_sums[AB, i]
        bb += double_sums[BB, i]
        a += double_sums[A, i]
        b += double_sums[B, i]
        squares += sums[MISFIT, i]
        pixels += sums[PIXELS, i]
    if not abs(a + b) * sigma < own.most * (aa + 2.0 * ab + bb):
        return False
    unit, per_unit = 1.0 / sigma, 1.0 / (sigma * sigma)
    out[e, AA], out[e, AB], out[e, BB] = per_unit * aa, per_unit * ab, per_unit * bb
    out[e, A], out[e, B] = unit * a, unit * b
    out[e, MISFIT], out[e, PIXELS] = squares, pixels
    return True


@inlined
def _fill_bending_sums(sums, own, sigma, out, e):  # type: ignore[no-untyped-def]
    """The same for the bending of gridline e."""
    zero = np.float64(0.0)
    ac, ad, bc, bd, cc, cd, dd, c, d = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for i in range(np.uint64(own.begin), np.uint64(own.end)):
        ac += sums[AC, i]
        ad += sums[AD, i]
        bc += sums[BC, i]
        bd += sums[BD, i]
        cc += sums[CC, i]
        cd += sums[CD, i]
        dd += sums[DD, i]
        c += sums[C, i]
        d += sums[D, i]
    unit, per_unit = 1.0 / sigma, 1.0 / (sigma * sigma)
    out[e, AC], out[e, AD], out[e, BC], out[e, BD] = (
        per_unit * ac,
        per_unit * ad,
        per_unit * bc,
        per_unit * bd,
    )
    out[e, CC], out[e, CD], out[e, DD] = per_unit * cc, per_unit * cd, per_unit * dd
    out[e, C], out[e, D] = unit * c, unit * d


@compiled
def _fill_filtered_sums(view, buffers, held, lines, sigma, is_bending, out):  # type: ignore[no-untyped-def]
    """Fill in the sums (E, 24) of the gridlines in the buffers, ``held`` of them."""
    owner, begin, rows = buffers.owner, buffers.begin, buffers.rows
    double_sums, sums = buffers.double_sums, buffers.sums
    count, wide = (begin[held] + LANES - 1) // LANES * LANES, 0
    for i in range(count):
        wide = max(wide, int(rows[LAST + i]) + 1)
    double_sums[:], sums[:], inverse = 0.0, ZERO, np.float32(1.0 / sigma)
    flat, encoded = view.image.reshape(-1), view.response.encoded
    for j in range(wide):
        _fill_densities(rows, np.float32(j), count, inverse, buffers.pixels)
        _fill_residuals(flat, rows, j, count, encoded, buffers)
        _accumulate_row_sums(rows, np.float32(j), count, buffers.pixels, double_sums, sums)
    doubles, others = double_sums.reshape(DOUBLE_SUMS, COLUMN), sums.reshape(SUMS, COLUMN)
    for i in range(held):
        e = np.uint64(owner[i])
        own = GridlineRows(begin[i], begin[i + 1], max(1.0, 0.15 * lines[e, LENGTH]))
        if _fill_gridline_sums(doubles, others, own, sigma, out, e) and is_bending[e]:
            _fill_bending_sums(others, own, sigma, out, e)


@compiled
def _filter_buffers():  # type: ignore[no-untyped-def]
    """Empty ``FilterBuffers``; lanes beyond the last row are read, too."""
    return FilterBuffers(
        np.zeros(3 * COLUMN, np.int64),
        np.zeros(COLUMNS, np.float32),
        RowPixels(
            np.zeros(COLUMN, np.float32),
            np.zeros(COLUMN, np.float32),
            np.zeros(3 * COLUMN, np.float32),
            np.zeros(3 * COLUMN, np.float32),
            np.zeros(COLUMN, np.float32),
            np.zeros(COLUMN, np.float32),
            np.zeros(3 * COLUMN, np.int32),
        ),
        np.empty(DOUBLE_SUMS * COLUMN),
        np.empty(SUMS * COLUMN, np.float32),
        np.empty(MAX_ROWS, np.int64),
        np.zeros(MAX_ROWS + 1, np.int64),
    )


@compiled
def read_profiles(view, lines, across, sigma, is_bending, most):  # type: ignore[no-untyped-def]
    """Sums over rows of pixels across each gridline.

    Args:
        view: ``PyramidLevel``.
        lines: (E, 8), as ``gridlines`` gives them.
        across: ``EdgeContrasts``.
        sigma: px, the blur.
        is_bending: (E,) bool, gridlines whose bending is read, too.
        most: rows across one gridline, at most.

    Returns:
        (E, 24) sums, with the columns and units of ``accumulate_residual_sums``; 0 where nothing was read.
    """
    sides, clearance = across.sides, across.clearance
    height, width = view.image.shape[0], view.image.shape[1]
    out, buffers, held = np.zeros((lines.shape[0], SUMS)), _filter_buffers(), 0
    begin, place, rows = buffers.begin, buffers.place, buffers.rows
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] == 0.0 or clearance[e, SQUARED_CONTRAST] == 0.0:
            continue
        frame = row_frame(lines, e, (0, 0, width, height), width)
        # the sharper a corner, the longer the gridline runs close to its neighbour
        start = min(max(CLEAR_SIGMA * sigma / (frame.length * clearance[e, SINE_A]), 0.1), 0.4)
        end = 1.0 - min(max(CLEAR_SIGMA * sigma / (frame.length * clearance[e, SINE_B]), 0.1), 0.4)
        from_p = frame.p + start * frame.length * frame.up
        to_p = frame.p + end * frame.length * frame.up
        first, last = int(np.ceil(min(from_p, to_p))), int(np.floor(max(from_p, to_p)))
        every = max((last - first) // most + 1, 1)
        first += ((last - first) % every) // 2
        first += max(every - 1 - first, 0) // every * every  # within the image
        count = min((min(last, frame.p_count - 1) - first) // every + 1, MAX_ROWS)
        if count <= 0:
            continue
        if begin[held] + count > MAX_ROWS:
            _fill_filtered_sums(view, buffers, held, lines, sigma, is_bending, out)
            held = 0
        half = min(REACH_SIGMA * sigma, MAX_REACH * clearance[e, HEIGHT]) / abs(frame.up)
        own_place, own_rows = place[begin[held] :], rows[begin[held] :]
        _fill_rows(first, every, count, frame, half, sides[e], own_place, own_rows)
        buffers.owner[held], begin[held + 1] = e, begin[held] + count
        held += 1
    _fill_filtered_sums(view, buffers, held, lines, sigma, is_bending, out)
    return out
