"""The compiled loops of ``occlusion``: small triangles over the samples of a tile."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.drawing.coverage_compiled import compiled

Points = NDArray[np.float64]
OVERLAPPING = 2  # sheets over a sample that need a correction


class OcclusionResidual(NamedTuple):
    """The correction of a tile's samples.

    Attributes:
        row, column: the first sample.
        values: (planes, rows, columns) the nearest sheet's value less the signed sum of all sheets.
    """

    row: int
    column: int
    values: Points


class SampleBox(NamedTuple):
    """A box of a tile's samples: first row, rows, first column, columns."""

    row: int
    rows: int
    column: int
    columns: int


@compiled
def occlusion_residual(
    xyd: Points,
    uv: Points,
    facing: Points,
    texture: NDArray[np.float32],
    left: int,
    top: int,
    size: int,
    samples: int,
) -> OcclusionResidual:
    """The correction of the samples of a tile where sheets overlap or one faces away; 0 elsewhere.

    Args:
        xyd: (T, 3, 3) triangles: x and y in px, depth in mm.
        uv: (T, 3, 2) the same corners in texels.
        facing: (T,) 1 towards the camera, -1 away.
        texture: (planes, height, width).
        left, top: the tile's first pixel.
        size: the tile's side in px.
        samples: samples per px along each axis.
    """
    count, planes = size * samples, len(texture)
    sheets = _count_sheets(xyd, facing, left, top, count, samples)
    box = _overlap_box(sheets)
    row, rows, column, columns = box.row, box.rows, box.column, box.columns
    result = np.zeros((planes, rows, columns))
    if rows == 0:
        return OcclusionResidual(row, column, result)
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
                distance = a * xyd[t, 0, 2] + b * xyd[t, 1, 2] + c * xyd[t, 2, 2]
                for plane in range(planes):
                    result[plane, j - row, i - column] -= facing[t] * value[plane]
                    if distance < depth[j - row, i - column]:
                        nearest[plane, j - row, i - column] = value[plane]
                depth[j - row, i - column] = min(depth[j - row, i - column], distance)
    return OcclusionResidual(row, column, result + nearest)


@compiled
def _count_sheets(
    xyd: Points, facing: Points, left: int, top: int, count: int, samples: int
) -> NDArray[np.uint8]:
    """(count, count) the number of sheets over each sample; a sheet that faces away counts as ``OVERLAPPING``."""
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


@compiled
def _overlap_box(sheets: NDArray[np.uint8]) -> SampleBox:
    """The box of the samples under ``OVERLAPPING`` sheets or more."""
    count = len(sheets)
    top, bottom, left, right = count, 0, count, 0
    for j in range(count):
        for i in range(count):
            if sheets[j, i] >= OVERLAPPING:
                top, bottom = min(top, j), max(bottom, j + 1)
                left, right = min(left, i), max(right, i + 1)
    return SampleBox(top, max(bottom - top, 0), left, max(right - left, 0))


@compiled
def _fill_texture_value(texture: NDArray[np.float32], u: float, v: float, value: Points) -> None:
    """Write every plane's value at texel (u, v) into ``value``, bilinear between the centres of texels."""
    _, height, width = texture.shape
    column, row = min(max(int(u), 0), width - 2), min(max(int(v), 0), height - 2)
    right, down = u - column, v - row
    for plane in range(len(value)):
        upper = (1 - right) * texture[plane, row, column] + right * texture[plane, row, column + 1]
        lower = (1 - right) * texture[plane, row + 1, column] + right * texture[plane, row + 1, column + 1]
        value[plane] = (1 - down) * upper + down * lower


@compiled
def _sample_range(a: float, b: float, c: float, start: int, count: int, samples: int) -> tuple[int, int]:
    """The range (first, last + 1) of samples between the smallest and the largest of three coordinates."""
    low, high = min(a, b, c), max(a, b, c)
    first = int(np.ceil(max((low - start + 0.5) * samples - 0.5, 0.0)))
    last = int(np.floor(min((high - start + 0.5) * samples - 0.5, count - 1.0)))
    return first, last + 1


@compiled
def _barycentric(triangle: Points, x: float, y: float) -> tuple[float, float, float]:
    """Barycentric coordinates of a point in a triangle (3, 3); negative outside the triangle."""
    ax, ay = triangle[0, 0] - x, triangle[0, 1] - y
    bx, by = triangle[1, 0] - x, triangle[1, 1] - y
    cx, cy = triangle[2, 0] - x, triangle[2, 1] - y
    a, b, c = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    if not ((a > 0 and b > 0 and c > 0) or (a < 0 and b < 0 and c < 0)):
        return -1.0, -1.0, -1.0
    total = a + b + c
    return a / total, b / total, c / total


@compiled
def nearest_depth(xyd: Points, points: Points) -> Points:
    """(N,) the smallest depth of any triangle at points (N, 3) in ascending order of x; inf without a triangle."""
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
