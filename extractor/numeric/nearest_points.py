"""The nearest of many points in the plane, from a grid of buckets: for use inside compiled loops.

A tree of a general library costs more than the numbering of a whole pattern: it is built and asked anew in every image.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, compiled_no_refcount, inlined_no_refcount

POINTS_PER_BUCKET = 2.0  # points to a bucket


@compiled
def bucket_grid(xy):  # type: ignore[no-untyped-def]
    """A grid over points (N, 2), finite, at least one: its origin and step, (rows, columns + 1) where the buckets of a
    row begin, and (N,) the points, bucket by bucket."""
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
    return low_x, low_y, step, columns, begin, order


@compiled_no_refcount
def fill_nearest_points(xy, grid, x, y, index, square):  # type: ignore[no-untyped-def]
    """Write the points nearest to (x, y), the nearest first, into ``index`` and their squared distances into
    ``squared_distance``, as many as these hold; how many there are."""
    low_x, low_y, step, columns, begin, order = grid
    rows, wanted, found = (begin.shape[0] - 1) // columns, index.shape[0], 0
    column = min(max(int(np.floor((x - low_x) / step)), 0), columns - 1)
    row = min(max(int(np.floor((y - low_y) / step)), 0), rows - 1)
    u, v = (x - low_x) / step, (y - low_y) / step
    for ring in range(max(rows, columns)):
        if found == wanted and ring > 0:
            # what has not been seen lies beyond the rings before, and within the grid
            beyond = np.inf
            if column >= ring:
                beyond = min(beyond, u - (column - ring + 1))
            if column + ring < columns:
                beyond = min(beyond, column + ring - u)
            if row >= ring:
                beyond = min(beyond, v - (row - ring + 1))
            if row + ring < rows:
                beyond = min(beyond, row + ring - v)
            if beyond > 0.0 and square[found - 1] <= (beyond * step) ** 2:
                break
        left, right = max(column - ring, 0), min(column + ring, columns - 1)
        for line in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            first = line * columns
            if abs(line - row) == ring:
                found = _update_nearest(
                    xy, order, begin[first + left], begin[first + right + 1], x, y, index, square, found
                )
                continue
            if column >= ring:
                found = _update_nearest(
                    xy, order, begin[first + left], begin[first + left + 1], x, y, index, square, found
                )
            if column + ring < columns:
                found = _update_nearest(
                    xy, order, begin[first + right], begin[first + right + 1], x, y, index, square, found
                )
    return found


@inlined_no_refcount
def _update_nearest(xy, order, begin, end, x, y, index, square, found):  # type: ignore[no-untyped-def]
    """Put those of the ordered points that are nearer than the last into their places; how many there are now."""
    wanted = index.shape[0]
    for k in range(begin, end):
        i = order[k]
        dx, dy = xy[i, 0] - x, xy[i, 1] - y
        apart = dx * dx + dy * dy
        if found == wanted and apart >= square[found - 1]:
            continue
        at = found if found < wanted else found - 1
        found = min(found + 1, wanted)
        while at > 0 and square[at - 1] > apart:
            square[at], index[at] = square[at - 1], index[at - 1]
            at -= 1
        square[at], index[at] = apart, i
    return found
