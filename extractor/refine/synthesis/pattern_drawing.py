"""Drawing of the pattern from its current markers, and erasing of single cells.

A pixel of the drawing is the sum over the cells of the cell's share in that pixel (``cell_coverage``) times its level
over black. The shares are kept: erasing subtracts what was added, for a fraction of the time.
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
    CellOutline,
    fill_corners,
    fill_coverage,
    fill_pixels,
    fill_row_ends,
    fill_sides,
)
from extractor.refine.synthesis.gridlines import KNOWN
from extractor.refine.synthesis.pixel_rows import LANES, padded_count

MAX_COVERAGES, MAX_RUNS = 1 << 18, 1 << 16  # that are kept; cells beyond are drawn once more to be erased
FIRST_RUN, RUN_COUNT, FIRST_COVERAGE = range(3)  # columns of a cell's kept coverages


class CoverageRuns(NamedTuple):
    """The coverages of the cells that were drawn.

    Attributes:
        cell: (K, 3) each cell's first run, its number of runs (0: not kept) and its first coverage.
        runs: (R, 3) x, y and number of pixels in a row of the image.
        coverages: (S,) shares of the cell in these pixels.
        used: (2,) numbers of runs and of coverages in use.
    """

    cell: NDArray[np.int64]
    runs: NDArray[np.int32]
    coverages: NDArray[np.float32]
    used: NDArray[np.int64]


class CellGeometry(NamedTuple):
    """The cells of the pattern in the image.

    Attributes:
        xy: (M, 2) px, the markers.
        cells: (K, 3) marker ids of the corners.
        cell_edges: (K, 3) edge k runs between the corners k and k + 1.
        edges: (E, 2) marker ids.
        lines: (E, 8), as ``gridlines`` gives them.
    """

    xy: NDArray[np.float64]
    cells: NDArray[np.int32]
    cell_edges: NDArray[np.int32]
    edges: NDArray[np.int32]
    lines: NDArray[np.float64]


class CellAppearance(NamedTuple):
    """The colors of the cells over black, and the blur of their edges.

    Attributes:
        levels: (K, 3) gray levels at the centroids.
        slopes: (K, 3, 2) gray levels per px along x and y.
        sigma: px, the blur.
    """

    levels: NDArray[np.float64]
    slopes: NDArray[np.float64]
    sigma: float


class Canvas(NamedTuple):
    """The memory that cells are drawn in.

    Attributes:
        flat: (H * W * 3,) the drawing.
        width: px, W.
        kept: the coverages of the cells that were drawn.
    """

    flat: NDArray[np.float32]
    width: int
    kept: CoverageRuns


class CellBuffers(NamedTuple):
    """Memory for one cell.

    Attributes:
        side: (3, 9) the sides, in units of the blur. corners: (3, 9) float32.
        places: x, then y of the pixels, px. distances: of the pixels inside each of the three sides.
        colors: three channels of the pixels. shares: of the cell in the pixels. runs: (n, 3) as in ``CoverageRuns``.
        low, high: px, the ends of the rows.
    """

    side: NDArray[np.float64]
    corners: NDArray[np.float32]
    places: NDArray[np.float32]
    distances: NDArray[np.float32]
    colors: NDArray[np.float32]
    shares: NDArray[np.float32]
    runs: NDArray[np.int32]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


class ColorPlane(NamedTuple):
    """A cell's color over black as a plane over the image.

    Attributes:
        x, y: px, the centroid, from the origin of the pixels' places.
        sense: 1 to add the cell, -1 to subtract it.
        level: (3,) gray levels at the centroid.
        slope: (3, 2) gray levels per px along x and y.
    """

    x: float
    y: float
    sense: float
    level: NDArray[np.float64]
    slope: NDArray[np.float64]


class RowEnds(NamedTuple):
    """The rows of the image that a cell reaches, y from ``top`` to ``bottom``; ``low`` and ``high`` (n,) are their ends
    in x, px."""

    top: int
    bottom: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def allocate_coverage_runs(cells: int, shares: int = MAX_COVERAGES) -> CoverageRuns:
    """Empty memory for a number of cells and of their coverages in all."""
    runs = np.empty((MAX_RUNS, 3), np.int32)
    return CoverageRuns(
        np.zeros((cells, 3), np.int64), runs, np.empty(shares, np.float32), np.zeros(2, np.int64)
    )


@inlined_no_refcount
def _fill_colors(places, count, shares, plane, colors):  # type: ignore[no-untyped-def]
    """Fill in the three channels of pixels: the color of the plane times the pixels' shares."""
    f, sense, level, slope = np.float32, plane.sense, plane.level, plane.slope
    l0, l1, l2 = f(sense * level[0]), f(sense * level[1]), f(sense * level[2])
    r0, r1, r2 = f(sense * slope[0, 0]), f(sense * slope[1, 0]), f(sense * slope[2, 0])
    d0, d1, d2 = f(sense * slope[0, 1]), f(sense * slope[1, 1]), f(sense * slope[2, 1])
    x0, y0 = f(plane.x), f(plane.y)
    for k in range(padded_count(count)):
        x, y, share = places[PX + k] - x0, places[PY + k] - y0, shares[k]
        colors[3 * k] = share * (l0 + r0 * x + d0 * y)
        colors[3 * k + 1] = share * (l1 + r1 * x + d1 * y)
        colors[3 * k + 2] = share * (l2 + r2 * x + d2 * y)


