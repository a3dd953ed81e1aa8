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

from .engine import compiled
from .mesh import Mesh

INKS = 5  # red, green, blue, black, white
BLACK, WHITE = 3, 4
TERMS = 10  # 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy
CELLS_FOR_TERMS = ((40, 10), (18, 6), (8, 3), (1, 1))
DISC = 0.45  # of the inscribed circle, over which a cell's level is averaged
ROUNDS = 4  # of the robust fit
TOLERANCE = 4.0  # scatters, beyond which a cell is one of its own kind


class Frame(NamedTuple):
    """The image coordinates of the polynomials: (x - x) / scale, (y - y) / scale."""

    x: float
    y: float
    scale: float


class Levels(NamedTuple):
    """Attributes:
    cell: (K, 3) level of the drawn cells over the black beneath, at their centroids.
    slope: (K, 3, 2) its change per px along x and y.
    black: (3, 10) the black's polynomial.
    own: (K, 3) the drawn cells' own absolute levels, NaN where unknown.
    own_black: (B, 3) the black cells' own levels, NaN where unknown.
    strange: (K,) bool, cells whose ink is not that of their kind.
    """

    cell: NDArray[np.float64]
    slope: NDArray[np.float64]
    black: NDArray[np.float64]
    own: NDArray[np.float64]
    own_black: NDArray[np.float64]
    strange: NDArray[np.bool_]


@compiled
def monomials(x, y, out):  # type: ignore[no-untyped-def]
    """Write the ten terms at (x, y)."""
    out[0], out[1], out[2] = 1.0, x, y
    out[3], out[4], out[5] = x * x, x * y, y * y
    out[6], out[7], out[8], out[9] = x * x * x, x * x * y, x * y * y, y * y * y


@compiled
def cell_means(image, xy, cells):  # type: ignore[no-untyped-def]
    """(K, 4): each cell's mean over the pixels about its centroid, and their number (0: nothing to see).

    ``image`` is (H, W, 3), of any type, its residual as well.
    """
    height, width = image.shape[0], image.shape[1]
    out = np.zeros((cells.shape[0], 4))
    for i in range(cells.shape[0]):
        a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
        cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        if not (cx >= 0.0 and cy >= 0.0 and cx <= width - 1.0 and cy <= height - 1.0):
            continue
        area = abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        around = np.hypot(b[0] - a[0], b[1] - a[1]) + np.hypot(c[0] - b[0], c[1] - b[1])
        around += np.hypot(a[0] - c[0], a[1] - c[1])
        radius = max(DISC * area / max(around, 1e-9), 0.75)
        count = 0
        for y in range(max(int(np.ceil(cy - radius)), 0), min(int(cy + radius), height - 1) + 1):
            for x in range(max(int(np.ceil(cx - radius)), 0), min(int(cx + radius), width - 1) + 1):
                if (x - cx) ** 2 + (y - cy) ** 2 <= radius * radius:
                    count += 1
                    for channel in range(3):
                        out[i, channel] += image[y, x, channel]
        if count > 0:
            for channel in range(3):
                out[i, channel] /= count
            out[i, 3] = count
    return out


