"""The pixels near a gridline, row by row across the gridline.

A row is a column of the image where the gridline runs along x rather than along y, else a row of the image. The
coordinate p counts rows, q the pixels of a row. All rows have the same number of pixels, and the number of rows is
rounded up to whole lanes: the loops over pixels have no branches. The band of each row marks the pixels that count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.response import table_place
from extractor.numeric.compilation import compiled, inlined_no_refcount, vectorized_no_refcount
from extractor.refine.synthesis.gridlines import ARRIVE, LEAVE, LENGTH, UX, UY, X, Y

CHUNK = 2128  # pixels of one gridline at once, at most; a power of 2 would put all columns on one cache line
LANES = 16  # rows in one vector of the processor
# columns of a row, all at its first pixel: px along and across the chord, first and last pixel within the band
ALONG, ACROSS, FROM, TO = (k * CHUNK for k in range(4))


class RowFrame(NamedTuple):
    """A gridline in the coordinates of the rows across the gridline.

    Attributes:
        p, q: px, the start of the gridline.
        up, uq: the unit vector along the chord.
        length: px, of the chord. leave, arrive: slopes against the chord at both ends.
        p_count, q_count: numbers of rows, and of pixels of a row, in the image.
        step_p, step_q: values of the flat image between two rows, and between two pixels of a row.
        sense: 1 where rows are columns of the image, -1 where rows are rows of the image.
    """

    p: float
    q: float
    up: float
    uq: float
    length: float
    leave: float
    arrive: float
    p_count: int
    q_count: int
    step_p: int
    step_q: int
    sense: float


class RowBlock(NamedTuple):
    """Some rows of one gridline.

    Attributes:
        first: (n,) int64, the places of the rows' first pixels in the flat image.
        row_count: rows.
        row_length: pixels of each row.
        step: values of the flat image between two pixels of a row.
    """

    first: NDArray[np.int64]
    row_count: int
    row_length: int
    step: int


class PixelGeometry(NamedTuple):
    """What a pixel's distance from a gridline is computed from, in float32.

    Attributes:
        along_step, across_step: px, from one pixel of a row to the next, along and across the chord.
        inverse_sigma: 1/px, of the blur. inverse_length: 1/px, of the chord.
        length: px. leave, arrive: slopes against the chord at both ends.
    """

    along_step: np.float32
    across_step: np.float32
    inverse_sigma: np.float32
    inverse_length: np.float32
    length: np.float32
    leave: np.float32
    arrive: np.float32


class SideLight(NamedTuple):
    """The light along a gridline, three channels each, float32.

    Attributes:
        contrast0, contrast1, contrast2: of the drawn light, before the gridline less beyond.
        step0, step1, step2: of the light that is added to the drawing, likewise.
        beyond0, beyond1, beyond2: of the light that is added, beyond the gridline.
    """

    contrast0: np.float32
    contrast1: np.float32
    contrast2: np.float32
    step0: np.float32
    step1: np.float32
    step2: np.float32
    beyond0: np.float32
    beyond1: np.float32
    beyond2: np.float32


class Residuals(NamedTuple):
    """The residuals of pixels: the image's values less the values of the drawn light.

    Attributes:
        projection: (n,) float32, the residuals of the channels times their derivatives by the share of the light before
            the gridline, summed.
        information: (n,) float32, these derivatives squared, summed.
        square: (n,) float32, the residuals squared, summed.
        bleed_projection, bleed_cross, bleed_square: (n,) float32, the residuals times the derivatives by the bleed,
            these times the derivatives by the share, and these squared, each summed.
        light, value, slope: (3 n,) float32, by channel: the drawn light, then the residual; its value; the derivative
            of the value by the light.
        place: (3 n,) int32, the places of the light in the table of values.
    """

    projection: NDArray[np.float32]
    information: NDArray[np.float32]
    square: NDArray[np.float32]
    bleed_projection: NDArray[np.float32]
    bleed_cross: NDArray[np.float32]
    bleed_square: NDArray[np.float32]
    light: NDArray[np.float32]
    value: NDArray[np.float32]
    slope: NDArray[np.float32]
    place: NDArray[np.int32]


@compiled
def allocate_residuals():  # type: ignore[no-untyped-def]
    """``Residuals`` of ``CHUNK`` pixels, zeros."""
    return Residuals(
        np.zeros(CHUNK, np.float32),
        np.zeros(CHUNK, np.float32),
        np.zeros(CHUNK, np.float32),
        np.zeros(CHUNK, np.float32),
        np.zeros(CHUNK, np.float32),
        np.zeros(CHUNK, np.float32),
        np.zeros(3 * CHUNK, np.float32),
        np.zeros(3 * CHUNK, np.float32),
        np.zeros(3 * CHUNK, np.float32),
        np.zeros(3 * CHUNK, np.int32),
    )


@inlined_no_refcount
def row_frame(lines, e, area, width):  # type: ignore[no-untyped-def]
    """The ``RowFrame`` of gridline e in an area (x from, y from, x to, y to; px) of an image ``width`` px wide."""
    x, y, ux, uy = lines[e, X] - area[0], lines[e, Y] - area[1], lines[e, UX], lines[e, UY]
    along_x = abs(ux) > abs(uy)
    p, q, up, uq = (x, y, ux, uy) if along_x else (y, x, uy, ux)
    columns, rows = area[2] - area[0], area[3] - area[1]
    p_count, q_count = (columns, rows) if along_x else (rows, columns)
    step_p, step_q = (3, 3 * width) if along_x else (3 * width, 3)
    length, leave, arrive = lines[e, LENGTH], lines[e, LEAVE], lines[e, ARRIVE]
    sense = 1.0 if along_x else -1.0
    return RowFrame(p, q, up, uq, length, leave, arrive, p_count, q_count, step_p, step_q, sense)


@inlined_no_refcount
def pixel_geometry(frame, sigma):  # type: ignore[no-untyped-def]
    """The ``PixelGeometry`` of a gridline; ``sigma`` is the blur, px."""
    return PixelGeometry(
        np.float32(frame.uq),
        np.float32(frame.sense * frame.up),
        np.float32(1.0 / sigma),
        np.float32(1.0 / frame.length),
        np.float32(frame.length),
        np.float32(frame.leave),
        np.float32(frame.arrive),
    )


@inlined_no_refcount
def row_sizes(half, most):  # type: ignore[no-untyped-def]
    """The number of pixels of a row, and of rows in one chunk.

    Args:
        half: px, the band reaches as far to both sides.
        most: pixels of a row in the image.
    """
    wide = max(min(int(2.0 * half) + 1, most, CHUNK // LANES), 1)
    return wide, CHUNK // (wide * LANES) * LANES


@inlined_no_refcount
def padded_count(count):  # type: ignore[no-untyped-def]
    """The number of rows, rounded up to whole lanes."""
    return (count + LANES - 1) // LANES * LANES


@vectorized_no_refcount
def fill_rows(block, first, frame, half, rows):  # type: ignore[no-untyped-def]
    """Fill in the first pixels and the columns of the rows of a block.

    Args:
        block: ``RowBlock``; ``block.first`` is filled.
        first: p of the first row.
        frame: ``RowFrame``.
        half: px, the band of a row reaches as far to both sides of the gridline.
        rows: (4 * CHUNK,) float32, filled.
    """
    p0, q0, up, uq, at = frame.p, frame.q, frame.up, frame.uq, block.first
    leave, arrive, sense, length = frame.leave, frame.arrive, frame.sense, frame.length
    lean, per_length, bulge = uq / up, 1.0 / (up * length), sense * length / up
    top, step_p, step_q, count = (
        frame.q_count - 1 + 1.0 - block.row_length,
        frame.step_p,
        frame.step_q,
        block.row_count,
    )
    for i in range(padded_count(count)):
        p = first + i
        f = p - p0
        t = f * per_length
        inside = min(max(t, 0.0), 1.0)
        off = inside * (1.0 - inside) * (leave * (1.0 - inside) - arrive * inside)
        middle = q0 + lean * f + bulge * (off + leave * min(t, 0.0) + arrive * max(t - 1.0, 0.0))
        start, stop = np.ceil(middle - half), np.floor(middle + half)
        base = min(max(start, 0), top)
        at[i] = p * step_p + np.int64(base) * step_q
        g = base - q0
        rows[ALONG + i] = f * up + g * uq
        rows[ACROSS + i] = sense * (g * up - f * uq)
        rows[FROM + i] = start - base
        rows[TO + i] = -1.0 if i >= count else stop - base


@inlined_no_refcount
def side_light(sides, added, e):  # type: ignore[no-untyped-def]
    """The ``SideLight`` of gridline e; ``sides`` and ``added`` (E, 6) are the drawn light and that to add on both
    sides."""
    f = np.float32
    return SideLight(
        f(sides[e, 0] - sides[e, 3]),
        f(sides[e, 1] - sides[e, 4]),
        f(sides[e, 2] - sides[e, 5]),
        f(added[e, 0] - added[e, 3]),
        f(added[e, 1] - added[e, 4]),
        f(added[e, 2] - added[e, 5]),
        f(added[e, 3]),
        f(added[e, 4]),
        f(added[e, 5]),
    )


@inlined_no_refcount
def fill_residuals(image, model, encoded, block, light, shares, out):  # type: ignore[no-untyped-def]
    """Fill in the ``Residuals`` of the pixels of a block: pixel j of row i at j * padded rows + i.

    Args:
        image: (n,) uint8, flat. model: (n,) float32, flat, the drawn light; empty for none.
        encoded: as in ``ResponseTables``.
        block: ``RowBlock``.
        light: ``SideLight``.
        shares: (n,) the share of the light before the gridline in each pixel.
        out: ``Residuals``, filled.
    """
    count = padded_count(block.row_count) * block.row_length
    if model.shape[0] > 0:
        _fill_channels(model, block, out.light)
    else:
        out.light[: 3 * CHUNK] = np.float32(0.0)
    _fill_places(light, shares, count, out)
    _fill_values(encoded, count, out)
    _fill_channels(image, block, out.light)
    _fill_projections(light, count, out)


@inlined_no_refcount
def _fill_channels(flat, block, out):  # type: ignore[no-untyped-def]
    """Fill in the three channels of the pixels of a flat image, in columns of ``CHUNK``."""
    at, lanes, one, two = block.first, padded_count(block.row_count), np.uint64(1), np.uint64(2)
    for j in range(block.row_length):
        own, step = out[j * lanes :], j * block.step
        for i in range(block.row_count):
            k = np.uint64(at[i] + step)
            own[i], own[CHUNK + i], own[2 * CHUNK + i] = flat[k], flat[k + one], flat[k + two]


@vectorized_no_refcount
def _fill_places(light, shares, count, out):  # type: ignore[no-untyped-def]
    """Fill in the places of the drawn light in the table of values."""
    drawn, place = out.light, out.place
    for k in range(count):
        h = shares[k]
        place[k] = table_place(drawn[k] + light.beyond0 + h * light.step0)
        place[CHUNK + k] = table_place(drawn[CHUNK + k] + light.beyond1 + h * light.step1)
        place[2 * CHUNK + k] = table_place(drawn[2 * CHUNK + k] + light.beyond2 + h * light.step2)


@inlined_no_refcount
def _fill_values(encoded, count, out):  # type: ignore[no-untyped-def]
    """Fill in the values and their derivatives at the places of the table."""
    for channel in range(3):
        place, value = out.place[channel * CHUNK :], out.value[channel * CHUNK :]
        slope = out.slope[channel * CHUNK :]
        for k in range(count):
            at = np.uint64(place[k])
            value[k], slope[k] = encoded[at], encoded[at + np.uint64(1)]


@vectorized_no_refcount
def _fill_projections(light, count, out):  # type: ignore[no-untyped-def]
    """Fill in the sums over the channels, from the image's channels in ``out.light``."""
    observed, value, slope = out.light, out.value, out.slope
    for k in range(count):
        r0, r1 = observed[k] - value[k], observed[CHUNK + k] - value[CHUNK + k]
        r2 = observed[2 * CHUNK + k] - value[2 * CHUNK + k]
        d0, d1 = light.contrast0 * slope[k], light.contrast1 * slope[CHUNK + k]
        d2 = light.contrast2 * slope[2 * CHUNK + k]
        out.projection[k] = d0 * r0 + d1 * r1 + d2 * r2
        out.information[k] = d0 * d0 + d1 * d1 + d2 * d2
        out.square[k] = r0 * r0 + r1 * r1 + r2 * r2