@inlined_no_refcount
def _add_colors(flat, width, runs, colors):  # type: ignore[no-untyped-def]
    """Add the three channels of pixels to the runs (n, 3) of a flat image; ``width`` px."""
    first = np.uint64(0)
    for i in range(runs.shape[0]):
        at, own = np.uint64(3 * (runs[i, 1] * width + runs[i, 0])), np.int32(3 * runs[i, 2])
        # whole lanes with those beyond the row masked; a remainder would be added one by one
        for j in range(padded_count(own)):
            k = np.uint64(j)
            if np.int32(j) < own:
                flat[at + k] += colors[first + k]
        first += np.uint64(own)


@inlined_no_refcount
def _fill_runs(x, y, ends, x0, y0, places, runs):  # type: ignore[no-untyped-def]
    """Fill in the pixels between the ends of rows, from (x, y) on, up to ``CHUNK`` of them; the place of the next one,
    and the numbers of runs and pixels."""
    filled, count = 0, 0
    while y <= ends.bottom:
        x, end = max(x, int(np.ceil(ends.low[y - ends.top]))), int(np.floor(ends.high[y - ends.top]))
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
def _draw_cell(i, sense, geometry, appearance, box, canvas, buffers):  # type: ignore[no-untyped-def]
    """Draw a cell, and keep its coverages if it is added and memory is left."""
    xy, cells, sigma = geometry.xy, geometry.cells, appearance.sigma
    side, places, shares, runs = buffers.side, buffers.places, buffers.shares, buffers.runs
    kept, used = canvas.kept, canvas.kept.used
    a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
    turn = 1.0 if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0 else -1.0
    edges_of_cell = geometry.cell_edges[i]
    bulge = fill_sides(cells[i], edges_of_cell, geometry.edges, geometry.lines, turn, 1.0 / sigma, side)
    outline = CellOutline(side, buffers.corners, NORMAL_REACH + bulge)
    far = outline.far
    fill_corners(side, sigma, outline.corners)
    top = max(int(np.ceil(min(a[1], b[1], c[1]) - far * sigma)), box[1])
    bottom = min(int(max(a[1], b[1], c[1]) + far * sigma), box[3] - 1)
    left = max(np.ceil(min(a[0], b[0], c[0]) - far * sigma), float(box[0]))
    right = min(np.floor(max(a[0], b[0], c[0]) + far * sigma), box[2] - 1.0)
    ends = RowEnds(top, bottom, buffers.low, buffers.high)
    fill_row_ends(side, top, max(bottom + 1 - top, 0), far, left, right, ends.low, ends.high)
    cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
    x0, y0 = np.floor(cx), np.floor(cy)
    plane = ColorPlane(cx - x0, cy - y0, sense, appearance.levels[i], appearance.slopes[i])
    fits = used[0] + CHUNK <= kept.runs.shape[0] and used[1] + CHUNK <= kept.coverages.shape[0]
    fits = sense > 0.0 and fits
    if fits:
        runs, shares = kept.runs[used[0] :], kept.coverages[used[1] :]
    x, y, filled, count = 0, top, 0, 0
    while y <= bottom:
        x, y, filled, count = _fill_runs(x, y, ends, x0, y0, places, runs)
        fits = fits and y > bottom
        fill_coverage(places, count, x0, y0, outline, buffers.distances, shares)
        _fill_colors(places, count, shares, plane, buffers.colors)
        _add_colors(canvas.flat, canvas.width, runs[:filled], buffers.colors)
    if fits:
        kept.cell[i, FIRST_RUN], kept.cell[i, RUN_COUNT] = used[0], filled
        kept.cell[i, FIRST_COVERAGE] = used[1]
        used[0] += filled
        used[1] += count


