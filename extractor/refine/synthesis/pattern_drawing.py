"""The pattern is drawn from its current markers, and cells of it are taken out again.

A pixel of the drawing is the share of each cell in it (``coverages``) times the cell's level over black. Shares are
kept:
to take a cell out, as much is subtracted as had been added, for a fraction of the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.gaussian import CORNER_TERMS, NORMAL_REACH
from extractor.refine.synthesis.cell_coverage import (
    CHUNK,
    COLUMN,
    PX,
    PY,
    SIDE_COLUMNS,
    fill_corners,
    fill_coverage,
    fill_pixels,
    fill_row_ends,
    fill_sides,
)
from extractor.refine.synthesis.gridlines import KNOWN
from extractor.refine.synthesis.pixel_rows import LANES, padded_count

MAX_COVERAGES, MAX_RUNS = (
    1 << 18,
    1 << 16,
)  # of what is drawn; more than that is drawn once more to be taken out
FIRST_RUN, RUN_COUNT, FIRST_COVERAGE = range(3)  # columns of a cell's strokes


class CoverageRuns(NamedTuple):
    """What has been drawn.

    Attributes:
        cell: (K, 3) each cell's first run, their number (0: not kept) and first share.
        runs: (R, 3) x, y and number of pixels in a row of the image.
        shares: (S,) of a cell in these pixels.
        used: (2,) runs and shares.
    """

    cell: NDArray[np.int64]
    runs: NDArray[np.int32]
    coverages: NDArray[np.float32]
    used: NDArray[np.int64]


def allocate_coverage_runs(cells: int, shares: int = MAX_COVERAGES) -> CoverageRuns:
    """Nothing drawn yet of so many cells."""
    runs = np.empty((MAX_RUNS, 3), np.int32)
    return CoverageRuns(
        np.zeros((cells, 3), np.int64), runs, np.empty(shares, np.float32), np.zeros(2, np.int64)
    )


@inlined_no_refcount
def _fill_colors(places, count, shares, x0, y0, level, slope, sense, colors):  # type: ignore[no-untyped-def]
    """Fill in the three channels of pixels: ``sense`` times a cell's level, which is ``level`` at (x0, y0), where their
    places count from, times their shares."""
    f = np.float32
    l0, l1, l2 = f(sense * level[0]), f(sense * level[1]), f(sense * level[2])
    r0, r1, r2 = f(sense * slope[0, 0]), f(sense * slope[1, 0]), f(sense * slope[2, 0])
    d0, d1, d2 = f(sense * slope[0, 1]), f(sense * slope[1, 1]), f(sense * slope[2, 1])
    x0, y0 = f(x0), f(y0)
    for k in range(padded_count(count)):
        x, y, share = places[PX + k] - x0, places[PY + k] - y0, shares[k]
        colors[3 * k] = share * (l0 + r0 * x + d0 * y)
        colors[3 * k + 1] = share * (l1 + r1 * x + d1 * y)
        colors[3 * k + 2] = share * (l2 + r2 * x + d2 * y)


@inlined_no_refcount
def _add_colors(flat, width, runs, colors):  # type: ignore[no-untyped-def]
    """Add the three channels of pixels to their runs (n, 3) in a flat image."""
    first = np.uint64(0)
    for i in range(runs.shape[0]):
        at, own = np.uint64(3 * (runs[i, 1] * width + runs[i, 0])), np.int32(3 * runs[i, 2])
        # whole lanes, of which those beyond the row are masked: a rest would be added one by one
        for j in range(padded_count(own)):
            k = np.uint64(j)
            if np.int32(j) < own:
                flat[at + k] += colors[first + k]
        first += np.uint64(own)


@inlined_no_refcount
def _fill_runs(x, y, top, bottom, low, high, x0, y0, places, runs):  # type: ignore[no-untyped-def]
    """Lay out the pixels between the ends of rows, from (x, y) on, as many as there is room for; where the next one
    is, and how many runs and pixels they are."""
    filled, count = 0, 0
    while y <= bottom:
        x, end = max(x, int(np.ceil(low[y - top]))), int(np.floor(high[y - top]))
        own = min(end - x + 1, CHUNK - count)
        if own > 0:
            runs[filled, 0], runs[filled, 1], runs[filled, 2] = x, y, own
            fill_pixels(places, count, own, x - x0, y - y0)
            filled += 1
            count += own
            x += own
        if x <= end:
            break
        x, y = 0, y + 1
    return x, y, filled, count


@inlined_no_refcount
def _draw_cell(i, sense, geometry, ink, canvas, room):  # type: ignore[no-untyped-def]
    """Draw a cell, and keep its strokes where it is added and there is room."""
    (xy, cells, cell_edges, edges, lines), (levels, slopes, sigma, box) = geometry, ink
    flat, width, (kept, all_runs, all_shares, used) = canvas
    side, corners, places, distances, colors, shares, runs, low, high = room
    a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
    turn = 1.0 if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0 else -1.0
    far = NORMAL_REACH + fill_sides(cells[i], cell_edges[i], edges, lines, turn, 1.0 / sigma, side)
    fill_corners(side, sigma, corners)
    top = max(int(np.ceil(min(a[1], b[1], c[1]) - far * sigma)), box[1])
    bottom = min(int(max(a[1], b[1], c[1]) + far * sigma), box[3] - 1)
    left = max(np.ceil(min(a[0], b[0], c[0]) - far * sigma), float(box[0]))
    right = min(np.floor(max(a[0], b[0], c[0]) + far * sigma), box[2] - 1.0)
    fill_row_ends(side, top, max(bottom + 1 - top, 0), far, left, right, low, high)
    cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
    x0, y0 = np.floor(cx), np.floor(cy)
    fits = sense > 0.0 and used[0] + CHUNK <= all_runs.shape[0] and used[1] + CHUNK <= all_shares.shape[0]
    if fits:
        runs, shares = all_runs[used[0] :], all_shares[used[1] :]
    x, y, filled, count = 0, top, 0, 0
    while y <= bottom:
        x, y, filled, count = _fill_runs(x, y, top, bottom, low, high, x0, y0, places, runs)
        fits = fits and y > bottom
        fill_coverage(places, count, x0, y0, side, corners, far, distances, shares)
        _fill_colors(places, count, shares, cx - x0, cy - y0, levels[i], slopes[i], sense, colors)
        _add_colors(flat, width, runs[:filled], colors)
    if fits:
        kept[i, FIRST_RUN], kept[i, RUN_COUNT], kept[i, FIRST_COVERAGE] = used[0], filled, used[1]
        used[0] += filled
        used[1] += count


@inlined_no_refcount
def _update_erasing_cell(i, xy, cells, levels, slopes, canvas, places, colors):  # type: ignore[no-untyped-def]
    """Take out a cell whose strokes are kept."""
    flat, width, (kept, runs, shares, _) = canvas
    a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
    cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
    x0, y0, count = np.floor(cx), np.floor(cy), 0
    own = runs[kept[i, FIRST_RUN] : kept[i, FIRST_RUN] + kept[i, RUN_COUNT]]
    for k in range(own.shape[0]):
        fill_pixels(places, count, own[k, 2], own[k, 0] - x0, own[k, 1] - y0)
        count += own[k, 2]
    at = shares[kept[i, FIRST_COVERAGE] :]
    _fill_colors(places, count, at, cx - x0, cy - y0, levels[i], slopes[i], -1.0, colors)
    _add_colors(flat, width, own, colors)


@compiled
def _cell_buffers(height):  # type: ignore[no-untyped-def]
    """Arrays for one cell: its sides and corners; its pixels' places, distances inside the sides, colors, shares and
    runs; and the rows' ends."""
    side, corners = np.zeros((3, SIDE_COLUMNS)), np.zeros((3, CORNER_TERMS), np.float32)
    places, distances = np.zeros(2 * COLUMN, np.float32), np.empty(3 * COLUMN, np.float32)
    colors, shares = np.empty(3 * CHUNK, np.float32), np.empty(CHUNK, np.float32)
    runs, low, high = np.empty((CHUNK, 3), np.int32), np.empty(height + LANES), np.empty(height + LANES)
    return side, corners, places, distances, colors, shares, runs, low, high


