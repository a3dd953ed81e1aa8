"""The loops of ``occlusion``: small triangles over the samples of a tile, nearest first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.drawing.coverage_compiled import _compiled

Points = NDArray[np.float64]
OVERLAPPING = 2


@_compiled
def occlusion_residual(
    xyd: Points,
    uv: Points,
    facing: Points,
    texture: NDArray[np.float32],
    left: int,
    top: int,
    size: int,
    samples: int,
) -> tuple[int, int, Points]:
    """First row and column and (planes, rows, columns): the nearest sheet's value less the signed sum of all sheets.

    It is 0 but where sheets lie over each other or one faces away; the samples around those are all that is looked at.
    """
    count, planes = size * samples, len(texture)
    sheets = _count_sheets(xyd, facing, left, top, count, samples)
    row, rows, column, columns = _overlap_box(sheets)
    result = np.zeros((planes, rows, columns))
    if rows == 0:
        return row, column, result
    depth = np.full((rows, columns), np.inf)
    nearest = np.zeros((planes, rows, columns))
    value = np.empty(planes)
    for t in range(len(xyd)):
        x_low, x_high = _sample_range(xyd[t, 0, 0], xyd[t, 1, 0], xyd[t, 2, 0], left, count, samples)
        y_low, y_high = _sample_range(xyd[t, 0, 1], xyd[t, 1, 1], xyd[t, 2, 1], top, count, samples)
        for j in range(max(y_low, row), min(y_high, row + rows)):
            y = top - 0.5 + (j + 0.5) / samples
            for i in range(max(x_low, column), min(x_high, column + columns)):
                if sheets[j, i] < OVERLAPPING:
                    continue
                a, b, c = _barycentric(xyd[t], left - 0.5 + (i + 0.5) / samples, y)
                if a < 0:
                    continue
                u = a * uv[t, 0, 0] + b * uv[t, 1, 0] + c * uv[t, 2, 0]
                v = a * uv[t, 0, 1] + b * uv[t, 1, 1] + c * uv[t, 2, 1]
                _fill_texture_value(texture, u, v, value)
                away = a * xyd[t, 0, 2] + b * xyd[t, 1, 2] + c * xyd[t, 2, 2]
                for plane in range(planes):
                    result[plane, j - row, i - column] -= facing[t] * value[plane]
                    if away < depth[j - row, i - column]:
                        nearest[plane, j - row, i - column] = value[plane]
                depth[j - row, i - column] = min(depth[j - row, i - column], away)
    return row, column, result + nearest


@_compiled
def _count_sheets(
    xyd: Points, facing: Points, left: int, top: int, count: int, samples: int
) -> NDArray[np.uint8]:
    """(count, count) how many sheets lie over each sample; one that faces away counts as many."""
    found = np.zeros((count, count), dtype=np.uint8)
    for t in range(len(xyd)):
        x_low, x_high = _sample_range(xyd[t, 0, 0], xyd[t, 1, 0], xyd[t, 2, 0], left, count, samples)
        y_low, y_high = _sample_range(xyd[t, 0, 1], xyd[t, 1, 1], xyd[t, 2, 1], top, count, samples)
        more = 1 if facing[t] > 0 else OVERLAPPING
        for j in range(y_low, y_high):
            y = top - 0.5 + (j + 0.5) / samples
            for i in range(x_low, x_high):
                if (
                    found[j, i] < OVERLAPPING
                    and _barycentric(xyd[t], left - 0.5 + (i + 0.5) / samples, y)[0] >= 0
                ):
                    found[j, i] += more
    return found


@_compiled
def _overlap_box(sheets: NDArray[np.uint8]) -> tuple[int, int, int, int]:
    """First row, rows, first column and columns of the samples under many sheets."""
    count = len(sheets)
    top, bottom, left, right = count, 0, count, 0
    for j in range(count):
        for i in range(count):
            if sheets[j, i] >= OVERLAPPING:
                top, bottom = min(top, j), max(bottom, j + 1)
                left, right = min(left, i), max(right, i + 1)
    return top, max(bottom - top, 0), left, max(right - left, 0)


@_compiled
def _fill_texture_value(texture: NDArray[np.float32], u: float, v: float, value: Points) -> None:
    """Every plane's value at a place, linear between the centres of texels."""
    _, height, width = texture.shape
    column, row = min(max(int(u), 0), width - 2), min(max(int(v), 0), height - 2)
    right, down = u - column, v - row
    for plane in range(len(value)):
        upper = (1 - right) * texture[plane, row, column] + right * texture[plane, row, column + 1]
        lower = (1 - right) * texture[plane, row + 1, column] + right * texture[plane, row + 1, column + 1]
        value[plane] = (1 - down) * upper + down * lower


@_compiled
def _sample_range(a: float, b: float, c: float, start: int, count: int, samples: int) -> tuple[int, int]:
    """The samples from the first to behind the last that lie between three coordinates."""
    low, high = min(a, b, c), max(a, b, c)
    first = int(np.ceil(max((low - start + 0.5) * samples - 0.5, 0.0)))
    last = int(np.floor(min((high - start + 0.5) * samples - 0.5, count - 1.0)))
    return first, last + 1


@_compiled
def _barycentric(triangle: Points, x: float, y: float) -> tuple[float, float, float]:
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
    """(N,) the smallest depth of any triangle at the points (N, 3), which rise in x; inf where there is none."""
    found = np.full(len(points), np.inf)
    x = points[:, 0].copy()
    for t in range(len(xyd)):
        first = np.searchsorted(x, min(xyd[t, 0, 0], xyd[t, 1, 0], xyd[t, 2, 0]))
        high_x = max(xyd[t, 0, 0], xyd[t, 1, 0], xyd[t, 2, 0])
        low_y = min(xyd[t, 0, 1], xyd[t, 1, 1], xyd[t, 2, 1])
        high_y = max(xyd[t, 0, 1], xyd[t, 1, 1], xyd[t, 2, 1])
        for n in range(first, len(points)):
            if x[n] > high_x:
                break
            if low_y <= points[n, 1] <= high_y:
                a, b, c = _barycentric(xyd[t], x[n], points[n, 1])
                if a >= 0:
                    found[n] = min(found[n], a * xyd[t, 0, 2] + b * xyd[t, 1, 2] + c * xyd[t, 2, 2])
    return found