@inlined_no_refcount
def _update_erasing_cell(i, geometry, appearance, canvas, places, colors):  # type: ignore[no-untyped-def]
    """Subtract a cell whose coverages are kept."""
    xy, cells, kept = geometry.xy, geometry.cells, canvas.kept
    a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
    cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
    x0, y0, count = np.floor(cx), np.floor(cy), 0
    first = kept.cell[i, FIRST_RUN]
    own = kept.runs[first : first + kept.cell[i, RUN_COUNT]]
    for k in range(own.shape[0]):
        fill_pixels(places, count, own[k, 2], own[k, 0] - x0, own[k, 1] - y0)
        count += own[k, 2]
    shares = kept.coverages[kept.cell[i, FIRST_COVERAGE] :]
    plane = ColorPlane(cx - x0, cy - y0, -1.0, appearance.levels[i], appearance.slopes[i])
    _fill_colors(places, count, shares, plane, colors)
    _add_colors(canvas.flat, canvas.width, own, colors)


@compiled
def _cell_buffers(height):  # type: ignore[no-untyped-def]
    """Memory for one cell in an image of this height, px."""
    side, corners = np.zeros((3, SIDE_COLUMNS)), np.zeros((3, CORNER_TERMS), np.float32)
    places, distances = np.zeros(2 * COLUMN, np.float32), np.empty(3 * COLUMN, np.float32)
    colors, shares = np.empty(3 * CHUNK, np.float32), np.empty(CHUNK, np.float32)
    runs, low, high = np.empty((CHUNK, 3), np.int32), np.empty(height + LANES), np.empty(height + LANES)
    return CellBuffers(side, corners, places, distances, colors, shares, runs, low, high)


@compiled
def draw_cells(which, sense, geometry, appearance, box, model, kept):  # type: ignore[no-untyped-def]
    """Add cells to a drawing, and keep their coverages as far as memory is left.

    Args:
        which: (K,) bool, the cells to draw.
        sense: 1 to add the cells; -1 to subtract them, which keeps no coverages.
        geometry: ``CellGeometry``.
        appearance: ``CellAppearance``.
        box: (4,) px, x from, y from, x to, y to; nothing is drawn outside.
        model: (H, W, 3) float32, the drawing.
        kept: ``CoverageRuns``.
    """
    canvas = Canvas(model.reshape(-1), model.shape[1], kept)
    buffers = _cell_buffers(model.shape[0])
    _draw_listed_cells(np.flatnonzero(which), sense, geometry, appearance, box, canvas, buffers)


@inlined_no_refcount
def _draw_listed_cells(some, sense, geometry, appearance, box, canvas, buffers):  # type: ignore[no-untyped-def]
    """The same for the cells of these numbers (n,)."""
    cell_edges, lines, kept = geometry.cell_edges, geometry.lines, canvas.kept.cell
    for i in some:
        kept[i, RUN_COUNT] = 0
        e, f, g = cell_edges[i, 0], cell_edges[i, 1], cell_edges[i, 2]
        if lines[e, KNOWN] * lines[f, KNOWN] * lines[g, KNOWN] > 0.0:
            _draw_cell(i, sense, geometry, appearance, box, canvas, buffers)


@compiled
def update_erasing_cells(which, geometry, appearance, box, model, kept):  # type: ignore[no-untyped-def]
    """Subtract cells from a drawing; they were drawn with the same geometry and appearance.

    Args: as in ``draw_cells``.
    """
    some, canvas = np.flatnonzero(which), Canvas(model.reshape(-1), model.shape[1], kept)
    places, colors = np.zeros(2 * COLUMN, np.float32), np.empty(3 * CHUNK, np.float32)
    left = some[: _update_erasing_listed_cells(some, geometry, appearance, canvas, places, colors)]
    if left.shape[0] > 0:
        buffers = _cell_buffers(model.shape[0])
        _draw_listed_cells(left, -1.0, geometry, appearance, box, canvas, buffers)


@inlined_no_refcount
def _update_erasing_listed_cells(some, geometry, appearance, canvas, places, colors):  # type: ignore[no-untyped-def]
    """Subtract those of the cells (n,) whose coverages are kept; the number of the others, which are moved to the front
    of ``some``."""
    left = 0
    for i in some:
        if canvas.kept.cell[i, RUN_COUNT] > 0:
            _update_erasing_cell(i, geometry, appearance, canvas, places, colors)
        else:
            some[left] = i
            left += 1
    return left
