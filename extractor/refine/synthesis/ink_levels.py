"""The inks as they look in this image: a level for every cell, from itself and from the cells of its ink.

A cell's own level is noisy, and half of its error would go into its gridlines. The light and the print vary smoothly
from cell to cell as a rule: a low polynomial over the image, fitted robustly to each ink, is far less noisy. Every
level is drawn towards it by as much as the cells' scatter about it is noise; where it is not (uneven print, hard
shadows, a cell that fell out) the cell's own level stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, vectorized
from extractor.numeric.dense_systems import update_to_cholesky_solution

INKS = 5  # red, green, blue, black, white
BLACK, WHITE = 3, 4
TERMS = 10  # 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy
CELLS_FOR_TERMS = ((40, 10), (18, 6), (8, 3), (1, 1))
DISC_SHARE = 0.55  # of the inscribed circle, over which a cell's level is averaged at most
FIRST_DISC_SHARE = 0.47  # where nothing is drawn yet, and the neighbours' ink reaches into it
CLEAR_SIGMA = 2.2  # blurs that its pixels keep off the cell's sides
MIN_RADIUS_PX = 0.75
FIT_ROUNDS = 2  # of the robust fit
OUTLIER_TOLERANCE = 4.0  # scatters, beyond which a cell is one of its own kind


class InkLevels(NamedTuple):
    """Attributes:
    cell: (K, 3) level of the drawn cells over the black beneath, at their centroids.
    slope: (K, 3, 2) its change per px along x and y.
    black: (3, 10) the black's polynomial.
    strange: (K,) bool, cells whose ink is not that of their kind.
    """

    cell: NDArray[np.float64]
    slope: NDArray[np.float64]
    black: NDArray[np.float64]
    is_outlier: NDArray[np.bool_]


class InkCells(NamedTuple):
    """The cells of the pattern by ink.

    Attributes:
        cells: (K, 3) marker ids of the drawn cells.
        black_cells: (B, 3) marker ids of the black cells.
        color: (K,) inks of the drawn cells.
    """

    cells: NDArray[np.int32]
    black_cells: NDArray[np.int32]
    color: NDArray[np.int32]


class InkPolynomials(NamedTuple):
    """The inks as polynomials over the image.

    Attributes:
        coefficients: (5, 3, 10) by ink and channel.
        variance: (5,) gray levels^2, of the cells about the polynomials beyond noise.
    """

    coefficients: NDArray[np.float64]
    variance: NDArray[np.float64]


class LevelChange(NamedTuple):
    """A change of the inks' levels.

    Attributes:
        cell: (K, 3) gray levels, of the drawn cells over black.
        black: (3, 10) of the black polynomial.
    """

    cell: NDArray[np.float64]
    black: NDArray[np.float64]


@compiled
def fill_monomials(x, y, out):  # type: ignore[no-untyped-def]
    """Write the ten terms at (x, y)."""
    out[0], out[1], out[2] = 1.0, x, y
    out[3], out[4], out[5] = x * x, x * y, y * y
    out[6], out[7], out[8], out[9] = x * x * x, x * x * y, x * y * y, y * y * y


@compiled
def cell_radii(a, b, c, sigma):  # type: ignore[no-untyped-def]
    """The radius of a cell's inscribed circle, and of the disc about its centroid that its level is taken from."""
    area = abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    around = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    around += np.sqrt((c[0] - b[0]) ** 2 + (c[1] - b[1]) ** 2)
    around += np.sqrt((a[0] - c[0]) ** 2 + (a[1] - c[1]) ** 2)
    inscribed = area / max(around, 1e-9)
    return inscribed, disc_radius(inscribed, sigma)


@compiled
def disc_radius(inscribed, sigma):  # type: ignore[no-untyped-def]
    """The radius of that disc, by the inscribed circle's."""
    most = DISC_SHARE if sigma == 0.0 else FIRST_DISC_SHARE
    return max(min(most * inscribed, inscribed - CLEAR_SIGMA * sigma), MIN_RADIUS_PX)


@compiled
def cell_means(image, model, xy, cells, sigma):  # type: ignore[no-untyped-def]
    """(K, 4): each cell's mean of image - model over the pixels about its centroid, and their number (0: none).

    ``model`` may be empty; ``sigma`` is the blur.
    """
    bare = model.shape[0] == 0
    seen, drawn = image.reshape(-1), model.reshape(-1)
    one, two = np.uint64(1), np.uint64(2)
    height, width = image.shape[0], image.shape[1]
    out = np.zeros((cells.shape[0], 4))
    for i in range(cells.shape[0]):
        a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
        cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        if not (cx >= 0.0 and cy >= 0.0 and cx <= width - 1.0 and cy <= height - 1.0):
            continue
        _, radius = cell_radii(a, b, c, sigma)
        count, s0, s1, s2 = 0, 0.0, 0.0, 0.0
        for y in range(max(int(np.ceil(cy - radius)), 0), min(int(cy + radius), height - 1) + 1):
            half = np.sqrt(max(radius * radius - (y - cy) ** 2, 0.0))
            first, last = max(int(np.ceil(cx - half)), 0), min(int(cx + half), width - 1)
            at = np.uint64((y * width + first) * 3)
            for _ in range(first, last + 1):
                s0 += seen[at]
                s1 += seen[at + one]
                s2 += seen[at + two]
                if not bare:
                    s0 -= drawn[at]
                    s1 -= drawn[at + one]
                    s2 -= drawn[at + two]
                at += np.uint64(3)
            count += max(last - first + 1, 0)
        if count > 0:
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = s0 / count, s1 / count, s2 / count, count
    return out


