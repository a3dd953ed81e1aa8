"""How much of each pixel is a cell: its share under a Gaussian (the optics' blur and the pixel's box in one).

The three sides of a cell are half planes, where two of them are near they form a wedge (``gaussian``); inclusion and
exclusion joins them:

    share = wedge01 + wedge12 + wedge20 - side0 - side1 - side2 + 1.

The pixels of a cell stand in arrays, with places from a pixel near its middle, so that float32 does, and all that needs
no table is done for many at once.
"""

from __future__ import annotations

import numpy as np

from .engine import compiled, lent
from .gaussian import REACH, normal, side_of_wedge
from .gridlines import ARRIVE, LEAVE, LENGTH, UX, UY, X, Y
from .walking import LANES, lanes_of

CHUNK = 2128  # pixels of one cell at once, at most
COLUMN = (
    CHUNK + LANES
)  # whole lanes are laid out; no power of 2, which would lay all columns on one cache line
NEAR = np.float32(REACH)
STEPS = np.arange(COLUMN, dtype=np.float32)
# columns of pixels: place; for each side the distance inside it, and how far along it they lie from its second and its
# first corner, along the curve's direction there
PX, PY = 0, COLUMN
D, TO_END, TO_START, OF_SIDE = 0, CHUNK, 2 * CHUNK, 3 * CHUNK
# where two sides are near, the first of them
NO_PAIR, ALL = -1, 3
# of a corner between two sides: distance inside the first and how far before its end, inside the second and how far
# after its start
BEFORE, TO_IT, AFTER, FROM_IT = (k * 3 * CHUNK for k in range(4))


@lent
def _side(lines, e, forward, sense, inverse, out):  # type: ignore[no-untyped-def]
    """A cell's side in units of the blur: d = out[0] + out[1] x + out[2] y inside, t from its first corner likewise.

    out: 0-2 distance, 3-5 place along, 6 length, 7 and 8 slopes at its first and second corner, positive inwards.
    """
    line = lines[e]
    ux, uy, length = line[UX], line[UY], line[LENGTH]
    nx, ny = -uy * sense * inverse, ux * sense * inverse
    out[0], out[1], out[2] = -(nx * line[X] + ny * line[Y]), nx, ny
    ux, uy = ux * inverse, uy * inverse
    along = -(ux * line[X] + uy * line[Y])
    out[6] = length * inverse
    if forward:
        out[3], out[4], out[5] = along, ux, uy
        out[7], out[8] = sense * line[LEAVE], sense * line[ARRIVE]
    else:
        out[3], out[4], out[5] = out[6] - along, -ux, -uy
        out[7], out[8] = -sense * line[ARRIVE], -sense * line[LEAVE]


@lent
def lay_sides(cell, cell_edges, edges, lines, turn, inverse, side):  # type: ignore[no-untyped-def]
    """Fill in a cell's three sides; how far they can lie off their chords."""
    bulge = 0.0
    for k in range(3):
        e = cell_edges[k]
        forward = edges[e, 0] == cell[k]
        _side(lines, e, forward, turn if forward else -turn, inverse, side[k])
        bulge = max(bulge, (0.25 * side[k, 6] + REACH) * max(abs(side[k, 7]), abs(side[k, 8])))
    return bulge


@lent
def opening_of(side, other, sigma):  # type: ignore[no-untyped-def]
    """The angle at the corner between a side's end and the next one's start, over 2 pi."""
    cosine = -(side[4] * other[4] + side[5] * other[5]) * sigma * sigma
    # the first side bows inwards with slope 8 along its direction; seen from the corner that turns it outwards
    angle = np.arccos(min(max(cosine, -1.0), 1.0))
    return (angle + np.arctan(side[8]) - np.arctan(other[7])) / (2.0 * np.pi)


@lent
def lay_rows(side, top, count, far, left, right, low, high):  # type: ignore[no-untyped-def]
    """Fill in the columns, ``left`` to ``right`` at most, between which rows from ``top`` on lie less than ``far``
    outside of every side."""
    padded = lanes_of(count)
    low[:padded], high[:padded] = left, right
    for k in range(3):
        # where a side runs along the rows, it takes all of them or leaves them
        nx = side[k, 1] if abs(side[k, 1]) > 1e-9 else 1e-9
        x, lean = -(side[k, 0] + side[k, 2] * top + far) / nx, -side[k, 2] / nx
        if nx > 0.0:
            for i in range(padded):
                low[i] = max(low[i], x + lean * i)
        else:
            for i in range(padded):
                high[i] = min(high[i], x + lean * i)


@lent
def lay_pixels(places, at, count, x, y):  # type: ignore[no-untyped-def]
    """Lay out ``count`` pixels of a row from (x, y) on; what comes after them may be written over."""
    px, py = np.float32(x), np.float32(y)
    to_x, to_y = np.uint64(PX + at), np.uint64(PY + at)
    for j in range(lanes_of(count)):
        k = np.uint64(j)
        places[to_x + k], places[to_y + k] = px + STEPS[k], py


