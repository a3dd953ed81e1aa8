"""Edge profiles: how far each gridline lies from where it is thought to be, at stations between its corners.

Fast, and sure from a start a pixel off; what the neighbourhood of the corners could tell is left unused.
"""

from __future__ import annotations

import numpy as np

from .engine import compiled, vectorized
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y, bow
from .levels import monomials
from .sampling import sample_dot
from .synthesis import (
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
    KEEP,
    MISFIT,
    PIXELS,
    SUMS,
    TO_A,
    TO_B,
    TO_C,
    TO_D,
    A,
    B,
    C,
    D,
)
from .walking import ALONG, ASIDE, CHUNK, FROM, TO, gather, lanes_of, lay_rows, row_sizes

BLUR_SAMPLES = 8  # on each side of a gridline
REACH_SIGMA = 1.3  # how far a profile reaches, in units of the blur
CLEAR_SIGMA = 2.6  # how far the other gridline of a corner must be for it not to show, in units of the blur
MAX_REACH = 0.33  # of the cell's height, how far a profile may reach at most
MIN_CONTRAST = 12.0
CLOSEST = (
    0.45  # of the way to the next gridline that a profile may reach for the blur; 0.41 in a regular cell
)
ENOUGH_BLURS = 12
# Wide blur mixes the neighbours' inks into the middles that the contrasts are taken from, and the profile looks steeper
# than it is: the blur it shows, and the true one, in units of the cell's height (rendered honeycombs).
SHOWN_BLUR = np.array([0.0, 0.092, 0.112, 0.128, 0.137, 0.149, 0.154])
TRUE_BLUR = np.array([0.000, 0.093, 0.117, 0.140, 0.160, 0.195, 0.225])
BILINEAR_PX2 = 1.0 / 6.0  # variance that bilinear sampling adds to the blur, on the average
CLIP = 0.3  # of the contrast, by which a pixel may lie beyond both colors
FAR = np.float32(2.6)  # in units of the blur, as far as the polynomials hold
HALF = np.float32(0.5)
I1, I2, I3, I4, I5 = (np.float32(c / (2 * k + 3)) for k, c in enumerate((C1, C2, C3, C4, C5)))
ROOM = 4  # columns: height of the lower cell beside it, sines of the angles at both ends, contrast squared


