"""Between recognition and numbering: the colored cells, with their triangles and centers. Blur moves no center."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.seeds import Seeds
from extractor.cells.triangle_fit import Triangles
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points

NEAREST_CELLS = 8  # cells with which an area is compared
MIN_AREA_SHARE = 0.2  # of the neighbours' median area; smaller domains are dirt
MIN_INTACT_SHARE = 0.7  # of the neighbours' upper quartile; smaller cells are cut, their centers shifted
# Radii within which cells are counted, in sides of a bucket. The five by five buckets around a point hold all cells
# within 2; a disc of 1.1 holds about NEAREST_CELLS.
COUNT_RADII = (1.99, 1.5, 1.25, 1.05, 0.9, 0.75)
UNDECIDED = -1
MIN_TRIANGLE_SHARE = 0.6  # share of triangles among the cells from which on every other cell is a fragment


class CellArrays(NamedTuple):
    """The image's colored cells as compiled loops take them.

    Attributes:
        center_px, ink, area_px, corner_px: as in ``Cells``.
        is_intact: (N,) bool, as ``Cells.is_intact``.
    """

    center_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    area_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    is_intact: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Cells:
    """The image's colored cells.

    Attributes:
        center_px: (N, 2) float64 in the image frame.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        area_px: (N,) float64, px^2.
        corner_px: (N, 3, 2) float64, the corners clockwise in the image; NaN where the region is no triangle.
    """

    center_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    area_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]

    @property
    def edge_px(self) -> float:
        """The edge of an equilateral triangle of the median area; 0 without cells."""
        return float(_equilateral_edge(self.area_px))

    @cached_property
    def is_intact(self) -> NDArray[np.bool_]:
        """(N,) bool, cells with a reliable center: about as large as the neighbours and, if most are, triangles."""
        return np.asarray(_is_intact(self.center_px, self.area_px, self.corner_px))

    @cached_property
    def arrays(self) -> CellArrays:
        """The cells as compiled loops take them."""
        return CellArrays(self.center_px, self.ink, self.area_px, self.corner_px, self.is_intact)


def find_cells(seeds: Seeds, triangles: Triangles, scale: int) -> Cells:
    """The domains that are large enough for cells, at full scale; in a cluttered image only the triangles.

    Args:
        seeds: the domains, at 1/``scale`` of the image's scale.
        triangles: at full scale.
        scale: full-scale pixels per pixel of the seeds.
    """
    found = triangles.region, triangles.corner_px
    return Cells(*_cell_arrays(seeds.center, seeds.ink, seeds.area_px, *found, scale, seeds.cluttered))


def cells_with_triangles(cells: Cells, triangles: Triangles) -> Cells:
    """A copy of the cells with other triangles; ``triangles.region`` is the index of the cell."""
    center, corners = cells.center_px.copy(), cells.corner_px.copy()
    corners[triangles.region] = triangles.corner_px
    center[triangles.region] = triangles.corner_px.mean(axis=1)
    return Cells(center, cells.ink, cells.area_px, corners)


@compiled
def _cell_arrays(seed_center, ink, area_px, region, corner_px, scale, cluttered):  # type: ignore[no-untyped-def]
    """The fields of ``Cells``."""
    center = (seed_center + 0.5) * scale - 0.5
    corners = np.full((seed_center.shape[0], 3, 2), np.nan)
    for t in range(region.shape[0]):
        corners[region[t]] = corner_px[t]
        for axis in range(2):
            center[region[t], axis] = (
                corner_px[t, 0, axis] + corner_px[t, 1, axis] + corner_px[t, 2, axis]
            ) / 3
    area = area_px.astype(np.float64)
    if cluttered:
        center, ink, area, corners = center[region], ink[region], area[region], corners[region]
    keep = np.flatnonzero(_is_large(center, area))
    return center[keep], ink[keep], area[keep] * scale * scale, corners[keep]


@compiled
def _equilateral_edge(area):  # type: ignore[no-untyped-def]
    """The edge of an equilateral triangle of the median area."""
    return np.sqrt(np.median(area) * 4.0 / np.sqrt(3.0)) if area.shape[0] > 0 else 0.0


@compiled
def _is_large(center, area):  # type: ignore[no-untyped-def]
    """(N,) bool, the domains that are not much smaller than their neighbours."""
    return _has_few_larger_neighbours(center, area, MIN_AREA_SHARE, NEAREST_CELLS // 2)


@compiled
def _is_intact(center, area, corner):  # type: ignore[no-untyped-def]
    """(N,) bool, the cells about as large as their neighbours; where most are triangles, triangles only."""
    candidate = np.isfinite(corner[:, 0, 0])
    if np.count_nonzero(candidate) < MIN_TRIANGLE_SHARE * candidate.shape[0]:
        candidate[:] = True
    return candidate & _has_few_larger_neighbours(center, area, MIN_INTACT_SHARE, NEAREST_CELLS // 4 + 1)


class _OrderedCells(NamedTuple):
    """Cells in the order of their bucket grid, so that the cells of a row of buckets follow each other.

    Attributes:
        x, y: (N,) float64, the centers, px.
        limit: (N,) float64, ``share`` times the area: a cell below the limit is much smaller.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    limit: NDArray[np.float64]


