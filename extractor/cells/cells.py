"""Between recognition and numbering: the colored cells, as centers that no blur moves, with their triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from extractor.cells.seeds import Seeds
from extractor.cells.triangle_fit import Triangles
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points

NEAREST_CELLS = 8
MIN_AREA_SHARE = 0.2  # of the median around it; smaller domains are dirt
MIN_INTACT_SHARE = (
    0.7  # of the upper quartile around it; smaller cells have lost a part, and their centers lie aside
)
# Buckets' sides, within which points are counted. Of five buckets by five around a point none is missed within two; a
# disc of 1.1 holds as many points as are NEIGHBOURS.
COUNT_RADII = (1.99, 1.5, 1.25, 1.05, 0.9, 0.75)
UNDECIDED = -1
MIN_TRIANGLE_SHARE = 0.6  # of the cells are triangles: then what is none is a fragment, too


@dataclass(frozen=True, eq=False)
class Cells:
    """The image's colored cells.

    Attributes:
        center_px: (N, 2) float64 in the image frame.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        area_px: (N,) float64.
        corner_px: (N, 3, 2) float64, the corners clockwise in the image, NaN where the region is no triangle.
    """

    center_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    area_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]

    @property
    def edge_px(self) -> float:
        """The median edge of an equilateral triangle of the cells' areas; 0 without cells."""
        return float(_equilateral_edge(self.area_px))

    @cached_property
    def is_intact(self) -> NDArray[np.bool_]:
        """(N,) bool, whose centers are to be believed: triangles, if most are, as large as those around them."""
        return np.asarray(_is_intact(self.center_px, self.area_px, self.corner_px))


def find_cells(seeds: Seeds, triangles: Triangles, scale: int) -> Cells:
    """The domains that are large enough for cells, at full scale; in a crowd, triangles alone.

    Args:
        scale: full-scale pixels per pixel of the seeds.
    """
    found = triangles.region, triangles.corner_px
    return Cells(*_cell_arrays(seeds.center, seeds.ink, seeds.area_px, *found, scale, seeds.cluttered))


def cells_with_triangles(cells: Cells, triangles: Triangles) -> Cells:
    """The cells with these for their triangles, whose ``region`` is the cell."""
    center, corners = cells.center_px.copy(), cells.corner_px.copy()
    corners[triangles.region] = triangles.corner_px
    center[triangles.region] = triangles.corner_px.mean(axis=1)
    return Cells(center, cells.ink, cells.area_px, corners)


@compiled
def _cell_arrays(place, ink_of, area_px, region, corner_px, scale, crowded):  # type: ignore[no-untyped-def]
    """The fields of ``Cells``."""
    center = (place + 0.5) * scale - 0.5
    corners = np.full((place.shape[0], 3, 2), np.nan)
    for t in range(region.shape[0]):
        corners[region[t]] = corner_px[t]
        for axis in range(2):
            center[region[t], axis] = (
                corner_px[t, 0, axis] + corner_px[t, 1, axis] + corner_px[t, 2, axis]
            ) / 3
    area = area_px.astype(np.float64)
    if crowded:  # of what is so fine, and sharp
        center, ink_of, area, corners = center[region], ink_of[region], area[region], corners[region]
    keep = np.flatnonzero(_is_large(center, area))
    return center[keep], ink_of[keep], area[keep] * scale * scale, corners[keep]


@compiled
def _equilateral_edge(area):  # type: ignore[no-untyped-def]
    """The edge of an equilateral triangle of the median area."""
    return np.sqrt(np.median(area) * 4.0 / np.sqrt(3.0)) if area.shape[0] > 0 else 0.0


