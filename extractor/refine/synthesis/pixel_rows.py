"""The pixels near a gridline, row by row across it.

A row is a column of the image where the gridline runs along x rather than along y, else a row of it; p counts rows, q
the pixels of a row. Of every row the same number of pixels is taken, and rows are filled up to whole lanes, so that the
loops over pixels have no branches; pixels too many are told by where a row's band begins and ends.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import inlined_no_refcount, vectorized_no_refcount

CHUNK = 2128  # pixels of one gridline at once, at most; no power of 2, which would lay all columns on one cache line
LANES = 16  # rows are handled so many at once
# what is known of a row, all at its first pixel: place along and aside of the chord (px), first and last pixel within
# the band
ALONG, ASIDE, FROM, TO = (k * CHUNK for k in range(4))


@inlined_no_refcount
def row_sizes(half, most):  # type: ignore[no-untyped-def]
    """How many pixels of a row may lie within its band, ``half`` to both sides, ``max_partial_share_in_dirt`` at
    most; and how many rows of
    them fit into a chunk."""
    wide = max(min(int(2.0 * half) + 1, most, CHUNK // LANES), 1)
    return wide, CHUNK // (wide * LANES) * LANES


@inlined_no_refcount
def padded_count(count):  # type: ignore[no-untyped-def]
    """So many rows, filled up to whole lanes."""
    return (count + LANES - 1) // LANES * LANES


@vectorized_no_refcount
def fill_rows(  # type: ignore[no-untyped-def]
    first,
    every,
    count,
    p0,
    q0,
    up,
    uq,
    length,
    leave,
    arrive,
    half,
    low,
    high,
    wide,
    step_p,
    step_q,
    at,
    rows,
):
    """Fill in where the rows p = first, first + every ... begin in the flat image, and what is known of them.

    Each has ``wide`` pixels between ``low`` and ``high`` in q, the band those up to ``half`` off the gridline.
    ``step_p`` and ``step_q`` lead through the flat image.
    """
    sense = 1.0 if step_q > step_p else -1.0
    lean, per_length, bulge, top = uq / up, 1.0 / (up * length), sense * length / up, high + 1.0 - wide
    for i in range(padded_count(count)):
        p = first + i * every
        f = p - p0
        t = f * per_length
        inside = min(max(t, 0.0), 1.0)
        off = inside * (1.0 - inside) * (leave * (1.0 - inside) - arrive * inside)
        middle = q0 + lean * f + bulge * (off + leave * min(t, 0.0) + arrive * max(t - 1.0, 0.0))
        start, stop = np.ceil(middle - half), np.floor(middle + half)
        base = min(max(start, low), top)
        at[i] = p * step_p + np.int64(base) * step_q
        g = base - q0
        rows[ALONG + i] = f * up + g * uq
        rows[ASIDE + i] = sense * (g * up - f * uq)
        rows[FROM + i] = start - base
        rows[TO + i] = -1.0 if i >= count else stop - base


@inlined_no_refcount
def fill_projections(flat, at, count, wide, step, color, beneath, rest):  # type: ignore[no-untyped-def]
    """Fill in what the pixels of ``count`` rows show along ``color``, less ``beneath``."""
    c0, c1, c2 = color
    one, two = np.uint64(1), np.uint64(2)
    for j in range(wide):
        own = rest[j * padded_count(count) :]
        for i in range(count):
            k = np.uint64(at[i] + j * step)
            shown = c0 * np.float32(flat[k]) + c1 * np.float32(flat[k + one]) + c2 * np.float32(flat[k + two])
            own[i] = shown - beneath


@inlined_no_refcount
def fill_projections_and_squares(flat, at, count, wide, step, color, beneath, rest, squares):  # type: ignore[no-untyped-def]
    """The same where a color lies ``beneath``, and the squared distances from that color."""
    c0, c1, c2 = color
    b0, b1, b2 = beneath
    one, two = np.uint64(1), np.uint64(2)
    for j in range(wide):
        own, square = rest[j * padded_count(count) :], squares[j * padded_count(count) :]
        for i in range(count):
            k = np.uint64(at[i] + j * step)
            r0, r1, r2 = flat[k] - b0, flat[k + one] - b1, flat[k + two] - b2
            own[i] = c0 * r0 + c1 * r1 + c2 * r2
            square[i] = r0 * r0 + r1 * r1 + r2 * r2