@compiled
def unmixing(lines, contrasts, xy, cells, edge_cells, levels, black, frame_x, frame_y, scale):  # type: ignore[no-untyped-def]
    """(E, 4) weights of the channels and offset that make a color 1 before and 0 beyond the gridline (along its
    normal), and (E, 4) the room beside it."""
    weights, room = np.zeros((lines.shape[0], 4)), np.zeros((lines.shape[0], ROOM))
    terms = np.empty(10)
    for e in range(lines.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        if lines[e, KNOWN] == 0.0 or strength < MIN_CONTRAST**2:
            continue
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0 = lines[e, X], lines[e, Y]
        monomials(
            (x0 + 0.5 * length * ux - frame_x) / scale, (y0 + 0.5 * length * uy - frame_y) / scale, terms
        )
        foot = 0.0
        for channel in range(3):
            weights[e, channel] = contrasts[e, channel] / strength
            for k in range(10):
                foot += weights[e, channel] * terms[k] * black[channel, k]
        height, at_a, at_b = length, 1.0, 1.0
        for k in range(2):
            i = edge_cells[e, k]
            if i < 0:
                continue
            off, along = 0.0, 0.0
            for corner in range(3):
                dx, dy = xy[cells[i, corner], 0] - x0, xy[cells[i, corner], 1] - y0
                if abs(dy * ux - dx * uy) > abs(off):
                    off, along = dy * ux - dx * uy, dx * ux + dy * uy
            if off > 0.0:  # the cell lies beyond the gridline: its level is the profile's foot
                for channel in range(3):
                    foot += weights[e, channel] * levels[i, channel]
            off = abs(off)
            height = min(height, off)
            if along > 0.0:
                at_a = min(at_a, off / np.sqrt(off * off + along * along))
            if along < length:
                at_b = min(at_b, off / np.sqrt(off * off + (length - along) ** 2))
        weights[e, 3] = foot
        room[e, 0], room[e, 1], room[e, 2], room[e, 3] = height, max(at_a, 0.05), max(at_b, 0.05), strength
    return weights, room


@compiled
def _roomy(lines, room):  # type: ignore[no-untyped-def]
    """Numbers of the gridlines with a contrast whose middles other gridlines keep away from; of all with a contrast,
    where these are few."""
    roomy, known = np.empty(lines.shape[0], np.int64), np.empty(lines.shape[0], np.int64)
    few, all_of_them = 0, 0
    for e in range(lines.shape[0]):
        if room[e, 3] == 0.0:
            continue
        sine = min(room[e, 1], room[e, 2])
        away = 0.4 * lines[e, LENGTH] * sine / np.sqrt(max(1.0 - sine * sine, 1e-9))
        if MAX_REACH * room[e, 0] < CLOSEST * away:
            roomy[few] = e
            few += 1
        known[all_of_them] = e
        all_of_them += 1
    return (roomy[:few], True) if few >= ENOUGH_BLURS else (known[:all_of_them], False)


@compiled
def profile_blur(image, lines, weights, room, most):  # type: ignore[no-untyped-def]
    """The blur (px, sigma) seen across the middle of ``most`` gridlines or fewer, their median; NaN where none is seen.

    The integral of f (1 - f) is sigma / sqrt(pi); bilinear samples add to it. So does another gridline near the
    profile: where too few gridlines have room around their middle, the least blurred quarter of all is taken.
    """
    which, roomy = _roomy(lines, room)
    every = max(which.shape[0] // most, 1)
    blurs, count = np.empty(which.shape[0] // every + 1), 0
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    for e in which[::every]:
        u0, u1, u2, zero = weights[e, 0], weights[e, 1], weights[e, 2], weights[e, 3]
        nx, ny, length = -lines[e, UY], lines[e, UX], lines[e, LENGTH]
        step = MAX_REACH * room[e, 0] / BLUR_SAMPLES
        total = 0.0
        for k in range(3):
            t = 0.4 + 0.1 * k
            off = bow(t, length, lines[e, LEAVE], lines[e, ARRIVE])
            x = lines[e, X] + t * length * lines[e, UX] + off * nx
            y = lines[e, Y] + t * length * lines[e, UY] + off * ny
            for m in range(-BLUR_SAMPLES, BLUR_SAMPLES + 1):
                f = sample_dot(flat, height, width, x + m * step * nx, y + m * step * ny, u0, u1, u2) - zero
                total += f * (1.0 - f) * step / 3.0
        if np.isfinite(total):
            shown = total * np.sqrt(np.pi)
            size = np.sqrt(0.5 * 3**0.5 * length * room[e, 0])  # the height of a regular cell of this area
            share = np.sqrt(max(shown * abs(shown) - BILINEAR_PX2, 0.0)) / size
            blurs[count] = size * np.interp(share, SHOWN_BLUR, TRUE_BLUR)
            count += 1
    if count == 0:
        return np.nan
    return np.median(blurs[:count]) if roomy else np.partition(blurs[:count], count // 4)[count // 4]


@compiled
def _weigh(rows, lanes, wide, du, dv, inverse, short, length, leave, arrive, rest, weights):  # type: ignore[no-untyped-def]
    """Fill in the weights of all pixels of the rows across a gridline, 0 beyond the band, and in the place of what they
    show, 1 before and 0 beyond the gridline, what is left of it beyond the blurred step."""
    zero, one, clip = np.float32(0.0), np.float32(1.0), np.float32(CLIP)
    for j in range(wide):
        out, left, step = weights[j * lanes :], rest[j * lanes :], np.float32(j)
        for i in range(lanes):
            keep = one if (step >= rows[FROM + i]) & (step <= rows[TO + i]) else zero
            t = (rows[ALONG + i] + step * du) * short
            s = one - t
            z = (rows[ASIDE + i] + step * dv - length * (t * s * (leave * s - arrive * t))) * inverse
            z = min(max(z, -FAR), FAR)
            zz = z * z
            g = keep * (C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))))
            half = HALF - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))))
            left[i] = keep * (min(max(left[i], -clip), one + clip) - half)
            out[KEEP + i], out[TO_A + i], out[TO_B + i] = keep, g * s, g * t
            out[TO_C + i], out[TO_D + i] = g * s * t, g * s * t * (s - t)


@vectorized
def _vote(rest, weights, count, sums):  # type: ignore[no-untyped-def]
    """Add ``count`` pixels to a gridline's sums, per unit of contrast and blur."""
    # what moves the markers is summed so that the order of summing hardly matters
    zero, fine = np.float32(0.0), np.float64(0.0)
    aa, ab, bb, a, b, squares, pixels = fine, fine, fine, fine, fine, zero, zero
    for k in range(count):
        ga, gb = weights[TO_A + k], weights[TO_B + k]
        aa += ga * ga
        ab += ga * gb
        bb += gb * gb
        a += ga * rest[k]
        b += gb * rest[k]
        squares += rest[k] * rest[k]
        pixels += weights[KEEP + k]
    sums[AA] += aa
    sums[AB] += ab
    sums[BB] += bb
    sums[A] += a
    sums[B] += b
    sums[MISFIT] += squares
    sums[PIXELS] += pixels


