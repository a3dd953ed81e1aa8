"""The pattern is drawn from its current markers.

A pixel of the drawing is the share of each cell under a Gaussian (the optics' blur and the pixel's box in one) times
the cell's level over black. The three sides of a cell are half planes, where two of them are near they form a wedge
(``gaussian``); inclusion and exclusion joins them:

    share = wedge01 + wedge12 + wedge20 - side0 - side1 - side2 + 1.

The pixels of a cell stand in arrays, with places from a pixel near its middle, so that float32 does, and all that needs
no table is done for many at once.
"""

from __future__ import annotations

import numpy as np

from .engine import compiled
from .gaussian import REACH, normal, side_of_wedge
from .gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y

CHUNK = (
    2128  # pixels of one cell at once, at most; no power of 2, which would lay all columns on one cache line
)
LANES = 16
NEAR = np.float32(REACH)
# columns of pixels: place; for each side the distance inside it, and how far along it they lie from its second and its
# first corner, along the curve's direction there; share of the cell, and where two sides are near, the first of them
PX, PY = 0, CHUNK
D, TO_END, TO_START, OF_SIDE = 0, CHUNK, 2 * CHUNK, 3 * CHUNK
SHARE, PAIR = 0, CHUNK
NO_PAIR, ALL = -1, 3
# of a corner between two sides: distance inside the first and how far before its end, inside the second and how far
# after its start
BEFORE, TO_IT, AFTER, FROM_IT = (k * 3 * CHUNK for k in range(4))


@compiled
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


@compiled
def _sides(cell, cell_edges, edges, lines, turn, inverse, side):  # type: ignore[no-untyped-def]
    """Fill in a cell's three sides; how far they can lie off their chords."""
    bulge = 0.0
    for k in range(3):
        e = cell_edges[k]
        forward = edges[e, 0] == cell[k]
        _side(lines, e, forward, turn if forward else -turn, inverse, side[k])
        bulge = max(bulge, (0.25 * side[k, 6] + REACH) * max(abs(side[k, 7]), abs(side[k, 8])))
    return bulge


@compiled
def _opening(side, other, sigma):  # type: ignore[no-untyped-def]
    """The angle at the corner between a side's end and the next one's start, over 2 pi."""
    cosine = -(side[4] * other[4] + side[5] * other[5]) * sigma * sigma
    # the first side bows inwards with slope 8 along its direction; seen from the corner that turns it outwards
    angle = np.arccos(min(max(cosine, -1.0), 1.0))
    return (angle + np.arctan(side[8]) - np.arctan(other[7])) / (2.0 * np.pi)


@compiled
def _columns(side, y, far, left, right):  # type: ignore[no-untyped-def]
    """The columns of row y that lie less than ``far`` outside of every side."""
    low, high = left, right
    for k in range(3):
        rest = side[k, 0] + side[k, 2] * y + far
        if side[k, 1] > 0.0:
            low = max(low, np.ceil(-rest / side[k, 1]))
        elif side[k, 1] < 0.0:
            high = min(high, np.floor(-rest / side[k, 1]))
        elif rest < 0.0:
            high = low - 1.0
    return low, high


@compiled
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


@compiled
def _one_side(sides, count, out):  # type: ignore[no-untyped-def]
    """Fill in the pixels' shares where one side at most is near, and which they are elsewhere."""
    zero, one = np.float32(0.0), np.float32(1.0)
    for k in range(count):
        d0, d1, d2 = sides[D + k], sides[OF_SIDE + D + k], sides[2 * OF_SIDE + D + k]
        low = min(min(d0, d1), d2)
        high = max(max(d0, d1), d2)
        middle = max(min(d0, d1), min(max(d0, d1), d2))
        share = normal(min(max(low, -NEAR), NEAR))
        share = one if low >= NEAR else share
        out[SHARE + k] = share if low > -NEAR else zero
        # the one that is far says which two are near
        pair = one if high == d0 else np.float32(2.0)
        pair = zero if high == d2 else pair
        pair = np.float32(ALL) if high < NEAR else pair
        out[PAIR + k] = pair if (middle < NEAR) & (low > -NEAR) else np.float32(NO_PAIR)


@compiled
def _lay_corner(sides, k, first, corners, at):  # type: ignore[no-untyped-def]
    """Lay out how pixel k lies in the corner between a side and the next one."""
    a, b = first * OF_SIDE + k, (first + 1 if first < 2 else 0) * OF_SIDE + k
    corners[BEFORE + at], corners[TO_IT + at] = sides[D + a], sides[TO_END + a]
    corners[AFTER + at], corners[FROM_IT + at] = sides[D + b], sides[TO_START + b]


@compiled
def _wedges(corners, count):  # type: ignore[no-untyped-def]
    """Fill in the pixels' shares of the wedges, less those of the openings."""
    for k in range(count):
        share = side_of_wedge(corners[BEFORE + k], corners[TO_IT + k])
        corners[BEFORE + k] = share + side_of_wedge(corners[AFTER + k], corners[FROM_IT + k])


