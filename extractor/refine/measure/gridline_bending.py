"""Bending of the gridlines beyond the smooth map: two more unknowns for each gridline, free where markers are rough.

The map that the markers define is smooth over two rings of markers. Where an object's rim lies between markers, or
slips, gridlines bend more sharply. The sharpness is limited by the third differences of the markers along their
gridlines, which are 0 where the map is quadratic. A gridline then deviates from the map's cubic by

    t (1 - t) (b + s (1 - 2 t)),

t along the chord, b and s of zero mean and a deviation that is a share of these differences. The share, from
``MIN_BEND_SHARE`` to ``MAX_BEND_SHARE``, follows from the gridlines around: how much more they are bent than noise
explains. Both unknowns are eliminated from a gridline's sums before the markers are solved, and computed afterwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined
from extractor.refine.synthesis.gridlines import FIRST_RING, KNOWN, LENGTH, UX, UY
from extractor.refine.synthesis.pixel_weights import BAND
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
    READ_AA,
    READ_BB,
    C,
    D,
)

# From the surfaces under balls that press, shear and twist: b and s over the differences around them (RMS) where these
# are smooth, and at most; and the shift of a gridline's ends that remains, in deviations of b and s.
MIN_BEND_SHARE, MAX_BEND_SHARE = 0.01, 0.25
BEND_TO_END_SHIFT = 0.08
MAX_BEND_DEVIATION = 0.06  # in units of the gridline's length
# The noise of four markers in a third difference, 1 + 9 + 9 + 1, in two axes, with some allowance for its scatter.
THIRD_DIFFERENCE_NOISE = 2 * 20 * 2.0
MEAN_OVER_MEDIAN = 2.0  # a mean of squares against their median
MISFIT_TOLERANCE = 25.0  # five deviations of that shift, squared,
MAX_MISFIT_TOLERANCE = 0.1  # and at most, in units of the blur, squared
MAX_DIFFERENCES, LANES = (
    6 * (1 + FIRST_RING),
    64,
)  # third differences around a marker at most, and markers at once
MIN_SIGNIFICANCE = 3.0  # deviations by which bending must exceed its noise
MAX_BEND = 0.3  # b and s, in units of the gridline's length


class MarkerRows(NamedTuple):
    """The four markers in a row along each edge.

    Attributes:
        edges: (E, 2) marker ids of the two in the middle.
        next_markers: (E, 2) marker ids of the one before and the one after, -1 for none.
        third_differences: (E, 2) the layout's own third difference of the four, in units of its mean edge.
    """

    edges: NDArray[np.int32]
    next_markers: NDArray[np.int32]
    third_differences: NDArray[np.float64]


@inlined
def _update_ordered_pairs(low, high):  # type: ignore[no-untyped-def]
    """Sort each pair of ``low`` (n,) and ``high`` (n,), in place."""
    for k in range(low.shape[0]):
        low[k], high[k] = min(low[k], high[k]), max(low[k], high[k])


@compiled
def _update_sorted_lanes(column):  # type: ignore[no-untyped-def]
    """Sort ``MAX_DIFFERENCES`` rows of ``LANES`` numbers, each lane by itself, in place.

    Batcher's odd-even merge sort compares the same rows for any numbers.
    """
    size = 1
    while size < MAX_DIFFERENCES:
        step = size
        while step >= 1:
            for low in range(step % size, MAX_DIFFERENCES - step, 2 * step):
                high = low + step
                if low // (2 * size) == high // (2 * size):
                    end = min(high + step, MAX_DIFFERENCES)
                    _update_ordered_pairs(
                        column[low * LANES : (end - step) * LANES], column[high * LANES : end * LANES]
                    )
            step //= 2
        size *= 2


@compiled
def measure_roughness(xy, maps, diagonal, rows, spokes, near):  # type: ignore[no-untyped-def]
    """The roughness of the markers.

    The roughness is the median of the squared third differences along the gridlines at a marker and at its neighbours,
    less the part that noise and the layout itself explain. By the median, one marker that dirt has moved does not free
    its gridlines to follow.

    Args:
        xy: (M, 2) px, the markers, NaN where unknown. maps: (M, 2, 5), as ``local_maps`` gives them.
        diagonal: (M, 3) 1/px^2, the information's diagonal blocks.
        rows: ``MarkerRows``.
        spokes, near: as in ``Topology``.

    Returns:
        (M,) px^2.
    """
    square = _squared_third_differences(xy, maps, rows)
    # the median, as markers with little weight where gridlines bend must not be taken for noise
    noise = THIRD_DIFFERENCE_NOISE * 2.0 / np.median(diagonal[:, 0] + diagonal[:, 2])
    own, known, above = _differences_at_markers(square, spokes, noise)
    out, column, marker = np.zeros(len(spokes)), np.zeros(MAX_DIFFERENCES * LANES), np.empty(LANES, np.int64)
    odd = np.empty(LANES, np.bool_)
    filled = 0
    for m in range(spokes.shape[0]):
        count, over = known[m], above[m]
        for k in range(FIRST_RING):
            n = near[m, k]
            if n >= 0:
                count += known[n]
                over += above[n]
        if 2.0 * over > count:
            _fill_lane(m, own, near, column[filled:])
            marker[filled], odd[filled] = m, count % 2.0 == 1.0
            filled += 1
        if filled == LANES or (filled > 0 and m == spokes.shape[0] - 1):
            _update_sorted_lanes(column)
            for k in range(filled):
                lower, upper = (
                    column[(MAX_DIFFERENCES // 2 - 1) * LANES + k],
                    column[MAX_DIFFERENCES // 2 * LANES + k],
                )
                middle = upper if odd[k] else 0.5 * (lower + upper)
                out[marker[k]] = max(MEAN_OVER_MEDIAN * middle - noise, 0.0)
            filled = 0
    return out


@compiled
def _differences_at_markers(square, spokes, noise):  # type: ignore[no-untyped-def]
    """(M, 6) the squared differences (E,) by marker, NaN where unknown; (M,) the numbers of known ones, and of those
    whose mean would exceed the noise."""
    own, known, above = np.full(spokes.shape, np.nan), np.zeros(len(spokes)), np.zeros(len(spokes))
    for m in range(spokes.shape[0]):
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and square[e] >= 0.0:  # False for NaN
                own[m, k] = square[e]
                known[m] += 1.0
                above[m] += 1.0 if MEAN_OVER_MEDIAN * square[e] > noise else 0.0
    return own, known, above


@compiled
def _fill_lane(m, own, near, column):  # type: ignore[no-untyped-def]
    """Fill a lane with the squared third differences at marker m and at its neighbours."""
    missing = 0
    for k in range(-1, FIRST_RING):
        n = m if k < 0 else near[m, k]
        for i in range(own.shape[1]):
            square = own[n, i] if n >= 0 else np.nan
            if not square >= 0.0:
                # missing ones lie on both sides of the median, half of them on each
                square = -np.inf if missing % 2 == 0 else np.inf
                missing += 1
            column[((k + 1) * own.shape[1] + i) * LANES] = square


@compiled
def third_difference(xy, maps, edges, ahead, third, e):  # type: ignore[no-untyped-def]
    """x and y, px, of the third difference of the four markers along edge e, less the layout's own (``third``)."""
    a, b, p, q = edges[e, 0], edges[e, 1], ahead[e, 0], ahead[e, 1]
    u, v = 0.5 * third[e, 0], 0.5 * third[e, 1]
    x = xy[p, 0] - xy[q, 0] + 3.0 * (xy[b, 0] - xy[a, 0])
    y = xy[p, 1] - xy[q, 1] + 3.0 * (xy[b, 1] - xy[a, 1])
    x -= u * (maps[a, 0, 0] + maps[b, 0, 0]) + v * (maps[a, 0, 1] + maps[b, 0, 1])
    y -= u * (maps[a, 1, 0] + maps[b, 1, 0]) + v * (maps[a, 1, 1] + maps[b, 1, 1])
    return x, y


