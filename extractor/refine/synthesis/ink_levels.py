"""The ink levels of one image: a level for every cell, from the cell itself and from all cells of its ink.

A cell's own level is noisy, and half of the error would go into its gridlines. Light and print vary smoothly from cell
to cell as a rule, and a low polynomial over the image, fitted robustly to each ink, is far less noisy. Every level is
drawn towards the polynomial in the proportion of noise in the cells' scatter about the polynomial. Where the scatter is
not noise (uneven print, hard shadows, a missing cell) the cell's own level stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.response import table_place
from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.ink_polynomials import TERMS, fill_monomials, robust_polynomial

INKS = 5  # red, green, blue, black, white
BLACK, WHITE = 3, 4
CELLS_FOR_TERMS = ((40, 10), (18, 6), (8, 3), (1, 1))  # from so many cells on, so many terms
DISC_SHARE = 0.55  # of the inscribed circle's radius, the disc of a cell's level at most
FIRST_DISC_SHARE = 0.47  # the same where nothing is drawn yet, and the neighbours' ink bleeds into the disc
CLEAR_SIGMA = 2.2  # in units of the blur, the distance of the disc from the cell's sides
MIN_RADIUS_PX = 0.75  # of the disc


class InkLevels(NamedTuple):
    """The levels of the inks in an image, as light (0 to 255).

    Attributes:
        cell: (K, 3) levels of the drawn cells over black, at their centroids.
        slope: (K, 3, 2) levels per px along x and y.
        black: (3, 10) the polynomial of the black.
        is_outlier: (K,) bool, cells that do not look like the other cells of their ink.
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
        variance: (5,) light^2, of the cells about the polynomials beyond noise.
        noise: (5,) light, root mean square of the channels, of a pixel.
    """

    coefficients: NDArray[np.float64]
    variance: NDArray[np.float64]
    noise: NDArray[np.float64]


@compiled
def cell_radii(a, b, c, sigma):  # type: ignore[no-untyped-def]
    """The radius of a cell's inscribed circle, and of the disc of its level about its centroid, px.

    ``a``, ``b``, ``c`` are the corners (2,) px; ``sigma`` is the blur, px, 0 where the pattern is drawn.
    """
    area = abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    perimeter = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    perimeter += np.sqrt((c[0] - b[0]) ** 2 + (c[1] - b[1]) ** 2)
    perimeter += np.sqrt((a[0] - c[0]) ** 2 + (a[1] - c[1]) ** 2)
    inscribed = area / max(perimeter, 1e-9)
    return inscribed, disc_radius(inscribed, sigma)


@compiled
def disc_radius(inscribed, sigma):  # type: ignore[no-untyped-def]
    """The radius of that disc, px, by the radius of the inscribed circle."""
    most = DISC_SHARE if sigma == 0.0 else FIRST_DISC_SHARE
    return max(min(most * inscribed, inscribed - CLEAR_SIGMA * sigma), MIN_RADIUS_PX)


@compiled
def cell_means(image, light, model, xy, cells, sigma):  # type: ignore[no-untyped-def]
    """The mean light of image - model over a disc about each cell's centroid.

    Args:
        image: (H, W, 3) uint8. light: (256,) of its values.
        model: (H, W, 3) float32, the drawn light, or empty for 0.
        xy: (M, 2) px, the markers. cells: (K, 3) marker ids.
        sigma: px, the blur; 0 where the pattern is drawn.

    Returns:
        (K, 4): the means, 0 to 255, and the number of pixels, 0 outside the image.
    """
    no_model = model.shape[0] == 0
    observed, drawn = image.reshape(-1), model.reshape(-1)
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
                s0 += light[observed[at]]
                s1 += light[observed[at + one]]
                s2 += light[observed[at + two]]
                if not no_model:
                    s0 -= drawn[at]
                    s1 -= drawn[at + one]
                    s2 -= drawn[at + two]
                at += np.uint64(3)
            count += max(last - first + 1, 0)
        if count > 0:
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = s0 / count, s1 / count, s2 / count, count
    return out


@compiled
def _fill_levels(own, centroids, color, inks, scale, levels):  # type: ignore[no-untyped-def]
    """Fill in the cells' levels over black and their slopes.

    Args:
        own: (K, 4), as ``cell_means`` gives them. centroids: (K, 2) in the frame of the polynomials.
        color: (K,) inks.
        inks: ``InkPolynomials``.
        scale: px, of the frame.
        levels: ``InkLevels`` with the outliers; ``cell`` and ``slope`` are filled.
    """
    terms, coefficients, variance, noise = np.empty(TERMS), inks.coefficients, inks.variance, inks.noise
    cell, slope, is_outlier = levels.cell, levels.slope, levels.is_outlier
    for i in range(own.shape[0]):
        x, y = centroids[i, 0], centroids[i, 1]
        if not np.isfinite(x):
            # a corner is unknown; the cell may be drawn in the next step, when that corner is predicted
            x, y = 0.0, 0.0
        fill_monomials(x, y, terms)
        c = color[i]
        known = own[i, 3] > 0.0
        own_share = 0.0
        if known:
            own_share = 1.0 if is_outlier[i] else variance[c] / (variance[c] + noise[c] ** 2 / own[i, 3])
        for channel in range(3):
            f, b = coefficients[c, channel], coefficients[BLACK, channel]
            level, black = 0.0, 0.0
            for k in range(TERMS):
                level += terms[k] * f[k]
                black += terms[k] * b[k]
            if known:
                level += own_share * (own[i, channel] - level)
            cell[i, channel] = level - black
            for axis in range(2):
                d = 0.0
                if not is_outlier[i]:
                    d = f[1 + axis] - b[1 + axis]
                    if axis == 0:
                        d += 2 * x * (f[3] - b[3]) + y * (f[4] - b[4]) + 3 * x * x * (f[6] - b[6])
                        d += 2 * x * y * (f[7] - b[7]) + y * y * (f[8] - b[8])
                    else:
                        d += x * (f[4] - b[4]) + 2 * y * (f[5] - b[5]) + x * x * (f[7] - b[7])
                        d += 2 * x * y * (f[8] - b[8]) + 3 * y * y * (f[9] - b[9])
                slope[i, channel, axis] = d / scale


@compiled
def _ink_samples(values, centroids, color, ink):  # type: ignore[no-untyped-def]
    """Terms (10, n), values (4, n) and numbers (n,) of the cells of an ink that lie in the image."""
    n = 0
    for i in range(values.shape[0]):
        if values[i, 3] > 0.0 and (ink == BLACK or color[i] == ink):
            n += 1
    terms, own, number = np.empty((TERMS, n)), np.empty((4, n)), np.empty(n, np.int64)
    n = 0
    for i in range(values.shape[0]):
        if values[i, 3] > 0.0 and (ink == BLACK or color[i] == ink):
            fill_monomials(centroids[i, 0], centroids[i, 1], terms[:, n])
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
def smoothed_levels(drawn, black, xy, pattern, noise, view):  # type: ignore[no-untyped-def]
    """The inks' levels, smoothed over the cells of each ink.

    Args:
        drawn: (K, 4) own levels of the drawn cells and their numbers of pixels, as ``cell_means`` gives them.
        black: (B, 4) the same for the black cells.
        xy: (M, 2) px, the markers, NaN where unknown.
        pattern: ``InkCells``.
        noise: gray levels, of the image's values.
        view: ``PyramidLevel``.

    Returns:
        ``InkLevels``.
    """
    frame, encoded = view.frame, view.response.encoded
    coefficients, variance, light_noise = np.zeros((INKS, 3, TERMS)), np.zeros(INKS), np.ones(INKS)
    is_outlier, color = np.zeros(drawn.shape[0], np.bool_), pattern.color
    centroids = _cell_centroids(xy, pattern.cells, frame)
    black_centroids = _cell_centroids(xy, pattern.black_cells, frame)
    for ink in range(INKS):
        if ink == BLACK:
            terms, own, number = _ink_samples(black, black_centroids, color, ink)
        else:
            terms, own, number = _ink_samples(drawn, centroids, color, ink)
        n = number.shape[0]
        if n == 0:
            continue
        count = 1
        for k in range(len(CELLS_FOR_TERMS)):
            if n >= CELLS_FOR_TERMS[k][0]:
                count = CELLS_FOR_TERMS[k][1]
                break
        light_noise[ink] = _light_noise(own, encoded, noise)
        polynomial, own_variance, own_outlier = robust_polynomial(terms, own, light_noise[ink], count)
        coefficients[ink], variance[ink] = polynomial, own_variance
        if ink == WHITE:  # one cell only, which keeps its own level
            variance[ink] = 1e9
        if ink != BLACK:
            for i in range(n):
                is_outlier[number[i]] = own_outlier[i]
    cell, slope = np.zeros((drawn.shape[0], 3)), np.zeros((drawn.shape[0], 3, 2))
    levels = InkLevels(cell, slope, coefficients[BLACK], is_outlier)
    inks = InkPolynomials(coefficients, variance, light_noise)
    _fill_levels(drawn, centroids, color, inks, frame.scale, levels)
    return levels


@compiled
def _light_noise(own, encoded, noise):  # type: ignore[no-untyped-def]
    """The noise of a pixel's light, root mean square of the channels, at the median levels of cells (4, n); ``noise``
    is that of the values."""
    total = 0.0
    for channel in range(3):
        total += (noise / encoded[table_place(np.median(own[channel])) + 1]) ** 2
    return np.sqrt(total / 3.0)


@compiled
def level_change(before, now):  # type: ignore[no-untyped-def]
    """The median change of the cells' levels (K, 3), in units of their median level."""
    sizes, changes = np.zeros(before.shape[0]), np.zeros(before.shape[0])
    for i in range(before.shape[0]):
        for channel in range(3):
            sizes[i] = max(sizes[i], abs(before[i, channel]))
            changes[i] = max(changes[i], abs(now[i, channel] - before[i, channel]))
    return np.median(changes) / max(np.median(sizes), 1e-9)