@compiled
def _more_sides(sides, count, opening, pixels, corners, out):  # type: ignore[no-untyped-def]
    """Fill in the pixels' shares where two or three sides are near."""
    found, laid = 0, 0
    for k in range(count):
        pixels[found] = k  # written over where only one is: no branch is to be guessed
        found += int(out[PAIR + k] >= np.float32(0.0))
    for i in range(found):
        k = pixels[i]
        pair = int(out[PAIR + k])
        if pair != ALL:
            _lay_corner(sides, k, pair, corners, laid)
            laid += 1
            continue
        for side in range(3):
            _lay_corner(sides, k, side, corners, laid + side)
        laid += 3
    for k in range(laid, (laid + LANES - 1) // LANES * LANES):
        corners[BEFORE + k], corners[AFTER + k] = np.float32(0.0), np.float32(0.0)
    _wedges(corners, (laid + LANES - 1) // LANES * LANES)
    laid = 0
    for i in range(found):
        k = pixels[i]
        pair = int(out[PAIR + k])
        if pair != ALL:
            out[SHARE + k] = np.float32(opening[pair]) + corners[BEFORE + laid]
            laid += 1
            continue
        share = np.float32(1.0)
        for side in range(3):
            share += (
                np.float32(opening[side]) + corners[BEFORE + laid] - normal(sides[side * OF_SIDE + D + k])
            )
            laid += 1
        out[SHARE + k] = max(share, np.float32(0.0))


@compiled
def _add(flat, at, first, count, shares, level, slope):  # type: ignore[no-untyped-def]
    """Add pixels of a row, from place ``at`` on, their levels ``level`` at the first and ``slope`` more at each next
    one, times their shares."""
    (l0, l1, l2), (s0, s1, s2) = level, slope
    one, two = np.uint64(1), np.uint64(2)
    here = np.uint64(at)
    for k in range(first, first + count):
        share = shares[SHARE + k]
        flat[here] += share * l0
        flat[here + one] += share * l1
        flat[here + two] += share * l2
        here += np.uint64(3)
        l0 += s0
        l1 += s1
        l2 += s2


@compiled
def _fill(  # type: ignore[no-untyped-def]
    flat,
    width,
    runs,
    filled,
    count,
    level,
    slope,
    center,
    side,
    far,
    opening,
    places,
    sides,
    shares,
    pixels,
    corners,
):
    """Add the pixels laid out in ``places``: ``runs`` (n, 3) x, y and number of pixels in a row of the image."""
    padded = (count + LANES - 1) // LANES * LANES
    for k in range(3):
        _from_side(places, padded, side[k], center[0], center[1], far, sides[k * OF_SIDE :])
    _one_side(sides, padded, shares)
    _more_sides(sides, count, opening, pixels, corners, shares)
    k = 0
    change = np.float32(slope[0, 0]), np.float32(slope[1, 0]), np.float32(slope[2, 0])
    for i in range(filled):
        x, y, own = runs[i, 0], runs[i, 1], runs[i, 2]
        dx, dy = x - center[2], y - center[3]
        start = (
            np.float32(level[0] + slope[0, 0] * dx + slope[0, 1] * dy),
            np.float32(level[1] + slope[1, 0] * dx + slope[1, 1] * dy),
            np.float32(level[2] + slope[2, 0] * dx + slope[2, 1] * dy),
        )
        _add(flat, (y * width + x) * 3, k, own, shares, start, change)
        k += own


@compiled
def draw_cells(xy, cells, cell_edges, edges, lines, levels, slopes, sigma, box, model):  # type: ignore[no-untyped-def]
    """Add the drawn cells' levels over black to the model."""
    inverse = 1.0 / sigma
    side, opening = np.zeros((3, 9)), np.zeros(3)
    flat, width = model.reshape(-1), model.shape[1]
    places, sides = np.zeros(2 * CHUNK, np.float32), np.empty(3 * OF_SIDE, np.float32)
    shares, pixels = np.empty(2 * CHUNK, np.float32), np.empty(CHUNK, np.int64)
    runs, corners = np.empty((CHUNK, 3), np.int64), np.zeros(12 * CHUNK, np.float32)
    for i in range(cells.shape[0]):
        e, f, g = cell_edges[i]
        if lines[e, KNOWN] * lines[f, KNOWN] * lines[g, KNOWN] == 0.0:
            continue
        a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
        turn = 1.0 if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0 else -1.0
        bulge = _sides(cells[i], cell_edges[i], edges, lines, turn, inverse, side)
        for k in range(3):
            opening[k] = _opening(side[k], side[(k + 1) % 3], sigma)
        cx, cy, far = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, REACH + bulge
        top = max(int(np.ceil(min(a[1], b[1], c[1]) - far * sigma)), box[1])
        bottom = min(int(max(a[1], b[1], c[1]) + far * sigma), box[3] - 1)
        left = max(np.ceil(min(a[0], b[0], c[0]) - far * sigma), float(box[0]))
        right = min(np.floor(max(a[0], b[0], c[0]) + far * sigma), box[2] - 1.0)
        x0, y0 = np.floor(cx), np.floor(cy)
        center = (x0, y0, cx, cy)
        kept = (side, far, opening, places, sides, shares, pixels, corners)
        filled, count = 0, 0
        for y in range(top, bottom + 1):
            low, high = _columns(side, y, far, left, right)
            x, end = int(low), int(high)
            while x <= end:
                own = min(end - x + 1, CHUNK - count)
                runs[filled, 0], runs[filled, 1], runs[filled, 2] = x, y, own
                filled += 1
                px, py = np.float32(x - x0), np.float32(y - y0)
                for k in range(count, count + own):
                    places[PX + k], places[PY + k] = px, py
                    px += np.float32(1.0)
                count += own
                x += own
                if count == CHUNK:
                    _fill(flat, width, runs, filled, count, levels[i], slopes[i], center, *kept)
                    filled, count = 0, 0
        _fill(flat, width, runs, filled, count, levels[i], slopes[i], center, *kept)
