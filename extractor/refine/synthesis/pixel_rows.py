"""The pixels near a gridline, row by row across the gridline.

A row is a column of the image where the gridline runs along x rather than along y, else a row of the image. The
coordinate p counts rows, q the pixels of a row. All rows have the same number of pixels, and the number of rows is
rounded up to whole lanes: the loops over pixels have no branches. The band of each row marks the pixels that count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import inlined_no_refcount, vectorized_no_refcount
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


class Color(NamedTuple):
    """Three channels, float32."""

    red: np.float32
    green: np.float32
    blue: np.float32


@inlined_no_refcount
def row_frame(lines, e, x0, y0, width, height):  # type: ignore[no-untyped-def]
    """The ``RowFrame`` of gridline e in an image of ``width`` x ``height`` px that begins at (x0, y0)."""
    x, y, ux, uy = lines[e, X] - x0, lines[e, Y] - y0, lines[e, UX], lines[e, UY]
    along_x = abs(ux) > abs(uy)
    p, q, up, uq = (x, y, ux, uy) if along_x else (y, x, uy, ux)
    p_count, q_count = (width, height) if along_x else (height, width)
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
def fill_projections(flat, block, color, background, out):  # type: ignore[no-untyped-def]
    """Fill in the pixels' levels along a color, less a background.

    Args:
        flat: (H * W * 3,) the image.
        block: ``RowBlock``.
        color: ``Color`` to multiply the channels by.
        background: float32, in the unit of the product.
        out: (n,) float32, filled: pixel j of row i at j * padded rows + i.
    """
    c0, c1, c2, at = color.red, color.green, color.blue, block.first
    one, two = np.uint64(1), np.uint64(2)
    for j in range(block.row_length):
        own = out[j * padded_count(block.row_count) :]
        for i in range(block.row_count):
            k = np.uint64(at[i] + j * block.step)
            level = c0 * np.float32(flat[k]) + c1 * np.float32(flat[k + one]) + c2 * np.float32(flat[k + two])
            own[i] = level - background


@inlined_no_refcount
def fill_projections_and_squares(flat, block, color, background, out, squares):  # type: ignore[no-untyped-def]
    """The same where the background is a ``Color``; ``squares`` (n,) are the squared distances from that color."""
    c0, c1, c2, at = color.red, color.green, color.blue, block.first
    b0, b1, b2 = background.red, background.green, background.blue
    one, two = np.uint64(1), np.uint64(2)
    for j in range(block.row_length):
        own, square = out[j * padded_count(block.row_count) :], squares[j * padded_count(block.row_count) :]
        for i in range(block.row_count):
            k = np.uint64(at[i] + j * block.step)
            r0, r1, r2 = flat[k] - b0, flat[k + one] - b1, flat[k + two] - b2
            own[i] = c0 * r0 + c1 * r1 + c2 * r2
            square[i] = r0 * r0 + r1 * r1 + r2 * r2
