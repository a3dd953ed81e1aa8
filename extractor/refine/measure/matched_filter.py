"""The matched filter across the gridlines: rows of pixels are held against a blurred step, each pixel weighed by the
step's derivative, which tells how far the gridline lies from where it is thought to be, with all that they know.

A row is a column of the image where the gridline runs along x rather than along y, else a row of it; p counts rows, q
the pixels of a row. A gridline has few of them. So the rows of many gridlines stand side by side, all their first
pixels are weighed at once, then their second ones; in the end every gridline adds up its own rows.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y
from extractor.refine.synthesis.residual_kernel import (
    AA,
    AB,
    AC,
    AD,
    BB,
    BC,
    BD,
    C0,
    C1,
    C2,
    C3,
    C4,
    C5,
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

REACH_SIGMA = 1.3  # how far a row reaches, in units of the blur
CLEAR_SIGMA = 2.6  # how far the other gridline of a corner must be for it not to show, in units of the blur
MAX_REACH = 0.33  # of the cell's height, how far a row may reach at most
CLIP = np.float32(0.3)  # of the contrast, by which a pixel may lie beyond both colors
POLYNOMIAL_RANGE = np.float32(2.6)  # in units of the blur, as far as the polynomials hold
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
I1, I2, I3, I4, I5 = (np.float32(c / (2 * k + 3)) for k, c in enumerate((C1, C2, C3, C4, C5)))
LANES = 8  # rows are laid so many at once
MAX_ROWS = 240  # rows side by side; no power of 2, which would lay all columns on one cache line
COLUMN = MAX_ROWS + LANES
DOUBLE_SUMS = 5  # of the sums move the markers: AA, AB, BB, A, B
# columns of a row: at its first pixel, place along and aside of the chord (px), and what each next one adds; the number
# of its last pixel, -1 without any; of its gridline length, slopes, weights of the channels, what these give beyond it
ALONG, ASIDE, ALONG_STEP, ASIDE_STEP, LAST = (k * COLUMN for k in range(5))
SIZE, SHORT, AT_START, AT_END, RED, GREEN, BLUE, FOOT, COLUMNS = (k * COLUMN for k in range(5, 14))
FIRST, STEP, END = (
    k * COLUMN for k in range(3)
)  # in the flat image: its first pixel, from one to the next, its last
HEIGHT, SINE_A, SINE_B, SQUARED_CONTRAST = range(4)  # columns of a gridline's room


@inlined
def _fill_rows(first, every, count, p0, q0, up, uq, length, leave, arrive, half, end, steps, color, at, rows):  # type: ignore[no-untyped-def]
    """Lay the rows p = first, first + every ... of a gridline, with the pixels up to ``half`` off it; with none where
    these do not all lie from 0 to ``end`` in q. ``steps`` in p and q lead through the flat image."""
    step_p, step_q = steps
    sense = 1.0 if step_q > step_p else -1.0
    lean, per_length, bulge = uq / up, 1.0 / (up * length), sense * length / up
    red, green, blue, foot = color
    for i in range((count + LANES - 1) // LANES * LANES):
        p = first + i * every
        f = p - p0
        t = f * per_length
        inside = min(max(t, 0.0), 1.0)
        off = inside * (1.0 - inside) * (leave * (1.0 - inside) - arrive * inside)
        middle = q0 + lean * f + bulge * (off + leave * min(t, 0.0) + arrive * max(t - 1.0, 0.0))
        start, stop = np.ceil(middle - half), np.floor(middle + half)
        empty = (i >= count) | (start < 0.0) | (stop >= end) | (stop < start)
        last = -1.0 if empty else stop - start
        g = start - q0
        rows[ALONG + i], rows[ALONG_STEP + i] = f * up + g * uq, uq
        rows[ASIDE + i], rows[ASIDE_STEP + i] = sense * (g * up - f * uq), sense * up
        rows[LAST + i] = last
        rows[SIZE + i], rows[SHORT + i] = length, 1.0 / length
        rows[AT_START + i], rows[AT_END + i] = leave, arrive
        rows[RED + i], rows[GREEN + i], rows[BLUE + i], rows[FOOT + i] = red, green, blue, foot
        place = np.int64(0) if empty else p * step_p + np.int64(start) * step_q
        at[FIRST + i], at[STEP + i] = place, step_q
        at[END + i] = place + np.int64(max(last, 0.0)) * step_q


@compiled
def _fill_profile_values(flat, at, rows, step, count, seen):  # type: ignore[no-untyped-def]
    """Fill in what a pixel of every row shows along its color: 1 before and 0 beyond the gridline."""
    one, two = np.uint64(1), np.uint64(2)
    for i in range(count):
        k = np.uint64(min(at[FIRST + i] + step * at[STEP + i], at[END + i]))
        red, green, blue = np.float32(flat[k]), np.float32(flat[k + one]), np.float32(flat[k + two])
        seen[i] = rows[RED + i] * red + rows[GREEN + i] * green + rows[BLUE + i] * blue - rows[FOOT + i]


@compiled
def _accumulate_row_sums(rows, step, count, inverse, seen, fine, sums):  # type: ignore[no-untyped-def]
    """Add a pixel of every row to its sums, per unit of contrast and blur: to ``fine`` ones what moves the markers, so
    that rounding hardly matters."""
    for i in range(count):
        keep = ONE if step <= rows[LAST + i] else ZERO
        t = (rows[ALONG + i] + step * rows[ALONG_STEP + i]) * rows[SHORT + i]
        s = ONE - t
        off = rows[SIZE + i] * (t * s * (rows[AT_START + i] * s - rows[AT_END + i] * t))
        z = (rows[ASIDE + i] + step * rows[ASIDE_STEP + i] - off) * inverse
        z = min(max(z, -POLYNOMIAL_RANGE), POLYNOMIAL_RANGE)
        zz = z * z
        g = keep * (C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))))
        half = HALF - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))))
        rest = keep * (min(max(seen[i], -CLIP), ONE + CLIP) - half)
        a, b = g * s, g * t
        c = a * t
        d = c * (s - t)
        sums[PIXELS * COLUMN + i] += keep
        sums[MISFIT * COLUMN + i] += rest * rest
        fine[A * COLUMN + i] += a * rest
        fine[B * COLUMN + i] += b * rest
        sums[C * COLUMN + i] += c * rest
        sums[D * COLUMN + i] += d * rest
        fine[AA * COLUMN + i] += a * a
        fine[AB * COLUMN + i] += a * b
        fine[BB * COLUMN + i] += b * b
        sums[AC * COLUMN + i] += a * c
        sums[AD * COLUMN + i] += a * d
        sums[BC * COLUMN + i] += b * c
        sums[BD * COLUMN + i] += b * d
        sums[CC * COLUMN + i] += c * c
        sums[CD * COLUMN + i] += c * d
        sums[DD * COLUMN + i] += d * d


@inlined
def _fill_gridline_sums(fine, sums, begin, end, most, strength, sigma, out, e):  # type: ignore[no-untyped-def]
    """Write the sums over the rows of a gridline, unless it would have to move by more than
    ``max_partial_share_in_dirt`` px: then it is
    none."""
    zero = np.float64(0.0)
    aa, ab, bb, a, b, squares, pixels = zero, zero, zero, zero, zero, zero, zero
    for i in range(np.uint64(begin), np.uint64(end)):
        aa += fine[AA, i]
        ab += fine[AB, i]
        bb += fine[BB, i]
        a += fine[A, i]
        b += fine[B, i]
        squares += sums[MISFIT, i]
        pixels += sums[PIXELS, i]
    if not abs(a + b) * sigma < most * (aa + 2.0 * ab + bb):
        return False
    unit, per_unit = strength / sigma, strength / (sigma * sigma)
    out[e, AA], out[e, AB], out[e, BB] = per_unit * aa, per_unit * ab, per_unit * bb
    out[e, A], out[e, B], out[e, MISFIT], out[e, PIXELS] = unit * a, unit * b, strength * squares, pixels
    return True


@inlined
def _fill_bending_sums(sums, begin, end, strength, sigma, out, e):  # type: ignore[no-untyped-def]
    """The same for its bending."""
    zero = np.float64(0.0)
    ac, ad, bc, bd, cc, cd, dd, c, d = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for i in range(np.uint64(begin), np.uint64(end)):
        ac += sums[AC, i]
        ad += sums[AD, i]
        bc += sums[BC, i]
        bd += sums[BD, i]
        cc += sums[CC, i]
        cd += sums[CD, i]
        dd += sums[DD, i]
        c += sums[C, i]
        d += sums[D, i]
    unit, per_unit = strength / sigma, strength / (sigma * sigma)
    out[e, AC], out[e, AD], out[e, BC], out[e, BD] = (
        per_unit * ac,
        per_unit * ad,
        per_unit * bc,
        per_unit * bd,
    )
    out[e, CC], out[e, CD], out[e, DD] = per_unit * cc, per_unit * cd, per_unit * dd
    out[e, C], out[e, D] = unit * c, unit * d


@compiled
def _fill_filtered_sums(flat, at, rows, held, owner, begin, lines, room, sigma, loose, seen, fine, sums, out):  # type: ignore[no-untyped-def]
    """Fill in the sums of the gridlines that are held: their numbers ``region_map``, and where their rows ``begin``."""
    count, wide = (begin[held] + LANES - 1) // LANES * LANES, 0
    for i in range(count):
        wide = max(wide, int(rows[LAST + i]) + 1)
    fine[:], sums[:], inverse = 0.0, ZERO, np.float32(1.0 / sigma)
    for j in range(wide):
        _fill_profile_values(flat, at, rows, j, count, seen)
        _accumulate_row_sums(rows, np.float32(j), count, inverse, seen, fine, sums)
    columns, others = fine.reshape(DOUBLE_SUMS, COLUMN), sums.reshape(SUMS, COLUMN)
    for i in range(held):
        e, rows_of = np.uint64(owner[i]), (begin[i], begin[i + 1])
        most, strength = max(1.0, 0.15 * lines[e, LENGTH]), room[e, SQUARED_CONTRAST]
        if _fill_gridline_sums(columns, others, *rows_of, most, strength, sigma, out, e) and loose[e]:
            _fill_bending_sums(others, *rows_of, strength, sigma, out, e)


@compiled
def read_profiles(image, lines, weights, room, sigma, loose, most):  # type: ignore[no-untyped-def]
    """(E, 24) sums as ``read_gridlines`` gives them, from at most ``max_partial_share_in_dirt`` rows of pixels
    across each gridline; C and D
    where it is ``bend_variance`` (E,) bool."""
    out = np.zeros((lines.shape[0], SUMS))
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    # lanes beyond the last row are looked at, too
    at, rows = np.zeros(3 * COLUMN, np.int64), np.zeros(COLUMNS, np.float32)
    seen = np.empty(COLUMN, np.float32)
    fine, sums = np.empty(DOUBLE_SUMS * COLUMN), np.empty(SUMS * COLUMN, np.float32)
    owner, begin, held = np.empty(MAX_ROWS, np.int64), np.zeros(MAX_ROWS + 1, np.int64), 0
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] == 0.0 or room[e, SQUARED_CONTRAST] == 0.0:
            continue
        x0, y0, ux, uy, length = lines[e, X], lines[e, Y], lines[e, UX], lines[e, UY], lines[e, LENGTH]
        # the sharper a corner, the longer the gridline runs close to its neighbour
        start = min(max(CLEAR_SIGMA * sigma / (length * room[e, SINE_A]), 0.1), 0.4)
        end = 1.0 - min(max(CLEAR_SIGMA * sigma / (length * room[e, SINE_B]), 0.1), 0.4)
        # columns of pixels are walked through where it runs along x rather than along y, else rows
        along_x = abs(ux) > abs(uy)
        p0, q0, up, uq = (x0, y0, ux, uy) if along_x else (y0, x0, uy, ux)
        p_end, q_end = (width, height) if along_x else (height, width)
        steps = (3, 3 * width) if along_x else (3 * width, 3)
        from_p, to_p = p0 + start * length * up, p0 + end * length * up
        first, last = int(np.ceil(min(from_p, to_p))), int(np.floor(max(from_p, to_p)))
        every = max((last - first) // most + 1, 1)
        first += ((last - first) % every) // 2
        first += max(every - 1 - first, 0) // every * every  # within the image
        count = min((min(last, p_end - 1) - first) // every + 1, MAX_ROWS)
        if count <= 0:
            continue
        if begin[held] + count > MAX_ROWS:
            _fill_filtered_sums(
                flat, at, rows, held, owner, begin, lines, room, sigma, loose, seen, fine, sums, out
            )
            held = 0
        half = min(REACH_SIGMA * sigma, MAX_REACH * room[e, HEIGHT]) / abs(up)
        line = p0, q0, up, uq, length, lines[e, LEAVE], lines[e, ARRIVE]
        color = weights[e, 0], weights[e, 1], weights[e, 2], weights[e, 3]
        _fill_rows(
            first, every, count, *line, half, q_end, steps, color, at[begin[held] :], rows[begin[held] :]
        )
        owner[held], begin[held + 1] = e, begin[held] + count
        held += 1
    _fill_filtered_sums(flat, at, rows, held, owner, begin, lines, room, sigma, loose, seen, fine, sums, out)
    return out
