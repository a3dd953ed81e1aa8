"""The loops of ``folds``: small triangles over the samples of a tile, nearest first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.coverage_compiled import _compiled

Points = NDArray[np.float64]


@_compiled
def sample_tile(
    xyd: Points,
    uv: Points,
    facing: Points,
    texture: NDArray[np.float32],
    left: int,
    top: int,
    size: int,
    samples: int,
) -> Points:
    """(planes, size * samples, size * samples): the nearest sheet's value less the signed sum of all sheets."""
    count, planes = size * samples, len(texture)
    result = np.zeros((planes, count, count))
    depth = np.full((count, count), np.inf)
    nearest = np.zeros((planes, count, count))
    value = np.empty(planes)
    for t in range(len(xyd)):
        x_low, x_high = _range(xyd[t, 0, 0], xyd[t, 1, 0], xyd[t, 2, 0], left, count, samples)
        y_low, y_high = _range(xyd[t, 0, 1], xyd[t, 1, 1], xyd[t, 2, 1], top, count, samples)
        for j in range(y_low, y_high):
            y = top - 0.5 + (j + 0.5) / samples
            for i in range(x_low, x_high):
                a, b, c = _shares(xyd[t], left - 0.5 + (i + 0.5) / samples, y)
                if a < 0:
                    continue
                u = a * uv[t, 0, 0] + b * uv[t, 1, 0] + c * uv[t, 2, 0]
                v = a * uv[t, 0, 1] + b * uv[t, 1, 1] + c * uv[t, 2, 1]
                _look_up(texture, u, v, value)
                away = a * xyd[t, 0, 2] + b * xyd[t, 1, 2] + c * xyd[t, 2, 2]
                for plane in range(planes):
                    result[plane, j, i] -= facing[t] * value[plane]
                    if away < depth[j, i]:
                        nearest[plane, j, i] = value[plane]
                depth[j, i] = min(depth[j, i], away)
    return result + nearest


@_compiled
def _look_up(texture: NDArray[np.float32], u: float, v: float, value: Points) -> None:
    """Every plane's value at a place, linear between the centres of texels."""
    _, height, width = texture.shape
    column, row = min(max(int(u), 0), width - 2), min(max(int(v), 0), height - 2)
    right, down = u - column, v - row
    for plane in range(len(value)):
        upper = (1 - right) * texture[plane, row, column] + right * texture[plane, row, column + 1]
        lower = (1 - right) * texture[plane, row + 1, column] + right * texture[plane, row + 1, column + 1]
        value[plane] = (1 - down) * upper + down * lower


@_compiled
def _range(a: float, b: float, c: float, start: int, count: int, samples: int) -> tuple[int, int]:
    """The samples from the first to behind the last that lie between three coordinates."""
    low, high = min(a, b, c), max(a, b, c)
    first = int(np.ceil(max((low - start + 0.5) * samples - 0.5, 0.0)))
    last = int(np.floor(min((high - start + 0.5) * samples - 0.5, count - 1.0)))
    return first, last + 1


@_compiled
def _shares(triangle: Points, x: float, y: float) -> tuple[float, float, float]:
    """Barycentric coordinates of a point in a triangle (3, 3); negative ones outside it."""
    ax, ay = triangle[0, 0] - x, triangle[0, 1] - y
    bx, by = triangle[1, 0] - x, triangle[1, 1] - y
    cx, cy = triangle[2, 0] - x, triangle[2, 1] - y
    a, b, c = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    if not ((a > 0 and b > 0 and c > 0) or (a < 0 and b < 0 and c < 0)):
        return -1.0, -1.0, -1.0
    total = a + b + c
    return a / total, b / total, c / total


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
                a, b, c = _shares(xyd[t], x, y)
                if a >= 0:
                    found[n] = min(found[n], a * xyd[t, 0, 2] + b * xyd[t, 1, 2] + c * xyd[t, 2, 2])
    return found
