"""Drawing of the pattern from its current markers.

A pixel of the drawing is the sum over the cells of the cell's share in that pixel (``cell_coverage``) times its level
over black.
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


class CellBuffers(NamedTuple):
    """Memory for one cell.

    Attributes:
        side: (3, 9) the sides, in units of the blur. corners: (3, 9) float32.
        places: x, then y of the pixels, px. distances: of the pixels inside each of the three sides.
        colors: three channels of the pixels. shares: of the cell in the pixels.
        runs: (n, 3) x, y and number of pixels in a row of the image.
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
        level: (3,) gray levels at the centroid.
        slope: (3, 2) gray levels per px along x and y.
    """

    x: float
    y: float
    level: NDArray[np.float64]
    slope: NDArray[np.float64]


class RowEnds(NamedTuple):
    """The rows of the image that a cell reaches, y from ``top`` to ``bottom``; ``low`` and ``high`` (n,) are their ends
    in x, px."""

    top: int
    bottom: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@inlined_no_refcount
def _fill_colors(places, count, shares, plane, colors):  # type: ignore[no-untyped-def]
    """Fill in the three channels of pixels: the color of the plane times the pixels' shares."""
    f, level, slope = np.float32, plane.level, plane.slope
    l0, l1, l2 = f(level[0]), f(level[1]), f(level[2])
    r0, r1, r2 = f(slope[0, 0]), f(slope[1, 0]), f(slope[2, 0])
    d0, d1, d2 = f(slope[0, 1]), f(slope[1, 1]), f(slope[2, 1])
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
def _draw_cell(i, geometry, appearance, box, flat, width, buffers):  # type: ignore[no-untyped-def]
    """Draw a cell into the flat drawing of an image ``width`` px wide."""
    xy, cells, sigma = geometry.xy, geometry.cells, appearance.sigma
    side, places, shares, runs = buffers.side, buffers.places, buffers.shares, buffers.runs
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
    plane = ColorPlane(cx - x0, cy - y0, appearance.levels[i], appearance.slopes[i])
    x, y, filled, count = 0, top, 0, 0
    while y <= bottom:
        x, y, filled, count = _fill_runs(x, y, ends, x0, y0, places, runs)
        fill_coverage(places, count, x0, y0, outline, buffers.distances, shares)
        _fill_colors(places, count, shares, plane, buffers.colors)
        _add_colors(flat, width, runs[:filled], buffers.colors)


@compiled
def _cell_buffers(height):  # type: ignore[no-untyped-def]
    """Memory for one cell in an image of this height, px."""
    side, corners = np.zeros((3, SIDE_COLUMNS)), np.zeros((3, CORNER_TERMS), np.float32)
    places, distances = np.zeros(2 * COLUMN, np.float32), np.empty(3 * COLUMN, np.float32)
    colors, shares = np.empty(3 * CHUNK, np.float32), np.empty(CHUNK, np.float32)
    runs, low, high = np.empty((CHUNK, 3), np.int32), np.empty(height + LANES), np.empty(height + LANES)
    return CellBuffers(side, corners, places, distances, colors, shares, runs, low, high)


@compiled
def draw_cells(geometry, appearance, box, model):  # type: ignore[no-untyped-def]
    """Add all cells whose sides are known to a drawing.

    Args:
        geometry: ``CellGeometry``.
        appearance: ``CellAppearance``.
        box: (4,) px, x from, y from, x to, y to; nothing is drawn outside.
        model: (H, W, 3) float32, the drawing.
    """
    cell_edges, lines, flat = geometry.cell_edges, geometry.lines, model.reshape(-1)
    buffers = _cell_buffers(model.shape[0])
    for i in range(len(geometry.cells)):
        e, f, g = cell_edges[i, 0], cell_edges[i, 1], cell_edges[i, 2]
        if lines[e, KNOWN] * lines[f, KNOWN] * lines[g, KNOWN] > 0.0:
            _draw_cell(i, geometry, appearance, box, flat, model.shape[1], buffers)
