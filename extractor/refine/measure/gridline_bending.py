"""How gridlines bend beyond what the smooth map says: two more unknowns for each, free where the markers are rough.

The map that the markers define is smooth over two rings of them. Where an object's rim lies between markers, or slips,
gridlines bend more sharply than that. How sharply they may can be seen: the third differences of the markers along
their gridlines are 0 where the map is quadratic. A gridline then deviates from the map's cubic by

    t (1 - t) (b + s (1 - 2 t)),

t along its chord, b and s of zero mean and a deviation that is a share of these differences. How large a share, from
``MIN_BEND_SHARE`` to ``MAX_BEND_SHARE``, the gridlines around say: by how much more they are bent than noise
explains. Both unknowns are
eliminated from a gridline's sums before the markers are solved, and follow afterwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined
from extractor.refine.synthesis.gridlines import FIRST_RING, KNOWN, LENGTH, UX, UY
from extractor.refine.synthesis.residual_kernel import (
    AA,
    AB,
    AC,
    AD,
    BAND,
    BB,
    BC,
    BD,
    CC,
    CD,
    DD,
    MISFIT,
    READ_AA,
    READ_BB,
    SHARE_C,
    SHARE_D,
    C,
    D,
)

# From the surfaces under balls that press, shear and twist: b and s over the differences around them (RMS) where these
# are smooth, and at most; and what is left to move a gridline's ends, in deviations of b and s.
MIN_BEND_SHARE, MAX_BEND_SHARE = 0.01, 0.25
BEND_TO_END_SHIFT = 0.08
MAX_BEND_DEVIATION = 0.06  # in units of the gridline's length
# The noise of four markers in a third difference, 1 + 9 + 9 + 1, in two axes, with some allowance for its scatter.
THIRD_DIFFERENCE_NOISE = 2 * 20 * 2.0
MEAN_OVER_MEDIAN = 2.0  # a mean of squares against their median
MISFIT_TOLERANCE = (
    25.0  # five standard deviations of that, squared; and at most, in units of the blur, squared
)
MAX_MISFIT_TOLERANCE = 0.1
MAX_DIFFERENCES, LANES = (
    6 * (1 + FIRST_RING),
    64,
)  # third differences around a marker at most, and markers at once
MIN_SIGNIFICANCE = 3.0  # standard deviations that bending must exceed its noise by
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
    """Swap what stands the wrong way round."""
    for k in range(low.shape[0]):
        low[k], high[k] = min(low[k], high[k]), max(low[k], high[k])


@compiled
def _update_sorted_lanes(column):  # type: ignore[no-untyped-def]
    """Sort ``MAX_DIFFERENCES`` rows of ``LANES`` numbers, each lane by itself: Batcher's odd-even merge sort, which
    compares the
    same rows whatever they hold."""
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
def measure_roughness(xy, maps, diagonal, rows, spokes, near, which):  # type: ignore[no-untyped-def]
    """(M,) px^2: how rough the markers are around each of ``gridlines`` (M,) bool, from the squared third
    differences along
    the gridlines at it and at its neighbours, less what their noise and the layout itself explain; 0 elsewhere.

    Their median: one marker that dirt has moved does not make its gridlines free to follow it.
    """
    square = _squared_third_differences(xy, maps, rows)
    # what is hardly trusted where it bends must not be taken for noise
    noise = THIRD_DIFFERENCE_NOISE * 2.0 / np.median(diagonal[:, 0] + diagonal[:, 2])
    own, known, above = np.full(spokes.shape, np.nan), np.zeros(len(spokes)), np.zeros(len(spokes))
    for m in range(spokes.shape[0]):
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and square[e] >= 0.0:  # not where it is not known
                own[m, k] = square[e]
                known[m] += 1.0
                above[m] += 1.0 if MEAN_OVER_MEDIAN * square[e] > noise else 0.0
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
        if which[m] and 2.0 * over > count:
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
def _fill_lane(m, own, near, column):  # type: ignore[no-untyped-def]
    """Lay the third differences at marker m and around it into a lane."""
    missing = 0
    for k in range(-1, FIRST_RING):
        n = m if k < 0 else near[m, k]
        for i in range(own.shape[1]):
            seen = own[n, i] if n >= 0 else np.nan
            if not seen >= 0.0:
                # what is missing lies on both sides of the median, half of it each
                seen = -np.inf if missing % 2 == 0 else np.inf
                missing += 1
            column[((k + 1) * own.shape[1] + i) * LANES] = seen


@compiled
def third_difference(xy, maps, edges, ahead, third, e):  # type: ignore[no-untyped-def]
    """px, of the four markers along edge e, less the layout's own (``third_differences``)."""
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
def bending_gridlines(rough, bend, edges):  # type: ignore[no-untyped-def]
    """(E,) bool, the gridlines that bend (E, 2), or with an end that is rough (M,)."""
    out = np.empty(edges.shape[0], np.bool_)
    for e in range(edges.shape[0]):
        bends = bend[e, 0] != 0.0 or bend[e, 1] != 0.0
        out[e] = bends or rough[edges[e, 0]] > 0.0 or rough[edges[e, 1]] > 0.0
    return out