@compiled
def _squared_third_differences(xy, maps, rows):  # type: ignore[no-untyped-def]
    """(E,) px^2, NaN where one of the four markers is not known."""
    edges, ahead, third = rows.edges, rows.next_markers, rows.third_differences
    out = np.full(edges.shape[0], np.nan)
    for e in range(edges.shape[0]):
        if ahead[e, 0] >= 0 and ahead[e, 1] >= 0:
            x, y = third_difference(xy, maps, edges, ahead, third, e)
            out[e] = x * x + y * y
    return out


@compiled
def bending_gridlines(roughness, bend, edges):  # type: ignore[no-untyped-def]
    """(E,) bool, the gridlines that ``bend`` (E, 2) or have an end with a ``roughness`` (M,)."""
    out = np.empty(edges.shape[0], np.bool_)
    for e in range(edges.shape[0]):
        bends = bend[e, 0] != 0.0 or bend[e, 1] != 0.0
        out[e] = bends or roughness[edges[e, 0]] > 0.0 or roughness[edges[e, 1]] > 0.0
    return out


@compiled
def estimate_bend_variance(sums, gradients, bend, roughness, weight, lines, edges, variance):  # type: ignore[no-untyped-def]
    """The variance of b and s, from the bending of the gridlines around and from the roughness of the ends.

    Args:
        sums: (E, 24), as ``accumulate_residual_sums`` gives them. gradients: ``ShiftGradients``.
        bend: (E, 2) px, b and s as drawn. roughness: (M,) px^2. weight: (E,) 0 to 1.
        lines: (E, 8), as ``gridlines`` gives them. edges: (E, 2) marker ids.
        variance: gray levels^2, of the noise.

    Returns:
        (E,) px^2; 0 where gridlines may not bend.
    """
    count = roughness.shape[0]
    total, noise_total, known = np.zeros(count), np.zeros(count), np.zeros(count)
    for e in range(edges.shape[0]):
        aa, ab, bb, ac, bc = sums[e, AA], sums[e, AB], sums[e, BB], sums[e, AC], sums[e, BC]
        determinant = aa * bb - ab * ab
        if not determinant > 1e-6 * aa * bb:
            continue
        by_a, by_b = (bb * ac - ab * bc) / determinant, (aa * bc - ab * ac) / determinant
        information = sums[e, CC] - by_a * ac - by_b * bc
        if not information > 1e-3 * sums[e, CC]:
            continue
        b = bend[e, 0] + (sums[e, C] - by_a * gradients.start[e] - by_b * gradients.end[e]) / information
        for side in range(2):
            m = edges[e, side]
            total[m] += weight[e] * b * b
            noise_total[m] += weight[e] * variance / information
            known[m] += weight[e]
    out = np.zeros(edges.shape[0])
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        square = min(roughness[i], roughness[j])
        both = known[i] + known[j]
        if square > 0.0 and both > 0.0:
            noise = (noise_total[i] + noise_total[j]) / both
            excess = (total[i] + total[j]) / both - noise * (1.0 + MIN_SIGNIFICANCE * np.sqrt(2.0 / both))
            most = min(MAX_BEND_SHARE**2 * square, (MAX_BEND_DEVIATION * lines[e, LENGTH]) ** 2)
            out[e] = min(max(excess, MIN_BEND_SHARE**2 * square), most)
    return out