@vectorized
def _vote_bending(rest, weights, count, sums):  # type: ignore[no-untyped-def]
    """The same for a gridline's bending."""
    zero = np.float32(0.0)
    ac, ad, bc, bd, cc, cd, dd, c, d = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for k in range(count):
        ga, gb, gc, gd = weights[TO_A + k], weights[TO_B + k], weights[TO_C + k], weights[TO_D + k]
        ac += ga * gc
        ad += ga * gd
        bc += gb * gc
        bd += gb * gd
        cc += gc * gc
        cd += gc * gd
        dd += gd * gd
        c += gc * rest[k]
        d += gd * rest[k]
    sums[AC] += ac
    sums[AD] += ad
    sums[BC] += bc
    sums[BD] += bd
    sums[CC] += cc
    sums[CD] += cd
    sums[DD] += dd
    sums[C] += c
    sums[D] += d


@compiled
def read_profiles(image, lines, weights, room, sigma, loose, most):  # type: ignore[no-untyped-def]
    """(E, 24) sums as ``read_gridlines`` gives them, from at most ``most`` rows of pixels across each gridline; C and D
    where it is ``loose`` (E,) bool.

    The pixels are held against a blurred step, each weighed by the step's derivative: the matched filter, which tells
    how far the gridline lies from where it is thought to be, with all that these pixels know.
    """
    out = np.zeros((lines.shape[0], SUMS))
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    at, rows, by = np.empty(CHUNK, np.int64), np.empty(4 * CHUNK, np.float32), np.empty(6 * CHUNK, np.float32)
    rest, inverse = np.zeros(CHUNK, np.float32), 1.0 / sigma
    for e in range(lines.shape[0]):
        strength = room[e, 3]
        if lines[e, KNOWN] == 0.0 or strength == 0.0:
            continue
        x0, y0, ux, uy, length = lines[e, X], lines[e, Y], lines[e, UX], lines[e, UY], lines[e, LENGTH]
        leave, arrive = lines[e, LEAVE], lines[e, ARRIVE]
        # the sharper a corner, the longer the gridline runs close to its neighbour
        start = min(max(CLEAR_SIGMA * sigma / (length * room[e, 1]), 0.1), 0.4)
        end = 1.0 - min(max(CLEAR_SIGMA * sigma / (length * room[e, 2]), 0.1), 0.4)
        # columns of pixels are walked through where it runs along x rather than along y, else rows
        along_x = abs(ux) > abs(uy)
        p0, q0, up, uq = (x0, y0, ux, uy) if along_x else (y0, x0, uy, ux)
        p_end, q_end, step_p, step_q = (
            (width, height, 3, 3 * width) if along_x else (height, width, 3 * width, 3)
        )
        from_p, to_p = p0 + start * length * up, p0 + end * length * up
        first, last = int(np.ceil(min(from_p, to_p))), int(np.floor(max(from_p, to_p)))
        every = max((last - first) // most + 1, 1)
        first += ((last - first) % every) // 2
        first += max(every - 1 - first, 0) // every * every  # within the image
        half = min(REACH_SIGMA * sigma, MAX_REACH * room[e, 0]) / abs(up)
        wide, at_once = row_sizes(half, q_end)
        count = min(max((min(last, p_end - 1) - first) // every + 1, 0), at_once)
        lanes, sums = lanes_of(count), out[e]
        line, band = (p0, q0, up, uq, length, leave, arrive, half), (0, q_end - 1, wide, step_p, step_q, True)
        lay_rows(first, every, count, *line, *band, at, rows)
        color = np.float32(weights[e, 0]), np.float32(weights[e, 1]), np.float32(weights[e, 2])
        gather(flat, at, count, wide, step_q, color, np.float32(weights[e, 3]), rest)
        steps = (
            np.float32(uq),
            np.float32(up if along_x else -up),
            np.float32(inverse),
            np.float32(1.0 / length),
        )
        _weigh(rows, lanes, wide, *steps, np.float32(length), np.float32(leave), np.float32(arrive), rest, by)
        _vote(rest, by, lanes * wide, sums)
        if loose[e]:
            _vote_bending(rest, by, lanes * wide, sums)
        # a gridline that would have to move too far is none
        votes, weight = sums[A] + sums[B], sums[AA] + 2 * sums[AB] + sums[BB]
        if not abs(votes) * sigma < max(1.0, 0.15 * length) * weight:
            sums[:] = 0.0
            continue
        for k in (AA, AB, BB, AC, AD, BC, BD, CC, CD, DD):
            sums[k] *= strength * inverse * inverse
        for k in (A, B, C, D):
            sums[k] *= strength * inverse
        sums[MISFIT] *= strength
    return out