@lent
def _from_side(places, count, side, x0, y0, far, out):  # type: ignore[no-untyped-def]
    """Fill in the pixels' distances from a side; (x0, y0) is what their places count from."""
    zero, one, limit = np.float32(0.0), np.float32(1.0), np.float32(far)
    d0, dx, dy = side[0] + side[1] * x0 + side[2] * y0, side[1], side[2]
    t0, tx, ty = side[3] + side[4] * x0 + side[5] * y0, side[4], side[5]
    length, short = np.float32(side[6]), np.float32(1.0 / side[6])
    leave, arrive, three = np.float32(side[7]), np.float32(side[8]), np.float32(3.0)
    for k in range(count):
        x, y = np.float64(places[PX + k]), np.float64(places[PY + k])
        # what is near is the difference of what is far
        d, t = np.float32(d0 + dx * x + dy * y), np.float32(t0 + tx * x + ty * y)
        part = t * short
        inside = min(max(part, zero), one)
        off = inside * (one - inside) * (leave * (one - inside) - arrive * inside)
        off += leave * min(part, zero) + arrive * max(part - one, zero)
        # blur draws a curved edge towards the centre of its curvature, by half of that times the squared blur
        drawn = (three * (leave + arrive) * inside - (leave + leave + arrive)) * short
        d = d - length * off - drawn if d < limit else d
        out[D + k], out[TO_END + k], out[TO_START + k] = d, length - t - arrive * d, t + leave * d


@lent
def _one_side(sides, count, shares, pairs):  # type: ignore[no-untyped-def]
    """Fill in the pixels' shares where one side at most is near, and which they are elsewhere."""
    zero, one = np.float32(0.0), np.float32(1.0)
    for k in range(count):
        d0, d1, d2 = sides[D + k], sides[OF_SIDE + D + k], sides[2 * OF_SIDE + D + k]
        low = min(min(d0, d1), d2)
        high = max(max(d0, d1), d2)
        middle = max(min(d0, d1), min(max(d0, d1), d2))
        share = normal(min(max(low, -NEAR), NEAR))
        share = one if low >= NEAR else share
        shares[k] = share if low > -NEAR else zero
        # the one that is far says which two are near
        pair = one if high == d0 else np.float32(2.0)
        pair = zero if high == d2 else pair
        pair = np.float32(ALL) if high < NEAR else pair
        pairs[k] = pair if (middle < NEAR) & (low > -NEAR) else np.float32(NO_PAIR)


@lent
def _lay_corner(sides, k, first, corners, at):  # type: ignore[no-untyped-def]
    """Lay out how pixel k lies in the corner between a side and the next one."""
    a, b = first * OF_SIDE + k, (first + 1 if first < 2 else 0) * OF_SIDE + k
    corners[BEFORE + at], corners[TO_IT + at] = sides[D + a], sides[TO_END + a]
    corners[AFTER + at], corners[FROM_IT + at] = sides[D + b], sides[TO_START + b]


@lent
def _wedges(corners, count):  # type: ignore[no-untyped-def]
    """Fill in the pixels' shares of the wedges, less those of the openings."""
    for k in range(count):
        share = side_of_wedge(corners[BEFORE + k], corners[TO_IT + k])
        corners[BEFORE + k] = share + side_of_wedge(corners[AFTER + k], corners[FROM_IT + k])


@lent
def _more_sides(sides, count, openings, pixels, corners, shares, pairs):  # type: ignore[no-untyped-def]
    """Fill in the pixels' shares where two or three sides are near."""
    found, laid = 0, 0
    for k in range(count):
        pixels[found] = k  # written over where only one is: no branch is to be guessed
        found += int(pairs[k] >= np.float32(0.0))
    for i in range(found):
        k = pixels[i]
        pair = int(pairs[k])
        if pair != ALL:
            _lay_corner(sides, k, pair, corners, laid)
            laid += 1
            continue
        for side in range(3):
            _lay_corner(sides, k, side, corners, laid + side)
        laid += 3
    for k in range(laid, lanes_of(laid)):
        corners[BEFORE + k], corners[AFTER + k] = np.float32(0.0), np.float32(0.0)
    _wedges(corners, lanes_of(laid))
    laid = 0
    for i in range(found):
        k = pixels[i]
        pair = int(pairs[k])
        if pair != ALL:
            shares[k] = np.float32(openings[pair]) + corners[BEFORE + laid]
            laid += 1
            continue
        share = np.float32(1.0)
        for side in range(3):
            share += (
                np.float32(openings[side]) + corners[BEFORE + laid] - normal(sides[side * OF_SIDE + D + k])
            )
            laid += 1
        shares[k] = max(share, np.float32(0.0))


@compiled
def room_for_shares():  # type: ignore[no-untyped-def]
    """Arrays for the pixels of one cell: sides, pairs, pixels and corners."""
    sides, pairs = np.empty(3 * OF_SIDE, np.float32), np.empty(CHUNK, np.float32)
    return sides, pairs, np.empty(CHUNK, np.int64), np.zeros(12 * CHUNK, np.float32)


@lent
def fill_shares(places, count, x0, y0, side, openings, far, room, shares):  # type: ignore[no-untyped-def]
    """Fill in the shares of a cell in the pixels that are laid out in ``places``, which count from (x0, y0)."""
    sides, pairs, pixels, corners = room
    padded = lanes_of(count)
    for k in range(3):
        _from_side(places, padded, side[k], x0, y0, far, sides[k * OF_SIDE :])
    _one_side(sides, padded, shares, pairs)
    _more_sides(sides, count, openings, pixels, corners, shares, pairs)