@compiled
def update_without_bending(sums, gradients, bend, bend_variance, variance):  # type: ignore[no-untyped-def]
    """Eliminate the bending from the gridlines' sums (E, 24) and ``ShiftGradients``, in place.

    Args:
        bend: (E, 2) px, b and s as drawn. bend_variance: (E,) px^2.
        variance: gray levels^2, of the noise.

    Returns:
        (E, 6): px, the change of b and s with both ends held; px/px, its decrease by a shift of the start, then by a
        shift of the end, along the normal.
    """
    response = np.zeros((sums.shape[0], 6))
    k = np.empty((2, 2))
    for e in range(sums.shape[0]):
        sums[e, READ_AA], sums[e, READ_BB] = sums[e, AA], sums[e, BB]
        if sums[e, AA] == 0.0:
            continue
        c, d = sums[e, C], sums[e, D]
        k[0, 0], k[0, 1], k[1, 0], k[1, 1] = sums[e, AC], sums[e, AD], sums[e, BC], sums[e, BD]
        x, y = -bend[e, 0], -bend[e, 1]
        if bend_variance[e] > 0.0:
            stiff = variance / bend_variance[e]
            cc, cd, dd = sums[e, CC] + stiff, sums[e, CD], sums[e, DD] + stiff
            inverse = 1.0 / (cc * dd - cd * cd)
            pull_c, pull_d = c + stiff * x, d + stiff * y
            x, y = (dd * pull_c - cd * pull_d) * inverse, (cc * pull_d - cd * pull_c) * inverse
            for end in range(2):
                response[e, 2 + 2 * end] = (dd * k[end, 0] - cd * k[end, 1]) * inverse
                response[e, 3 + 2 * end] = (cc * k[end, 1] - cd * k[end, 0]) * inverse
        response[e, 0], response[e, 1] = x, y
        sums[e, MISFIT] -= 2.0 * (x * c + y * d)
        sums[e, MISFIT] += x * x * sums[e, CC] + 2.0 * x * y * sums[e, CD] + y * y * sums[e, DD]
        gradients.start[e] -= k[0, 0] * x + k[0, 1] * y
        gradients.end[e] -= k[1, 0] * x + k[1, 1] * y
        sums[e, AA] -= k[0, 0] * response[e, 2] + k[0, 1] * response[e, 3]
        sums[e, AB] -= k[1, 0] * response[e, 2] + k[1, 1] * response[e, 3]
        sums[e, BB] -= k[1, 0] * response[e, 4] + k[1, 1] * response[e, 5]
    return response


