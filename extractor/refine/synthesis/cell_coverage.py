"""The coverage of pixels by a cell: the cell's share in a pixel under a Gaussian, the blur of optics and pixel in one.

The three sides of a cell are half planes, and every two of them form a wedge (``gaussian``). By inclusion and exclusion

    share = wedge01 + wedge12 + wedge20 - side0 - side1 - side2 + 1,

which is the wedge of two sides where the third is far. The pixels of a cell stand in arrays and are computed together,
without tables and branches. Their places count from a pixel near the cell's middle, so that float32 is precise enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import inlined_no_refcount
from extractor.numeric.gaussian import NORMAL_REACH, fill_corner_terms, normal_cdf, wedge_correlation
from extractor.refine.synthesis.gridlines import ARRIVE, LEAVE, LENGTH, UX, UY, X, Y
from extractor.refine.synthesis.pixel_rows import LANES, padded_count

CHUNK = 2128  # pixels of one cell at once, at most
COLUMN = CHUNK + LANES  # pixels and one lane; a power of 2 would put all columns on one cache line
PX, PY = 0, COLUMN  # columns of pixels: x and y, px
SIDE_COLUMNS = 9  # numbers of a side, see ``_fill_side``
REACH_FLOAT32 = np.float32(NORMAL_REACH)
STEPS = np.arange(COLUMN, dtype=np.float32)


class CellOutline(NamedTuple):
    """The sides and corners of one cell.

    Attributes:
        side: (3, 9), as ``fill_sides`` gives them, in units of the blur.
        corners: (3, 9) float32, as ``fill_corners`` gives them.
        far: in units of the blur, the distance from a side's chord beyond which a pixel's share no longer changes.
    """

    side: NDArray[np.float64]
    corners: NDArray[np.float32]
    far: float


class Corner(NamedTuple):
    """The numbers that ``wedge_correlation`` takes of one corner, float32: for each of three nodes the factors of the
    sum of squares (a) and of the product (b), and the node's weight (w)."""

    a0: np.float32
    a1: np.float32
    a2: np.float32
    b0: np.float32
    b1: np.float32
    b2: np.float32
    w0: np.float32
    w1: np.float32
    w2: np.float32