@vectorized
def _fill_normal_equations(terms, values, weight, gram, right):  # type: ignore[no-untyped-def]
    """Fill in the sums over all cells of weight times term times term (its lower triangle), and times value."""
    weighted = np.empty(weight.shape[0])
    for j in range(TERMS):
        for i in range(weight.shape[0]):
            weighted[i] = weight[i] * terms[j, i]
        for k in range(j, TERMS):
            other, total = terms[k], 0.0
            for i in range(weight.shape[0]):
                total += weighted[i] * other[i]
            gram[k, j] = total
        for channel in range(3):
            other, total = values[channel], 0.0
            for i in range(weight.shape[0]):
                total += weighted[i] * other[i]
            right[channel, j] = total


@compiled
def _fill_polynomial_fit(terms, values, weight, count, gram, right):  # type: ignore[no-untyped-def]
    """Write the weighted least squares polynomial with the first ``count`` terms, a little held towards 0, into
    ``right`` (3, 10)."""
    _fill_normal_equations(terms, values, weight, gram, right)
    right[:, count:] = 0.0
    if not gram[0, 0] > 0.0:
        right[:] = 0.0
        return
    for j in range(1, count):
        gram[j, j] += 1e-6 * gram[0, 0]
    update_to_cholesky_solution(gram, right, count)


@vectorized
def _fill_misfits(terms, values, field, out):  # type: ignore[no-untyped-def]
    """Mean squared distance of each cell's level from the polynomial."""
    rest = np.empty(out.shape[0])
    out[:] = 0.0
    for channel in range(3):
        rest[:] = values[channel]
        for k in range(TERMS):
            factor, row = field[channel, k], terms[k]
            for i in range(out.shape[0]):
                rest[i] -= factor * row[i]
        for i in range(out.shape[0]):
            out[i] += rest[i] * rest[i] / 3.0


@compiled
def _robust_polynomial(terms, values, noise, count, rounds):  # type: ignore[no-untyped-def]
    """An ink's polynomial (3, 10), the variance of its cells about it beyond noise, and (n,) which are strange.

    ``terms`` (10, n) and ``values`` (4, n) are columns a cell; the fourth value is the number of pixels.
    """
    n = terms.shape[1]
    weight, misfit = np.empty(n), np.zeros(n)
    for i in range(n):
        weight[i] = values[3, i] / (1.0 + 0.1 * values[3, i])
    start, gram, field = weight.copy(), np.empty((TERMS, TERMS)), np.empty((3, TERMS))
    _fill_polynomial_fit(terms, values, weight, count, gram, field)
    for _ in range(rounds):
        _fill_misfits(terms, values, field, misfit)
        # 0.79 is the median of a chi-square of 3 degrees over 3
        spread = np.median(misfit) / 0.79
        for i in range(n):
            weight[i] = start[i] / (1.0 + misfit[i] / (6.0 * spread + 1e-9)) ** 2
        _fill_polynomial_fit(terms, values, weight, count, gram, field)
    _fill_misfits(terms, values, field, misfit)
    spread = np.median(misfit) / 0.79
    expected = noise * noise / np.median(values[3])
    strange = np.zeros(n, np.bool_)
    for i in range(n):
        strange[i] = misfit[i] > OUTLIER_TOLERANCE**2 * (spread + noise * noise / values[3, i]) + 4.0
    return field, max(spread * n / max(n - count, 1) - 1.15 * expected, 0.0), strange


@compiled
def _fill_levels(own, place, color, noise, inks, scale, levels):  # type: ignore[no-untyped-def]
    """Fill in the cells' levels over black and their slopes, in ``levels``, the outliers of which are known."""
    terms, fields, spreads = np.empty(TERMS), inks.coefficients, inks.variance
    cell, slope, strange = levels.cell, levels.slope, levels.is_outlier
    for i in range(own.shape[0]):
        x, y = place[i, 0], place[i, 1]
        if not np.isfinite(x):
            # a corner is unknown; its cell may be drawn in the next step, when it has been put
            x, y = 0.0, 0.0
        fill_monomials(x, y, terms)
        c = color[i]
        known = own[i, 3] > 0.0
        keep = 0.0
        if known:
            keep = 1.0 if strange[i] else spreads[c] / (spreads[c] + noise * noise / own[i, 3])
        for channel in range(3):
            f, b = fields[c, channel], fields[BLACK, channel]
            level, below = 0.0, 0.0
            for k in range(TERMS):
                level += terms[k] * f[k]
                below += terms[k] * b[k]
            if known:
                level += keep * (own[i, channel] - level)
            cell[i, channel] = level - below
            for axis in range(2):
                d = 0.0
                if not strange[i]:
                    d = f[1 + axis] - b[1 + axis]
                    if axis == 0:
                        d += 2 * x * (f[3] - b[3]) + y * (f[4] - b[4]) + 3 * x * x * (f[6] - b[6])
                        d += 2 * x * y * (f[7] - b[7]) + y * y * (f[8] - b[8])
                    else:
                        d += x * (f[4] - b[4]) + 2 * y * (f[5] - b[5]) + x * x * (f[7] - b[7])
                        d += 2 * x * y * (f[8] - b[8]) + 3 * y * y * (f[9] - b[9])
                slope[i, channel, axis] = d / scale


