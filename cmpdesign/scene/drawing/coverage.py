"""Exact coverage of the image by polygons, filtered by a point spread that is a sum of B-splines.

The coverage filtered by a spline at (i, j) is, by Green's theorem, a sum over the polygon's sides:

    integral over the polygon of B(u - i) B(v - j) du dv  =  contour integral of C(u - i) B(v - j) dv,

where C is the integral of B from -infinity. Font rasterisers use the same method with boxes (signed-area accumulation).
Differences along the row are accumulated, which affect only the few samples around a side. One
cumulative sum then gives the coverage. Along the piece of a side inside one sample cell the integrand is a
polynomial of degree 2 * degree + 1. Gauss-Legendre quadrature with degree + 1 points integrates it
exactly. The only error is rounding (about 1e-6).

This module holds the preparation and the engine in plain numpy. ``_native.coverage`` is the same engine as loops.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.drawing.coverage_task import CoverageTask
from cmpdesign.scene.drawing.paths import PolygonSegments
from cmpdesign.scene.parts.optics import PointSpread

Engine = Literal["compiled", "numpy"]
BAND_ROWS = 64

# (task, first row, rows) -> planes. The image is drawn in bands of rows to limit memory.
BandFunction = Callable[["CoverageTask", int, int], NDArray[np.float32]]


def draw_coverage(
    paths: PolygonSegments,
    values: NDArray[np.float64],
    size: tuple[int, int],
    spread: PointSpread,
    engine: Engine = "compiled",
    orientation: float | None = None,
) -> NDArray[np.float32]:
    """Draw the sum over the polygons of value times blurred coverage.

    Args:
        paths: closed polygons in the image frame, of either orientation.
        values: (polygons, planes): the value that each polygon adds to each plane where it covers the plane.
        size: the image's (width, height) px.
        spread: the point spread.
        engine: "compiled" (C++) or the equivalent "numpy".
        orientation: sign of the area (positive from x to y) of polygons whose coverage is positive; polygons of
            the opposite sign have negative coverage. None: the coverage of all polygons is positive.

    Returns:
        (planes, height, width) float32.
    """
    width, height = size
    task = _make_task(paths, _signed_values(paths, values, orientation), size, spread)
    draw = _load_engine(engine)
    image = np.empty((values.shape[1], height, width), dtype=np.float32)
    for first in range(0, height, BAND_ROWS):
        count = min(BAND_ROWS, height - first)
        image[:, first : first + count] = draw(task, first, count)
    return image


def _load_engine(engine: Engine) -> BandFunction:
    if engine == "numpy":
        return draw_band
    from cmpdesign._native import coverage

    band: BandFunction = coverage.draw_band
    return band


def _make_task(
    paths: PolygonSegments, values: NDArray[np.float64], size: tuple[int, int], spread: PointSpread
) -> CoverageTask:
    oversampling = spread.oversampling
    columns, rows = (oversampling * (pixels - 1) + 2 * spread.reach + 1 for pixels in size)
    # Knots of the even degree lie between the samples.
    shift = spread.reach + (0.5 if spread.degree == 0 else 0.0)
    segments, owner = _clip_segments(oversampling * paths.xy_px + shift, paths.owner, columns, rows)
    nodes, weights = np.polynomial.legendre.leggauss(spread.degree + 1)
    quadrature = np.stack([(nodes + 1) / 2, weights / 2])
    return CoverageTask(segments, owner, values, columns, rows, spread, size[0], quadrature)


def _signed_values(
    paths: PolygonSegments, values: NDArray[np.float64], orientation: float | None
) -> NDArray[np.float64]:
    """(polygons, planes): the weights of the contour integral."""
    if orientation is not None:
        return -orientation * values
    xy = paths.xy_px
    area = np.bincount(paths.owner, xy[:, 0] * xy[:, 3] - xy[:, 2] * xy[:, 1], minlength=len(values))
    return values * -np.sign(area)[:, None]


def _clip_segments(
    uv: NDArray[np.float64], owner: NDArray[np.int64], columns: int, rows: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Remove parts above, below or right of the samples; move parts left of the samples to their margin.

    A side left of all samples counts fully in all samples of its rows. A side right of all samples counts in none.

    Returns:
        (n, 4) the remaining pieces, and (n,) their polygons.
    """
    margin = 4.0
    low, high = -margin, columns + margin
    top, bottom = np.minimum(uv[:, 1], uv[:, 3]), np.maximum(uv[:, 1], uv[:, 3])
    relevant = (bottom > -margin) & (top < rows + margin) & (np.minimum(uv[:, 0], uv[:, 2]) < high)
    uv, owner = uv[relevant], owner[relevant]
    if uv.size == 0 or (uv.min() >= low and uv[:, 0::2].max() <= high and uv[:, 1::2].max() <= rows + margin):
        return uv, owner

    start, step = uv[:, :2], uv[:, 2:] - uv[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.stack(
            [
                (low - start[:, 0]) / step[:, 0],
                (high - start[:, 0]) / step[:, 0],
                (-margin - start[:, 1]) / step[:, 1],
                (rows + margin - start[:, 1]) / step[:, 1],
            ]
        )
    crossings = np.clip(np.nan_to_num(crossings, nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
    t = np.concatenate([np.zeros((1, len(uv))), np.sort(crossings, axis=0), np.ones((1, len(uv)))])
    points = start + t[..., None] * step
    points[..., 0] = np.clip(points[..., 0], low, high)
    pieces = np.concatenate([points[:-1], points[1:]], axis=-1).reshape(-1, 4)
    owners = np.tile(owner, len(t) - 1)
    top, bottom = np.minimum(pieces[:, 1], pieces[:, 3]), np.maximum(pieces[:, 1], pieces[:, 3])
    inside = (bottom > top) & (bottom > -margin + 1e-9) & (top < rows + margin - 1e-9)
    return np.ascontiguousarray(pieces[inside]), owners[inside]


def draw_band(task: CoverageTask, first: int, count: int) -> NDArray[np.float32]:
    """Draw pixel rows ``first`` to ``first + count`` as (planes, count, width) float32, in plain numpy."""
    oversampling, reach, degree = task.spread.oversampling, task.spread.reach, task.spread.degree
    rows = oversampling * (count - 1) + 2 * reach + 1
    differences = _edge_differences(task, oversampling * first, rows, degree)
    vertical = np.stack([_apply_point_spread(plane.T, task.spread, count).T for plane in differences])
    return _apply_point_spread(np.cumsum(vertical, axis=2), task.spread, task.width).astype(np.float32)


def _apply_point_spread(samples: NDArray[np.float64], spread: PointSpread, count: int) -> NDArray[np.float64]:
    """Samples filtered by the point spread along the last axis, one result per pixel."""
    windows = np.lib.stride_tricks.sliding_window_view(samples, len(spread.weights), axis=-1)
    return np.asarray(
        windows[..., :: spread.oversampling, :][..., :count, :] @ spread.weights.astype(np.float64)
    )


def _edge_differences(task: CoverageTask, top: int, rows: int, degree: int) -> NDArray[np.float64]:
    """Differences along the rows (planes, rows, columns) of the band that starts at sample row ``top``."""
    pieces, source = _split_at_knots(task.segments)
    height = pieces[:, 3] - pieces[:, 1]
    nodes, weights = task.quadrature
    cell = np.floor(0.5 * (pieces[:, :2] + pieces[:, 2:])).astype(np.int64)
    total = np.zeros((task.values.shape[1], rows * task.columns))
    for node, weight in zip(nodes, weights, strict=True):
        u, v = (pieces[:, :2] + node * (pieces[:, 2:] - pieces[:, :2]) - cell).T
        across, along = _bspline_basis(u, degree + 1), _bspline_basis(v, degree)
        for j in range(degree + 1):
            row = cell[:, 1] - degree // 2 + j - top
            for i in range(degree + 2):
                column = np.maximum(cell[:, 0] - degree // 2 + i, 0)
                inside = (row >= 0) & (row < rows) & (column < task.columns)
                sample = row[inside] * task.columns + column[inside]
                share = (weight * height * across[i] * along[j])[inside]
                for plane in range(len(total)):
                    value = share * task.values[task.owner[source[inside]], plane]
                    total[plane] += np.bincount(sample, value, minlength=total.shape[1])
    return total.reshape(-1, rows, task.columns)


def _split_at_knots(segments: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(n, 4) pieces of the segments, each inside one sample cell, and (n,) the numbers of their segments."""
    source = [np.arange(len(segments)), np.arange(len(segments))]
    t = [np.zeros(len(segments)), np.ones(len(segments))]
    for axis in (0, 1):
        start, end = segments[:, axis], segments[:, axis + 2]
        low, high = np.minimum(start, end), np.maximum(start, end)
        knots = np.maximum(np.ceil(high) - np.floor(low) - 1, 0).astype(np.int64)
        owner = np.repeat(np.arange(len(segments)), knots)
        knot = np.arange(len(owner)) - np.repeat(np.cumsum(knots) - knots, knots) + np.floor(low)[owner] + 1
        source.append(owner)
        t.append((knot - start[owner]) / (end - start)[owner])
    all_source, all_t = np.concatenate(source), np.concatenate(t)
    order = np.lexsort([all_t, all_source])
    all_source, all_t = all_source[order], all_t[order]
    xy = segments[all_source, :2] + all_t[:, None] * (segments[all_source, 2:] - segments[all_source, :2])
    same_segment = all_source[1:] == all_source[:-1]
    return np.concatenate([xy[:-1], xy[1:]], axis=1)[same_segment], all_source[1:][same_segment]


def _bspline_basis(t: NDArray[np.float64], degree: int) -> list[NDArray[np.float64]]:
    """The degree + 1 uniform B-splines that are not zero in a knot interval, at the fraction t, leftmost first."""
    values = [np.ones_like(t)]
    for d in range(1, degree + 1):
        below = [np.zeros_like(t), *values, np.zeros_like(t)]
        values = [((t + d - r) * below[r] + (1 - t + r) * below[r + 1]) / d for r in range(d + 1)]
    return values
