"""The loops of ``folds``: small triangles over the samples of a tile, nearest first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.coverage_compiled import _compiled

Points = NDArray[np.float64]


@_compiled
def sample_tile(
    xyd: Points,
    facing: Points,
    values: Points,
    left: int,
    top: int,
    size: int,
    samples: int,
) -> Points:
    """(planes, size * samples, size * samples): the nearest sheet's value less the signed sum of all sheets."""
    count, planes = size * samples, values.shape[1]
    result = np.zeros((planes, count, count))
    depth = np.full((count, count), np.inf)
    nearest = np.full((count, count), -1)
    for t in range(len(xyd)):
        x_low, x_high = _range(xyd[t, 0, 0], xyd[t, 1, 0], xyd[t, 2, 0], left, count, samples)
        y_low, y_high = _range(xyd[t, 0, 1], xyd[t, 1, 1], xyd[t, 2, 1], top, count, samples)
        for j in range(y_low, y_high):
            y = top - 0.5 + (j + 0.5) / samples
            for i in range(x_low, x_high):
                found = _depth_at(xyd[t], left - 0.5 + (i + 0.5) / samples, y)
                if found == np.inf:
                    continue
                for plane in range(planes):
                    result[plane, j, i] -= facing[t] * values[t, plane]
                if found < depth[j, i]:
                    depth[j, i], nearest[j, i] = found, t
    for plane in range(planes):
        for j in range(count):
            for i in range(count):
                if nearest[j, i] >= 0:
                    result[plane, j, i] += values[nearest[j, i], plane]
    return result


@_compiled
def _range(a: float, b: float, c: float, start: int, count: int, samples: int) -> tuple[int, int]:
    """The samples from the first to behind the last that lie between three coordinates."""
    low, high = min(a, b, c), max(a, b, c)
    first = int(np.ceil(max((low - start + 0.5) * samples - 0.5, 0.0)))
    last = int(np.floor(min((high - start + 0.5) * samples - 0.5, count - 1.0)))
    return first, last + 1


@_compiled
def _depth_at(triangle: Points, x: float, y: float) -> float:
    """The depth of a triangle (3, 3) at a point; inf outside it."""
    ax, ay = triangle[0, 0] - x, triangle[0, 1] - y
    bx, by = triangle[1, 0] - x, triangle[1, 1] - y
    cx, cy = triangle[2, 0] - x, triangle[2, 1] - y
    a, b, c = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    if not ((a > 0 and b > 0 and c > 0) or (a < 0 and b < 0 and c < 0)):
        return np.inf
    return (a * triangle[0, 2] + b * triangle[1, 2] + c * triangle[2, 2]) / (a + b + c)  # type: ignore[no-any-return]


@_compiled
def nearest_depth(xyd: Points, points: Points) -> Points:
    """(N,) the smallest depth of any triangle at the points (N, 3); inf where there is none."""
    found = np.full(len(points), np.inf)
    for t in range(len(xyd)):
        low_x, high_x = xyd[t, :, 0].min(), xyd[t, :, 0].max()
        low_y, high_y = xyd[t, :, 1].min(), xyd[t, :, 1].max()
        for n in range(len(points)):
            x, y = points[n, 0], points[n, 1]
            if low_x <= x <= high_x and low_y <= y <= high_y:
                found[n] = min(found[n], _depth_at(xyd[t], x, y))
    return found
