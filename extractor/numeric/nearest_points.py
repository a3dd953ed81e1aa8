"""The nearest of many points in the plane, by a grid of buckets: for use inside compiled loops.

Building and querying a general library's tree costs more than the numbering of a whole pattern, in every image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, compiled_no_refcount, inlined_no_refcount

POINTS_PER_BUCKET = 2.0  # mean number of points in a bucket


class BucketGrid(NamedTuple):
    """Points sorted into square buckets, row by row.

    Attributes:
        xy: (N, 2) float64, the points.
        low_x, low_y: the least coordinates of the points.
        step: side of a bucket, in the points' unit.
        columns: buckets in a row.
        begin: (rows * columns + 1,) int32, index into ``order`` at which each bucket begins.
        order: (N,) int32, the points' indices, bucket by bucket.
    """

    xy: NDArray[np.float64]
    low_x: float
    low_y: float
    step: float
    columns: int
    begin: NDArray[np.int32]
    order: NDArray[np.int32]


@compiled
def bucket_grid(xy):  # type: ignore[no-untyped-def]
    """The ``BucketGrid`` of points (N, 2) float64, finite, at least one. The grid refers to ``xy`` without a copy."""
    count = xy.shape[0]
    low_x, low_y = xy[:, 0].min(), xy[:, 1].min()
    width, height = xy[:, 0].max() - low_x, xy[:, 1].max() - low_y
    # never more buckets along a side than points, however long and thin the cloud
    step = max(np.sqrt(width * height * POINTS_PER_BUCKET / count), max(width, height) / count, 1e-9)
    columns, rows = int(width / step) + 1, int(height / step) + 1
    begin = np.zeros(rows * columns + 1, np.int32)
    bucket = np.empty(count, np.int32)
    for i in range(count):
        bucket[i] = int((xy[i, 1] - low_y) / step) * columns + int((xy[i, 0] - low_x) / step)
        begin[bucket[i] + 1] += 1
    for b in range(rows * columns):
        begin[b + 1] += begin[b]
    order, filled = np.empty(count, np.int32), begin.copy()
    for i in range(count):
        order[filled[bucket[i]]] = i
        filled[bucket[i]] += 1
    return BucketGrid(xy, low_x, low_y, step, columns, begin, order)


@compiled_no_refcount
def fill_nearest_points(grid, x, y, index, squared_distance):  # type: ignore[no-untyped-def]
    """Find the points of a grid that are nearest to (x, y), the nearest first.

    Args:
        grid: a ``BucketGrid``.
        index: (K,) int32, receives the points' indices.
        squared_distance: (K,) float64, receives their squared distances.

    Returns:
        How many points were written: the lesser of K and N.
    """
    columns, step, begin = grid.columns, grid.step, grid.begin
    rows, wanted, found = (begin.shape[0] - 1) // columns, index.shape[0], 0
    column = min(max(int(np.floor((x - grid.low_x) / step)), 0), columns - 1)
    row = min(max(int(np.floor((y - grid.low_y) / step)), 0), rows - 1)
    u, v = (x - grid.low_x) / step, (y - grid.low_y) / step
    for ring in range(max(rows, columns)):
        if found == wanted and ring > 0:
            # the remaining points lie outside the rings before this one, and inside the grid
            remaining = np.inf
            if column >= ring:
                remaining = min(remaining, u - (column - ring + 1))
            if column + ring < columns:
                remaining = min(remaining, column + ring - u)
            if row >= ring:
                remaining = min(remaining, v - (row - ring + 1))
            if row + ring < rows:
                remaining = min(remaining, row + ring - v)
            if remaining > 0.0 and squared_distance[found - 1] <= (remaining * step) ** 2:
                break
        left, right = max(column - ring, 0), min(column + ring, columns - 1)
        for line in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            first = line * columns
            if abs(line - row) == ring:
                found = _update_nearest(
                    grid, begin[first + left], begin[first + right + 1], x, y, index, squared_distance, found
                )
                continue
            if column >= ring:
                found = _update_nearest(
                    grid, begin[first + left], begin[first + left + 1], x, y, index, squared_distance, found
                )
            if column + ring < columns:
                found = _update_nearest(
                    grid, begin[first + right], begin[first + right + 1], x, y, index, squared_distance, found
                )
    return found


@inlined_no_refcount
def _update_nearest(grid, begin, end, x, y, index, squared_distance, found):  # type: ignore[no-untyped-def]
    """Insert the points ``begin`` to ``end`` of the grid's order that are nearer than the last one found.

    Returns the new number of points found.
    """
    xy, order, wanted = grid.xy, grid.order, index.shape[0]
    for k in range(begin, end):
        i = order[k]
        dx, dy = xy[i, 0] - x, xy[i, 1] - y
        square = dx * dx + dy * dy
        if found == wanted and square >= squared_distance[found - 1]:
            continue
        at = found if found < wanted else found - 1
        found = min(found + 1, wanted)
        while at > 0 and squared_distance[at - 1] > square:
            squared_distance[at], index[at] = squared_distance[at - 1], index[at - 1]
            at -= 1
        squared_distance[at], index[at] = square, i
    return found