@compiled
def _fit(terms, values, weight, count):  # type: ignore[no-untyped-def]
    """(3, 10): the weighted least squares polynomial with the first ``count`` terms, a little held towards 0."""
    gram, right = np.zeros((count, count)), np.zeros((count, 3))
    for i in range(terms.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        for j in range(count):
            for k in range(j + 1):
                gram[j, k] += w * terms[i, j] * terms[i, k]
            for channel in range(3):
                right[j, channel] += w * terms[i, j] * values[i, channel]
    for j in range(count):
        for k in range(j):
            gram[k, j] = gram[j, k]
    for j in range(1, count):
        gram[j, j] += 1e-6 * gram[0, 0] + 1e-12
    out = np.zeros((3, TERMS))
    if gram[0, 0] > 0.0:
        solved = np.linalg.solve(gram, right)
        for j in range(count):
            for channel in range(3):
                out[channel, j] = solved[j, channel]
    return out


@compiled
def _field(terms, values, samples, noise, count):  # type: ignore[no-untyped-def]
    """An ink's polynomial (3, 10), the variance of its cells about it beyond noise, and (n,) which are strange."""
    n = terms.shape[0]
    weight = np.empty(n)
    for i in range(n):
        weight[i] = samples[i] / (1.0 + 0.1 * samples[i])
    start = weight.copy()
    misfit, spread = np.empty(n), 0.0
    field = np.zeros((3, TERMS))
    for _ in range(ROUNDS):
        field = _fit(terms, values, weight, count)
        for i in range(n):
            misfit[i] = 0.0
            for channel in range(3):
                misfit[i] += (values[i, channel] - (terms[i] * field[channel]).sum()) ** 2 / 3.0
        # 0.79 is the median of a chi-square of 3 degrees over 3
        spread = np.median(misfit) / 0.79
        for i in range(n):
            weight[i] = start[i] / (1.0 + misfit[i] / (6.0 * spread + 1e-9)) ** 2
    expected = np.median(noise * noise / samples)
    strange = np.zeros(n, np.bool_)
    for i in range(n):
        strange[i] = misfit[i] > TOLERANCE**2 * (spread + noise * noise / samples[i]) + 4.0
    return field, max(spread * n / max(n - count, 1) - 1.15 * expected, 0.0), strange


@compiled
def _shrunk(own, samples, place, color, noise, fields, spreads, strange, black, cell, slope, scale):  # type: ignore[no-untyped-def]
    """Fill in the cells' levels over black and their slopes."""
    terms = np.empty(TERMS)
    for i in range(own.shape[0]):
        x, y = place[i]
        monomials(x, y, terms)
        c = color[i]
        known = samples[i] > 0
        keep = 0.0
        if known:
            keep = 1.0 if strange[i] else spreads[c] / (spreads[c] + noise * noise / samples[i])
        for channel in range(3):
            f, b = fields[c, channel], black[channel]
            level = (terms * f).sum()
            if known:
                level += keep * (own[i, channel] - level)
            cell[i, channel] = level - (terms * b).sum()
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


def _places(xy: NDArray[np.float64], cells: NDArray[np.int32], frame: Frame) -> NDArray[np.float64]:
    return (xy[cells].mean(axis=1) - (frame.x, frame.y)) / frame.scale


def _terms(place: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y = place.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3], axis=1)


def smooth_levels(
    drawn: NDArray[np.float64],
    black: NDArray[np.float64],
    xy: NDArray[np.float64],
    mesh: Mesh,
    noise: float,
    frame: Frame,
) -> Levels:
    """Levels from the cells' own ones.

    Args:
        drawn: (K, 4) own levels of the drawn cells and the pixels behind them, as ``cell_means`` gives them.
        black: (B, 4) the same for the black cells.
        xy: (M, 2) the markers, NaN where unknown.
        noise: grey levels.
    """
    fields, spreads = np.zeros((INKS, 3, TERMS)), np.zeros(INKS)
    strange = np.zeros(len(drawn), np.bool_)
    place, place_black = _places(xy, mesh.cells, frame), _places(xy, mesh.black, frame)
    for ink in range(INKS):
        own, at = (black, place_black) if ink == BLACK else (drawn, place)
        members = np.flatnonzero((own[:, 3] > 0) & ((ink == BLACK) | (_color(mesh, len(own), ink) == ink)))
        if len(members) == 0:
            fields[ink] = fields[BLACK] if ink == WHITE else 0.0
            continue
        count = next(terms for cells, terms in CELLS_FOR_TERMS if len(members) >= cells)
        field, spread, odd = _field(_terms(at[members]), own[members, :3], own[members, 3], noise, count)
        fields[ink], spreads[ink] = field, spread if ink != WHITE else 1e9
        if ink != BLACK:
            strange[members] = odd
    cell, slope = np.zeros((len(drawn), 3)), np.zeros((len(drawn), 3, 2))
    seen = np.where(np.isfinite(place[:, 0]), drawn[:, 3], 0.0)
    _shrunk(
        drawn, seen, place, mesh.cell_color, noise, fields, spreads, strange, fields[BLACK], cell, slope, frame.scale
    )
    return Levels(cell, slope, fields[BLACK], drawn, black, strange)


def _color(mesh: Mesh, count: int, ink: int) -> NDArray[np.int32]:
    return mesh.cell_color if ink != BLACK else np.full(count, BLACK, np.int32)


def black_at(
    black: NDArray[np.float64], xy: NDArray[np.float64], cells: NDArray[np.int32] | None, frame: Frame
) -> NDArray[np.float64]:
    """(K, 3): a polynomial at the centroids of cells; of groups of points (K, n, 2) without ``cells``."""
    points = xy[cells] if cells is not None else xy
    place = (points.mean(axis=1) - (frame.x, frame.y)) / frame.scale
    return np.asarray(_terms(place) @ black.T)