@vectorized_no_refcount
def fill_bleed(light, bleed, shares, count, out):  # type: ignore[no-untyped-def]
    """Fill in the bleed's columns of ``Residuals``, after ``fill_residuals``.

    Args:
        light: ``SideLight``. bleed: ``SideLight`` whose added light is the change of the levels by the blur.
        shares: (n,) the share of the light before the gridline in each pixel.
        count: pixels.
        out: ``Residuals``, filled.
    """
    observed, value, slope = out.light, out.value, out.slope
    for k in range(count):
        h, s0, s1, s2 = shares[k], slope[k], slope[CHUNK + k], slope[2 * CHUNK + k]
        b0, b1 = s0 * (bleed.beyond0 + h * bleed.step0), s1 * (bleed.beyond1 + h * bleed.step1)
        b2 = s2 * (bleed.beyond2 + h * bleed.step2)
        out.bleed_projection[k] = (
            b0 * (observed[k] - value[k])
            + b1 * (observed[CHUNK + k] - value[CHUNK + k])
            + b2 * (observed[2 * CHUNK + k] - value[2 * CHUNK + k])
        )
        out.bleed_cross[k] = b0 * s0 * light.contrast0 + b1 * s1 * light.contrast1 + b2 * s2 * light.contrast2
        out.bleed_square[k] = b0 * b0 + b1 * b1 + b2 * b2