@compiled
def _is_large(center, area):  # type: ignore[no-untyped-def]
    """(N,) bool, the domains that are not small beside the ones around them."""
    return _has_few_larger_neighbours(center, area, MIN_AREA_SHARE, NEAREST_CELLS // 2)


@compiled
def _is_intact(center, area, corner):  # type: ignore[no-untyped-def]
    """(N,) bool, the triangles, or all cells where few are, that are about as large as the ones around them."""
    shaped = np.isfinite(corner[:, 0, 0])
    if np.count_nonzero(shaped) < MIN_TRIANGLE_SHARE * shaped.shape[0]:
        shaped[:] = True
    return shaped & _has_few_larger_neighbours(center, area, MIN_INTACT_SHARE, NEAREST_CELLS // 4 + 1)


@compiled
def _has_few_larger_neighbours(center, area, share, most):  # type: ignore[no-untyped-def]
    """(N,) bool, of which less than so many of the nearest are so much larger that it is but a ``share`` of them."""
    few, count = np.ones(area.shape[0], np.bool_), area.shape[0]
    if count <= NEAREST_CELLS or area.min() >= share * area.max():
        return few
    last = count - most  # where less than so many are larger at all, there is no need to look
    small = np.flatnonzero(area < share * np.partition(area, last)[last])
    if small.shape[0] == 0:
        return few
    grid = bucket_grid(center)
    order = grid[-1]
    x_of, y_of, limit = center[order, 0], center[order, 1], share * area[order]
    index, square = np.empty(NEAREST_CELLS, np.int32), np.empty(NEAREST_CELLS)
    squares, larger_squares = np.empty(count), np.empty(count)
    for i in small:
        x, y = center[i, 0], center[i, 1]
        seen = _fill_squared_distances(x_of, y_of, limit, grid, x, y, area[i], squares, larger_squares)
        larger = _larger_neighbour_count(squares, larger_squares, seen, grid[2], most)
        if larger == UNDECIDED:
            fill_nearest_points(center, grid, x, y, index, square)
            larger = 0
            for j in index:
                larger += area[i] < share * area[j]
        few[i] = larger < most
    return few


@inlined_no_refcount
def _fill_squared_distances(x_of, y_of, limit, grid, x, y, size, squares, larger_squares):  # type: ignore[no-untyped-def]
    """Write the squared distances of the points around (x, y) from it, and again, without end where their ``limit`` is
    not beyond a ``size``; how many points. All within the largest of ``COUNT_RADII`` are among them.

    Args:
        x_of, y_of, limit: (N,) of the points in the grid's order.
    """
    low_x, low_y, step, columns, begin, _ = grid
    rows, count = (begin.shape[0] - 1) // columns, np.uint64(0)
    column, row = int((x - low_x) / step), int((y - low_y) / step)
    left, right = max(column - 2, 0), min(column + 2, columns - 1)
    for line in range(max(row - 2, 0), min(row + 2, rows - 1) + 1):
        first = np.uint64(begin[line * columns + left])
        more = np.uint64(begin[line * columns + right + 1]) - first
        for k in range(more):
            dx, dy = x_of[first + k] - x, y_of[first + k] - y
            square = dx * dx + dy * dy
            squares[count + k] = square
            larger_squares[count + k] = square if limit[first + k] > size else np.inf
        count += more
    return count


@inlined_no_refcount
def _larger_neighbour_count(squares, larger_squares, count, step, most):  # type: ignore[no-untyped-def]
    """At least, or at most, how many of the ``NEAREST_CELLS`` nearest points are larger: enough to tell whether they
    are
    fewer than ``max_partial_share_in_dirt``, or ``UNDECIDED``. Counting within some radii takes a third of the time
    of finding them."""
    for radius in COUNT_RADII:
        reach, within, larger = (radius * step) ** 2, 0, 0
        for k in range(count):
            within += squares[k] <= reach
            larger += larger_squares[k] <= reach
        if within <= NEAREST_CELLS and larger >= most:  # all these are among the nearest
            return larger
        if within < NEAREST_CELLS:
            break
        if larger < most or within == NEAREST_CELLS:  # the nearest are all among these
            return larger
    return UNDECIDED