@compiled
def bend_after_shift(bend, response, shift, lines, edges):  # type: ignore[no-untyped-def]
    """(E, 2) px, b and s after a shift of the markers (M, 2) px; ``response`` is that of ``update_without_bending``."""
    out = np.zeros_like(bend)
    for e in range(bend.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        a, b = edges[e, 0], edges[e, 1]
        by_a = shift[a, 1] * lines[e, UX] - shift[a, 0] * lines[e, UY]
        by_b = shift[b, 1] * lines[e, UX] - shift[b, 0] * lines[e, UY]
        limit = MAX_BEND * lines[e, LENGTH]
        for k in range(2):
            change = response[e, k] - response[e, 2 + k] * by_a - response[e, 4 + k] * by_b
            out[e, k] = min(max(bend[e, k] + change, -limit), limit)
    return out


@compiled
def bending_misfit(bend_variance, contrasts, sigma):  # type: ignore[no-untyped-def]
    """(E,) gray levels^2, the mean squared residual of one channel that a gridline's remaining bending may make.

    ``bend_variance`` (E,) px^2, ``contrasts`` (E, 3) gray levels, ``sigma`` px, the blur.
    """
    out = np.empty(bend_variance.shape[0])
    for e in range(bend_variance.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        # the mean of the squared normal density over BAND to both sides
        share = strength / (3.0 * sigma * sigma) / (4.0 * BAND * np.sqrt(np.pi))
        square = MISFIT_TOLERANCE * BEND_TO_END_SHIFT**2 * bend_variance[e]
        out[e] = min(square, MAX_MISFIT_TOLERANCE * sigma * sigma) * share
    return out


@compiled
def mean_at_markers(values, spokes):  # type: ignore[no-untyped-def]
    """(M,) the means of values (E,) over the gridlines at each marker; 0 without any."""
    out = np.zeros(spokes.shape[0])
    for m in range(spokes.shape[0]):
        known = 0
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0:
                out[m] += values[e]
                known += 1
        out[m] /= max(known, 1)
    return out