@inlined_no_refcount
def _fill_side(lines, e, forward, sense, inverse, out):  # type: ignore[no-untyped-def]
    """Fill in a cell's side, in units of the blur.

    Args:
        lines: (E, 8), as ``gridlines`` gives them. e: the gridline.
        forward: the gridline runs from the side's first corner to the second.
        sense: 1 where the gridline's normal points into the cell, else -1.
        inverse: 1/px, of the blur.
        out: (9,) 0-2: distance inside the side, out[0] + out[1] x + out[2] y; 3-5: place along the side from its first
            corner, likewise; 6: length; 7, 8: slopes at the first and the second corner, positive inwards.
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


@inlined_no_refcount
def fill_sides(cell, cell_edges, edges, lines, turn, inverse, side):  # type: ignore[no-untyped-def]
    """Fill in a cell's three sides (3, 9); ``turn`` is the sign of (b - a) x (c - a) of its corners.

    Returns:
        In units of the blur, the largest possible offset of a side from its chord.
    """
    bulge = 0.0
    for k in range(3):
        e = cell_edges[k]
        forward = edges[e, 0] == cell[k]
        _fill_side(lines, e, forward, turn if forward else -turn, inverse, side[k])
        bulge = max(bulge, (0.25 * side[k, 6] + NORMAL_REACH) * max(abs(side[k, 7]), abs(side[k, 8])))
    return bulge


@inlined_no_refcount
def fill_corners(side, sigma, corners):  # type: ignore[no-untyped-def]
    """Fill in the corners (3, 9) between each side and the next one; ``sigma`` is the blur, px."""
    for k in range(3):
        one, other = side[k], side[(k + 1) % 3]
        end, start = one[8], other[7]
        # the directions of curved sides are those of their chords, turned by their slopes
        x, y = one[4] + end * one[1], one[5] + end * one[2]
        cosine = x * (other[4] + start * other[1]) + y * (other[5] + start * other[2])
        fill_corner_terms(
            cosine * sigma * sigma / np.sqrt((1.0 + end * end) * (1.0 + start * start)), corners[k]
        )


@inlined_no_refcount
def fill_row_ends(side, top, count, far, left, right, low, high):  # type: ignore[no-untyped-def]
    """Fill in the ends in x of ``count`` rows from y = ``top`` on, between ``left`` and ``right``, px: a row lies less
    than ``far``, in units of the blur, outside every side."""
    padded = padded_count(count)
    low[:padded], high[:padded] = left, right
    for k in range(3):
        # a side along the rows excludes whole rows or none
        nx = side[k, 1] if abs(side[k, 1]) > 1e-9 else 1e-9
        x, lean = -(side[k, 0] + side[k, 2] * top + far) / nx, -side[k, 2] / nx
        if nx > 0.0:
            for i in range(padded):
                low[i] = max(low[i], x + lean * i)
        else:
            for i in range(padded):
                high[i] = min(high[i], x + lean * i)


@inlined_no_refcount
def fill_pixels(places, at, count, x, y):  # type: ignore[no-untyped-def]
    """Fill in the places of ``count`` pixels of a row from (x, y) on, beginning with pixel ``at``; up to one lane more
    is overwritten."""
    px, py = np.float32(x), np.float32(y)
    to_x, to_y = np.uint64(PX + at), np.uint64(PY + at)
    for j in range(padded_count(count)):
        k = np.uint64(j)
        places[to_x + k], places[to_y + k] = px + STEPS[k], py


@inlined_no_refcount
def _fill_distances(places, count, side, x0, y0, far, out):  # type: ignore[no-untyped-def]
    """Fill in the distances of the pixels inside a side (9,), in units of the blur.

    (x0, y0) px is the origin of the pixels' places. Beyond ``far`` the distance is that from the chord.
    """
    zero, one, limit = np.float32(0.0), np.float32(1.0), np.float32(far)
    # in float64, as small numbers are differences of large ones
    d0, dx, dy = np.float32(side[0] + side[1] * x0 + side[2] * y0), np.float32(side[1]), np.float32(side[2])
    short, start = 1.0 / side[6], side[3] + side[4] * x0 + side[5] * y0
    t0, tx, ty = np.float32(start * short), np.float32(side[4] * short), np.float32(side[5] * short)
    leave, arrive = np.float32(side[6] * side[7]), np.float32(side[6] * side[8])
    # blur moves a curved edge towards the centre of its curvature, by half of the curvature times the squared blur
    bend, bent = np.float32(3.0 * (side[7] + side[8]) * short), np.float32((2.0 * side[7] + side[8]) * short)
    for k in range(count):
        x, y = places[PX + k], places[PY + k]
        d, t = d0 + dx * x + dy * y, t0 + tx * x + ty * y
        inside = min(max(t, zero), one)
        rest = one - inside
        off = inside * rest * (leave * rest - arrive * inside)
        off += leave * min(t, zero) + arrive * max(t - one, zero)
        out[k] = d - off - (bend * inside - bent) if d < limit else d


@inlined_no_refcount
def _half_plane_coverage(d):  # type: ignore[no-untyped-def]
    """The share of a side's half plane at the distance d inside the side."""
    return np.float32(1.0) if d >= REACH_FLOAT32 else normal_cdf(max(d, -REACH_FLOAT32))


@inlined_no_refcount
def _wedge_correlation(d, other, corner):  # type: ignore[no-untyped-def]
    """The share of a wedge less the product of its sides' shares, at the distances d and ``other`` inside them."""
    d, other = max(d, -REACH_FLOAT32), max(other, -REACH_FLOAT32)
    share = wedge_correlation(d * d + other * other, d * other, corner)
    return share if max(d, other) < REACH_FLOAT32 else np.float32(0.0)


@inlined_no_refcount
def _corner(corners, k):  # type: ignore[no-untyped-def]
    """Row k of the corners (3, 9) as a record."""
    c = corners[k]
    return Corner(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8])