class _DistanceBuffers(NamedTuple):
    """Squared distances of the cells around one cell.

    Attributes:
        every: (N,) float64, px^2.
        larger: (N,) float64, the same for much larger cells, infinite for the others.
    """

    every: NDArray[np.float64]
    larger: NDArray[np.float64]


@compiled
def _has_few_larger_neighbours(center, area, share, max_larger):  # type: ignore[no-untyped-def]
    """(N,) bool, the cells with fewer than ``max_larger`` much larger ones among their ``NEAREST_CELLS`` nearest.

    A cell is much larger when ``share`` of its area exceeds the area of the cell in question.
    """
    few, count = np.ones(area.shape[0], np.bool_), area.shape[0]
    if count <= NEAREST_CELLS or area.min() >= share * area.max():
        return few
    last = count - max_larger  # cells for which fewer are larger in the whole image need no search
    small = np.flatnonzero(area < share * np.partition(area, last)[last])
    if small.shape[0] == 0:
        return few
    grid = bucket_grid(center)
    order = grid.order
    ordered = _OrderedCells(center[order, 0], center[order, 1], share * area[order])
    distances = _DistanceBuffers(np.empty(count), np.empty(count))
    index, square = np.empty(NEAREST_CELLS, np.int32), np.empty(NEAREST_CELLS)
    for i in small:
        found = _fill_squared_distances(grid, ordered, center[i, 0], center[i, 1], area[i], distances)
        larger = _larger_neighbour_count(distances, found, grid.step, max_larger)
        if larger == UNDECIDED:
            fill_nearest_points(grid, center[i, 0], center[i, 1], index, square)
            larger = 0
            for j in index:
                larger += area[i] < share * area[j]
        few[i] = larger < max_larger
    return few


@inlined_no_refcount
def _fill_squared_distances(grid, ordered, x, y, area, distances):  # type: ignore[no-untyped-def]
    """Write the squared distances of the cells in the 5 by 5 buckets around (x, y) into ``_DistanceBuffers``.

    All cells within the largest of ``COUNT_RADII`` are among them. Returns how many cells these are.
    """
    columns, begin = grid.columns, grid.begin
    rows, count = (begin.shape[0] - 1) // columns, np.uint64(0)
    column, row = int((x - grid.low_x) / grid.step), int((y - grid.low_y) / grid.step)
    left, right = max(column - 2, 0), min(column + 2, columns - 1)
    for line in range(max(row - 2, 0), min(row + 2, rows - 1) + 1):
        first = np.uint64(begin[line * columns + left])
        more = np.uint64(begin[line * columns + right + 1]) - first
        for k in range(more):
            dx, dy = ordered.x[first + k] - x, ordered.y[first + k] - y
            square = dx * dx + dy * dy
            distances.every[count + k] = square
            distances.larger[count + k] = square if ordered.limit[first + k] > area else np.inf
        count += more
    return count


@inlined_no_refcount
def _larger_neighbour_count(distances, count, step, max_larger):  # type: ignore[no-untyped-def]
    """A bound for the number of much larger cells among the ``NEAREST_CELLS`` nearest, or ``UNDECIDED``.

    The bound suffices to compare the number with ``max_larger``. Counting within a few radii takes a third of the time
    of finding the nearest cells.
    """
    for radius in COUNT_RADII:
        reach, within, larger = (radius * step) ** 2, 0, 0
        for k in range(count):
            within += distances.every[k] <= reach
            larger += distances.larger[k] <= reach
        if within <= NEAREST_CELLS and larger >= max_larger:  # all these are among the nearest
            return larger
        if within < NEAREST_CELLS:
            break
        if larger < max_larger or within == NEAREST_CELLS:  # the nearest are all among these
            return larger
    return UNDECIDED