@compiled
def _ink_samples(values, place, color, ink):  # type: ignore[no-untyped-def]
    """Terms (10, n), values (4, n) and numbers (n,) of an ink's cells that can be seen."""
    n = 0
    for i in range(values.shape[0]):
        if values[i, 3] > 0.0 and (ink == BLACK or color[i] == ink):
            n += 1
    terms, own, number = np.empty((TERMS, n)), np.empty((4, n)), np.empty(n, np.int64)
    n = 0
    for i in range(values.shape[0]):
        if values[i, 3] > 0.0 and (ink == BLACK or color[i] == ink):
            fill_monomials(place[i, 0], place[i, 1], terms[:, n])
            own[:, n], number[n] = values[i], i
            n += 1
    return terms, own, number


@compiled
def _cell_centroids(xy, cells, frame):  # type: ignore[no-untyped-def]
    """(K, 2) the centroids of cells in the frame of the polynomials, NaN where a corner is unknown."""
    out = np.empty((cells.shape[0], 2))
    for i in range(cells.shape[0]):
        a, b, c = cells[i, 0], cells[i, 1], cells[i, 2]
        out[i, 0] = ((xy[a, 0] + xy[b, 0] + xy[c, 0]) / 3 - frame.x) / frame.scale
        out[i, 1] = ((xy[a, 1] + xy[b, 1] + xy[c, 1]) / 3 - frame.y) / frame.scale
    return out


@compiled
def smoothed_levels(drawn, black, xy, pattern, noise, frame):  # type: ignore[no-untyped-def]
    """The inks' levels, smoothed over the cells of each ink.

    Args:
        drawn: (K, 4) own levels of the drawn cells and their numbers of pixels, as ``cell_means`` gives them.
        black: (B, 4) the same for the black cells.
        xy: (M, 2) px, the markers, NaN where unknown.
        pattern: ``InkCells``.
        noise: gray levels.
        frame: ``PolynomialFrame``.

    Returns:
        ``InkLevels``.
    """
    fields, spreads = np.zeros((INKS, 3, TERMS)), np.zeros(INKS)
    strange, color = np.zeros(drawn.shape[0], np.bool_), pattern.color
    place = _cell_centroids(xy, pattern.cells, frame)
    place_black = _cell_centroids(xy, pattern.black_cells, frame)
    for ink in range(INKS):
        if ink == BLACK:
            terms, own, number = _ink_samples(black, place_black, color, ink)
        else:
            terms, own, number = _ink_samples(drawn, place, color, ink)
        n = number.shape[0]
        if n == 0:
            continue
        count = 1
        for k in range(len(CELLS_FOR_TERMS)):
            if n >= CELLS_FOR_TERMS[k][0]:
                count = CELLS_FOR_TERMS[k][1]
                break
        field, spread, odd = _robust_polynomial(terms, own, noise, count, FIT_ROUNDS)
        fields[ink], spreads[ink] = field, spread
        if ink == WHITE:  # alone of its kind
            spreads[ink] = 1e9
        if ink != BLACK:
            for i in range(n):
                strange[number[i]] = odd[i]
    cell, slope = np.zeros((drawn.shape[0], 3)), np.zeros((drawn.shape[0], 3, 2))
    levels = InkLevels(cell, slope, fields[BLACK], strange)
    _fill_levels(drawn, place, color, noise, InkPolynomials(fields, spreads), frame.scale, levels)
    return levels


@compiled
def level_change(before, now):  # type: ignore[no-untyped-def]
    """The cells' median change of level (K, 3), over their median level."""
    sizes, changes = np.zeros(before.shape[0]), np.zeros(before.shape[0])
    for i in range(before.shape[0]):
        for channel in range(3):
            sizes[i] = max(sizes[i], abs(before[i, channel]))
            changes[i] = max(changes[i], abs(now[i, channel] - before[i, channel]))
    return np.median(changes) / max(np.median(sizes), 1e-9)


@compiled
def black_levels_at(black, xy, frame):  # type: ignore[no-untyped-def]
    """(K, 3): the black's polynomial at the points (K, 2) px."""
    out, terms = np.zeros((xy.shape[0], 3)), np.empty(TERMS)
    for i in range(xy.shape[0]):
        fill_monomials((xy[i, 0] - frame.x) / frame.scale, (xy[i, 1] - frame.y) / frame.scale, terms)
        for channel in range(3):
            for k in range(TERMS):
                out[i, channel] += terms[k] * black[channel, k]
    return out