@compiled
def estimate_bend_variance(sums, gradients, bend, rough, use, lines, edges, variance):  # type: ignore[no-untyped-def]
    """(E,) px^2, the variance of b and s, by what the gridlines around show, as far as they are in use (E,), and by how
    rough (M,) their ends are."""
    count = rough.shape[0]
    total, of_noise, known = np.zeros(count), np.zeros(count), np.zeros(count)
    for e in range(edges.shape[0]):
        aa, ab, bb, ac, bc = sums[e, AA], sums[e, AB], sums[e, BB], sums[e, AC], sums[e, BC]
        determinant = aa * bb - ab * ab
        if not determinant > 1e-6 * aa * bb:
            continue
        by_a, by_b = (bb * ac - ab * bc) / determinant, (aa * bc - ab * ac) / determinant
        left = sums[e, CC] - by_a * ac - by_b * bc
        if not left > 1e-3 * sums[e, CC]:
            continue
        pull = sums[e, C] - gradients.level_shift[e] * sums[e, SHARE_C]
        b = bend[e, 0] + (pull - by_a * gradients.start[e] - by_b * gradients.end[e]) / left
        for side in range(2):
            m = edges[e, side]
            total[m] += use[e] * b * b
            of_noise[m] += use[e] * variance / left
            known[m] += use[e]
    out = np.zeros(edges.shape[0])
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        square = min(rough[i], rough[j])
        seen = known[i] + known[j]
        if square > 0.0 and seen > 0.0:
            noise = (of_noise[i] + of_noise[j]) / seen
            shown = (total[i] + total[j]) / seen - noise * (1.0 + MIN_SIGNIFICANCE * np.sqrt(2.0 / seen))
            most = min(MAX_BEND_SHARE**2 * square, (MAX_BEND_DEVIATION * lines[e, LENGTH]) ** 2)
            out[e] = min(max(shown, MIN_BEND_SHARE**2 * square), most)
    return out


