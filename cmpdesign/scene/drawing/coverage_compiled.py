"""The coverage engine as compiled loops: the method of ``coverage.draw_band``, one side after the other."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cmpdesign.scene.drawing.coverage_task import CoverageTask

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function with numba, cached on disk."""
    options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    return cast(Function, numba.njit(**options)(function))


def draw_band(task: CoverageTask, first: int, count: int) -> NDArray[np.float32]:
    """Draw pixel rows ``first`` to ``first + count`` as (planes, count, width) float32."""
    oversampling, reach = task.spread.oversampling, task.spread.reach
    rows = oversampling * (count - 1) + 2 * reach + 1
    differences = np.zeros((task.values.shape[1], rows, task.columns), dtype=np.float32)
    _accumulate_differences(
        differences,
        task.segments,
        task.owner,
        task.values,
        oversampling * first,
        task.spread.degree,
        task.quadrature,
    )
    return _apply_point_spread(differences, task.spread.weights, oversampling, count, task.width)


@compiled
def _cubic_bsplines(t: float) -> tuple[float, float, float, float]:
    """The four cubic B-splines that are not zero in a knot interval, at the fraction t, leftmost first."""
    s = 1.0 - t
    tt, ss = t * t, s * s
    return ss * s / 6, (4 - 6 * tt + 3 * tt * t) / 6, (4 - 6 * ss + 3 * ss * s) / 6, tt * t / 6


@compiled
def _quartic_bsplines(t: float) -> tuple[float, float, float, float, float]:
    """The five quartic B-splines that are not zero in a knot interval, by one more recursion."""
    a, b, c, d = _cubic_bsplines(t)
    s = 1.0 - t
    return (
        s * a / 4,
        ((3 + t) * a + (1 + s) * b) / 4,
        ((2 + t) * b + (2 + s) * c) / 4,
        ((1 + t) * c + (3 + s) * d) / 4,
        t * d / 4,
    )


@compiled
def _accumulate_differences(
    differences: NDArray[np.float32],
    segments: NDArray[np.float64],
    owner: NDArray[np.int64],
    values: NDArray[np.float64],
    top: int,
    degree: int,
    quadrature: NDArray[np.float64],
) -> None:
    """Add every segment's differences along the rows to the band that starts at sample row ``top``."""
    planes, rows, columns = differences.shape
    half = degree // 2
    patch = np.empty((degree + 1, degree + 2))
    for s in range(len(segments)):
        u0, v0, u1, v1 = segments[s]
        du, dv = u1 - u0, v1 - v0
        if dv == 0.0:
            continue
        if np.floor(max(v0, v1)) - half + degree < top or np.floor(min(v0, v1)) - half >= top + rows:
            continue
        knot_u, knot_v = _next_knot(u0, du), _next_knot(v0, dv)
        t = 0.0
        while t < 1.0:
            t_u = (knot_u - u0) / du if du != 0.0 else 2.0
            t_v = (knot_v - v0) / dv
            end = min(t_u, t_v, 1.0)
            if t_u <= end:
                knot_u += 1.0 if du > 0.0 else -1.0
            if t_v <= end:
                knot_v += 1.0 if dv > 0.0 else -1.0
            if end <= t:
                continue
            cell_u = int(np.floor(u0 + 0.5 * (t + end) * du))
            cell_v = int(np.floor(v0 + 0.5 * (t + end) * dv))
            row, column = cell_v - half - top, cell_u - half
            if row + degree >= 0 and row < rows and column < columns:
                patch[:] = 0.0
                for k in range(quadrature.shape[1]):
                    at = t + quadrature[0, k] * (end - t)
                    share = quadrature[1, k] * (end - t) * dv
                    u, v = u0 + at * du - cell_u, v0 + at * dv - cell_v
                    if degree == 0:
                        patch[0, 0] += share * (1.0 - u)
                        patch[0, 1] += share * u
                        continue
                    across, along = _quartic_bsplines(u), _cubic_bsplines(v)
                    for j in range(4):
                        for i in range(5):
                            patch[j, i] += share * along[j] * across[i]
                for plane in range(planes):
                    value = values[owner[s], plane]
                    if value != 0.0:
                        _add_patch(differences[plane], patch, value, row, column)
            t = end


@compiled
def _next_knot(start: float, step: float) -> float:
    """The first integer strictly beyond ``start`` in the direction of ``step``."""
    return np.floor(start) + 1.0 if step > 0.0 else np.ceil(start) - 1.0  # type: ignore[no-any-return]


@compiled
def _add_patch(
    plane: NDArray[np.float32], patch: NDArray[np.float64], value: float, row: int, column: int
) -> None:
    """Add value times patch at (row, column), clipped to the plane; columns left of it count in column 0."""
    rows, columns = plane.shape
    for j in range(max(0, -row), min(patch.shape[0], rows - row)):
        for i in range(min(patch.shape[1], columns - column)):
            plane[row + j, max(column + i, 0)] += np.float32(value * patch[j, i])


@compiled
def _apply_point_spread(
    differences: NDArray[np.float32], weights: NDArray[np.float32], oversampling: int, count: int, width: int
) -> NDArray[np.float32]:
    """Point spread down the columns, cumulative sum along the rows, point spread along the rows."""
    planes, _, columns = differences.shape
    taps = len(weights)
    image = np.zeros((planes, count, width), dtype=np.float32)
    line = np.empty(columns, dtype=np.float32)
    # Samples of the same phase are adjacent, so that the second sum runs over contiguous memory.
    phases = np.empty((oversampling, columns // oversampling + 1), dtype=np.float32)
    for plane in range(planes):
        for y in range(count):
            line[:] = 0.0
            for k in range(taps):
                weight = weights[k]
                source = differences[plane, oversampling * y + k]
                for x in range(columns):
                    line[x] += weight * source[x]
            total = 0.0
            for x in range(columns):
                total += line[x]
                phases[x % oversampling, x // oversampling] = total
            target = image[plane, y]
            for k in range(taps):
                weight = weights[k]
                samples = phases[k % oversampling, k // oversampling :]
                for x in range(width):
                    target[x] += weight * samples[x]
    return image