@inlined_no_refcount
def _selected_corner(which, one, other):  # type: ignore[no-untyped-def]
    """One corner where ``which``, else the other, without a branch."""
    return Corner(
        one.a0 if which else other.a0,
        one.a1 if which else other.a1,
        one.a2 if which else other.a2,
        one.b0 if which else other.b0,
        one.b1 if which else other.b1,
        one.b2 if which else other.b2,
        one.w0 if which else other.w0,
        one.w1 if which else other.w1,
        one.w2 if which else other.w2,
    )


@inlined_no_refcount
def _fill_two_side_coverage(sides, corners, count, shares):  # type: ignore[no-untyped-def]
    """Fill in the shares of the pixels of a cell so large that no pixel is near to all three sides."""
    c01, c12, c20 = _corner(corners, 0), _corner(corners, 1), _corner(corners, 2)
    for k in range(count):
        d0, d1, d2 = sides[k], sides[COLUMN + k], sides[2 * COLUMN + k]
        low, high = min(min(d0, d1), d2), max(max(d0, d1), d2)
        middle = max(min(d0, d1), min(max(d0, d1), d2))
        # the farthest side is left out
        corner = _selected_corner(high == d2, c01, _selected_corner(high == d0, c12, c20))
        one = _half_plane_coverage(low)
        share = (
            one
            if middle >= REACH_FLOAT32
            else one * _half_plane_coverage(middle) + _wedge_correlation(low, middle, corner)
        )
        shares[k] = share if low > -REACH_FLOAT32 else np.float32(0.0)


@inlined_no_refcount
def _fill_three_side_coverage(sides, corners, count, shares):  # type: ignore[no-untyped-def]
    """Fill in the shares of the pixels of any cell."""
    c01, c12, c20 = _corner(corners, 0), _corner(corners, 1), _corner(corners, 2)
    for k in range(count):
        d0, d1, d2 = sides[k], sides[COLUMN + k], sides[2 * COLUMN + k]
        s0, s1, s2 = _half_plane_coverage(d0), _half_plane_coverage(d1), _half_plane_coverage(d2)
        share = np.float32(1.0) - s0 - s1 - s2 + s0 * s1 + s1 * s2 + s2 * s0
        share += (
            _wedge_correlation(d0, d1, c01)
            + _wedge_correlation(d1, d2, c12)
            + _wedge_correlation(d2, d0, c20)
        )
        shares[k] = max(share, np.float32(0.0)) if min(min(d0, d1), d2) > -REACH_FLOAT32 else np.float32(0.0)


@inlined_no_refcount
def is_small(side):  # type: ignore[no-untyped-def]
    """Whether a pixel may be near to all three sides (3, 9) of a cell: by the radius of the inscribed circle."""
    a, b, c = side[0, 6], side[1, 6], side[2, 6]
    perimeter, bow = a + b + c, 0.0
    for k in range(3):
        bow = max(bow, 0.25 * side[k, 6] * max(abs(side[k, 7]), abs(side[k, 8])))
    square = (perimeter - 2.0 * a) * (perimeter - 2.0 * b) * (perimeter - 2.0 * c) / (4.0 * perimeter)
    return square < (NORMAL_REACH + bow) ** 2


@inlined_no_refcount
def fill_coverage(places, count, x0, y0, outline, sides, shares):  # type: ignore[no-untyped-def]
    """Fill in the shares of a cell in pixels.

    Args:
        places: x and y of the pixels, px from (x0, y0). count: pixels.
        outline: ``CellOutline``.
        sides: three columns, filled with the distances inside the sides.
        shares: (n,) float32, filled.
    """
    padded = padded_count(count)
    for k in range(3):
        _fill_distances(places, padded, outline.side[k], x0, y0, outline.far, sides[k * COLUMN :])
    if is_small(outline.side):
        _fill_three_side_coverage(sides, outline.corners, padded, shares)
    else:
        _fill_two_side_coverage(sides, outline.corners, padded, shares)