@compiled
def update_without_bending(sums, gradients, bend, loose, variance):  # type: ignore[no-untyped-def]
    """Take what bending explains out of the gridlines' sums and votes, in place; (E, 6) what their bending is: by
    itself, and against a shift of the start and of the end towards the normal.

    ``level_shift`` (E,) is as ``votes`` gives it, 0 where levels do not change; ``bend_variance`` as
    ``estimate_bend_variance`` does.
    """
    kept = np.zeros((sums.shape[0], 6))
    k = np.empty((2, 2))
    for e in range(sums.shape[0]):
        sums[e, READ_AA], sums[e, READ_BB] = sums[e, AA], sums[e, BB]
        if sums[e, AA] == 0.0:
            continue
        c = sums[e, C] - gradients.level_shift[e] * sums[e, SHARE_C]
        d = sums[e, D] - gradients.level_shift[e] * sums[e, SHARE_D]
        k[0, 0], k[0, 1], k[1, 0], k[1, 1] = sums[e, AC], sums[e, AD], sums[e, BC], sums[e, BD]
        x, y = -bend[e, 0], -bend[e, 1]
        if loose[e] > 0.0:
            stiff = variance / loose[e]
            cc, cd, dd = sums[e, CC] + stiff, sums[e, CD], sums[e, DD] + stiff
            inverse = 1.0 / (cc * dd - cd * cd)
            pull_c, pull_d = c + stiff * x, d + stiff * y
            x, y = (dd * pull_c - cd * pull_d) * inverse, (cc * pull_d - cd * pull_c) * inverse
            for end in range(2):
                kept[e, 2 + 2 * end] = (dd * k[end, 0] - cd * k[end, 1]) * inverse
                kept[e, 3 + 2 * end] = (cc * k[end, 1] - cd * k[end, 0]) * inverse
        kept[e, 0], kept[e, 1] = x, y
        sums[e, MISFIT] -= 2.0 * (x * c + y * d)
        sums[e, MISFIT] += x * x * sums[e, CC] + 2.0 * x * y * sums[e, CD] + y * y * sums[e, DD]
        gradients.start[e] -= k[0, 0] * x + k[0, 1] * y
        gradients.end[e] -= k[1, 0] * x + k[1, 1] * y
        sums[e, AA] -= k[0, 0] * kept[e, 2] + k[0, 1] * kept[e, 3]
        sums[e, AB] -= k[1, 0] * kept[e, 2] + k[1, 1] * kept[e, 3]
        sums[e, BB] -= k[1, 0] * kept[e, 4] + k[1, 1] * kept[e, 5]
    return kept


@compiled
def bend_after_shift(bend, kept, shift, lines, edges):  # type: ignore[no-untyped-def]
    """(E, 2) b and s after the markers were shifted (M, 2)."""
    out = np.zeros_like(bend)
    for e in range(bend.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        a, b = edges[e, 0], edges[e, 1]
        by_a = shift[a, 1] * lines[e, UX] - shift[a, 0] * lines[e, UY]
        by_b = shift[b, 1] * lines[e, UX] - shift[b, 0] * lines[e, UY]
        limit = MAX_BEND * lines[e, LENGTH]
        for k in range(2):
            change = kept[e, k] - kept[e, 2 + k] * by_a - kept[e, 4 + k] * by_b
            out[e, k] = min(max(bend[e, k] + change, -limit), limit)
    return out


@compiled
def bending_misfit(loose, contrasts, sigma):  # type: ignore[no-untyped-def]
    """(E,) the mean squared residual, one channel, that the gridlines' places off the fitted curve may make."""
    out = np.empty(loose.shape[0])
    for e in range(loose.shape[0]):
        strength = contrasts[e, 0] ** 2 + contrasts[e, 1] ** 2 + contrasts[e, 2] ** 2
        # of the squared normal density, over BAND to both sides
        share = strength / (3.0 * sigma * sigma) / (4.0 * BAND * np.sqrt(np.pi))
        out[e] = (
            min(MISFIT_TOLERANCE * BEND_TO_END_SHIFT**2 * loose[e], MAX_MISFIT_TOLERANCE * sigma * sigma)
            * share
        )
    return out


@compiled
def mean_at_markers(loose, spokes):  # type: ignore[no-untyped-def]
    """(M,) px^2, the mean of ``bend_variance`` (E,) over the gridlines at each marker."""
    out = np.zeros(spokes.shape[0])
    for m in range(spokes.shape[0]):
        known = 0
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0:
                out[m] += loose[e]
                known += 1
        out[m] /= max(known, 1)
    return out