@compiled
def draw_cells(which, sense, xy, cells, cell_edges, edges, lines, levels, slopes, sigma, box, model, strokes):  # type: ignore[no-untyped-def]
    """Add ``sense`` times the levels over black of the cells that are chosen (K,) bool to the model, and keep their
    strokes as far as there is room, unless they are taken out."""
    geometry, ink = (xy, cells, cell_edges, edges, lines), (levels, slopes, sigma, box)
    canvas = model.reshape(-1), model.shape[1], strokes
    _draw_listed_cells(np.flatnonzero(which), sense, geometry, ink, canvas, _cell_buffers(model.shape[0]))


@inlined_no_refcount
def _draw_listed_cells(some, sense, geometry, ink, canvas, room):  # type: ignore[no-untyped-def]
    """The same for the cells of these numbers (n,)."""
    cell_edges, lines, kept = geometry[2], geometry[4], canvas[2].cell
    for i in some:
        kept[i, RUN_COUNT] = 0
        e, f, g = cell_edges[i, 0], cell_edges[i, 1], cell_edges[i, 2]
        if lines[e, KNOWN] * lines[f, KNOWN] * lines[g, KNOWN] > 0.0:
            _draw_cell(i, sense, geometry, ink, canvas, room)


@compiled
def update_erasing_cells(  # type: ignore[no-untyped-def]
    which, xy, cells, cell_edges, edges, lines, levels, slopes, sigma, box, model, strokes
):
    """Take the chosen cells (K,) bool out of the model, that were drawn with the same levels at the same places."""
    some, canvas = np.flatnonzero(which), (model.reshape(-1), model.shape[1], strokes)
    places, colors = np.zeros(2 * COLUMN, np.float32), np.empty(3 * CHUNK, np.float32)
    left = some[: _update_erasing_listed_cells(some, xy, cells, levels, slopes, canvas, places, colors)]
    if left.shape[0] > 0:
        geometry, ink = (xy, cells, cell_edges, edges, lines), (levels, slopes, sigma, box)
        _draw_listed_cells(left, -1.0, geometry, ink, canvas, _cell_buffers(model.shape[0]))


@inlined_no_refcount
def _update_erasing_listed_cells(some, xy, cells, levels, slopes, canvas, places, colors):  # type: ignore[no-untyped-def]
    """Take out those of the cells (n,) whose strokes are kept; how many are not, which come first then."""
    left = 0
    for i in some:
        if canvas[2].cell[i, RUN_COUNT] > 0:
            _update_erasing_cell(i, xy, cells, levels, slopes, canvas, places, colors)
        else:
            some[left] = i
            left += 1
    return left
