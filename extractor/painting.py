"""The pattern is drawn from its current markers, and cells of it are taken out again.

A pixel of the drawing is the share of each cell in it (``shares``) times the cell's level over black. Shares are kept:
to take a cell out, as much is subtracted as had been added, for a fraction of the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .gaussian import REACH
from .gridlines import KNOWN
from .shares import CHUNK, PX, PY, columns, fill_shares, lay_sides, opening_of, room_for_shares

KEPT_SHARES, KEPT_RUNS = (
    1 << 18,
    1 << 16,
)  # of what is drawn; more than that is drawn once more to be taken out
FIRST_RUN, RUNS, FIRST_SHARE = range(3)  # columns of a cell's strokes


class Strokes(NamedTuple):
    """What has been drawn.

    Attributes:
        cell: (K, 3) each cell's first run, their number (0: not kept) and first share.
        runs: (R, 3) x, y and number of pixels in a row of the image.
        shares: (S,) of a cell in these pixels.
        used: (2,) runs and shares.
    """

    cell: NDArray[np.int64]
    runs: NDArray[np.int32]
    shares: NDArray[np.float32]
    used: NDArray[np.int64]


def room_for_strokes(cells: int, shares: int = KEPT_SHARES) -> Strokes:
    """Nothing drawn yet of so many cells."""
    runs = np.empty((KEPT_RUNS, 3), np.int32)
    return Strokes(np.zeros((cells, 3), np.int64), runs, np.empty(shares, np.float32), np.zeros(2, np.int64))


@compiled
def _add(flat, at, first, count, shares, level, slope):  # type: ignore[no-untyped-def]
    """Add pixels of a row, from place ``at`` on, their levels ``level`` at the first and ``slope`` more at each next
    one, times their shares."""
    (l0, l1, l2), (s0, s1, s2) = level, slope
    one, two = np.uint64(1), np.uint64(2)
    here = np.uint64(at)
    for k in range(first, first + count):
        share = shares[k]
        flat[here] += share * l0
        flat[here + one] += share * l1
        flat[here + two] += share * l2
        here += np.uint64(3)
        l0 += s0
        l1 += s1
        l2 += s2


@compiled
def _add_runs(model, runs, shares, sense, level, slope, cx, cy):  # type: ignore[no-untyped-def]
    """Add ``sense`` times a cell's level, ``level`` at its centroid (cx, cy), to its runs (n, 3) of pixels."""
    flat, width, k = model.reshape(-1), model.shape[1], np.int64(0)
    change = np.float32(sense * slope[0, 0]), np.float32(sense * slope[1, 0]), np.float32(sense * slope[2, 0])
    for i in range(runs.shape[0]):
        x, y, own = np.int64(runs[i, 0]), np.int64(runs[i, 1]), np.int64(runs[i, 2])
        dx, dy = x - cx, y - cy
        start = (
            np.float32(sense * (level[0] + slope[0, 0] * dx + slope[0, 1] * dy)),
            np.float32(sense * (level[1] + slope[1, 0] * dx + slope[1, 1] * dy)),
            np.float32(sense * (level[2] + slope[2, 0] * dx + slope[2, 1] * dy)),
        )
        _add(flat, (y * width + x) * 3, k, own, shares, start, change)
        k += own


@compiled
def draw_cells(which, sense, xy, cells, cell_edges, edges, lines, levels, slopes, sigma, box, model, strokes):  # type: ignore[no-untyped-def]
    """Add ``sense`` times the levels over black of the cells that are chosen (K,) bool to the model, and keep their
    strokes as far as there is room, unless they are taken out."""
    inverse, side, openings = 1.0 / sigma, np.zeros((3, 9)), np.zeros(3)
    places, spare = np.zeros(2 * CHUNK, np.float32), np.empty(CHUNK, np.float32)
    spare_runs, room = np.empty((CHUNK, 3), np.int32), room_for_shares()
    kept, all_runs, all_shares, used = strokes
    for i in np.flatnonzero(which):
        kept[i, RUNS] = 0
        e, f, g = cell_edges[i]
        if lines[e, KNOWN] * lines[f, KNOWN] * lines[g, KNOWN] == 0.0:
            continue
        a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
        turn = 1.0 if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0 else -1.0
        bulge = lay_sides(cells[i], cell_edges[i], edges, lines, turn, inverse, side)
        for k in range(3):
            openings[k] = opening_of(side[k], side[(k + 1) % 3], sigma)
        cx, cy, far = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, REACH + bulge
        top = max(int(np.ceil(min(a[1], b[1], c[1]) - far * sigma)), box[1])
        bottom = min(int(max(a[1], b[1], c[1]) + far * sigma), box[3] - 1)
        left = max(np.ceil(min(a[0], b[0], c[0]) - far * sigma), float(box[0]))
        right = min(np.floor(max(a[0], b[0], c[0]) + far * sigma), box[2] - 1.0)
        x0, y0 = np.floor(cx), np.floor(cy)
        fits = sense > 0.0 and used[0] + CHUNK <= all_runs.shape[0]
        fits = fits and used[1] + CHUNK <= all_shares.shape[0]
        runs = all_runs[used[0] :] if fits else spare_runs
        shares = all_shares[used[1] :] if fits else spare
        filled, count = 0, 0
        for y in range(top, bottom + 1):
            low, high = columns(side, y, far, left, right)
            x, end = int(low), int(high)
            while x <= end:
                if count == CHUNK:
                    fill_shares(places, count, x0, y0, side, openings, far, room, shares)
                    _add_runs(model, runs[:filled], shares, sense, levels[i], slopes[i], cx, cy)
                    filled, count, fits = 0, 0, False
                own = min(end - x + 1, CHUNK - count)
                runs[filled, 0], runs[filled, 1], runs[filled, 2] = x, y, own
                filled += 1
                px, py = np.float32(x - x0), np.float32(y - y0)
                for k in range(count, count + own):
                    places[PX + k], places[PY + k] = px, py
                    px += np.float32(1.0)
                count += own
                x += own
        fill_shares(places, count, x0, y0, side, openings, far, room, shares)
        _add_runs(model, runs[:filled], shares, sense, levels[i], slopes[i], cx, cy)
        if fits:
            kept[i, FIRST_RUN], kept[i, RUNS], kept[i, FIRST_SHARE] = used[0], filled, used[1]
            used[0] += filled
            used[1] += count


@compiled
def erase_cells(which, xy, cells, cell_edges, edges, lines, levels, slopes, sigma, box, model, strokes):  # type: ignore[no-untyped-def]
    """Take the chosen cells (K,) bool out of the model, that were drawn with the same levels at the same places."""
    again = which.copy()
    kept, runs, shares, _ = strokes
    for i in np.flatnonzero(which):
        if kept[i, RUNS] > 0:
            a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
            cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
            own = runs[kept[i, FIRST_RUN] : kept[i, FIRST_RUN] + kept[i, RUNS]]
            _add_runs(model, own, shares[kept[i, FIRST_SHARE] :], -1.0, levels[i], slopes[i], cx, cy)
            again[i] = False
    if again.any():
        geometry = xy, cells, cell_edges, edges, lines
        draw_cells(again, -1.0, *geometry, levels, slopes, sigma, box, model, strokes)
