"""A reference image of a scene by a method independent of the renderer, and the renderer's error against it.

Every cell's sides are sampled by ``POINTS_PER_SIDE`` points each and intersected with ``LINES_PER_PX`` scan lines per
pixel. The effect of the pixel's box and the blur on each crossing is a closed form. The method has no splines, no
contour integrals and no adaptive chords, unlike ``cmpdesign.scene.drawing.coverage`` and ``paths``. It is inexact for
sides along the scan lines.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.special import ndtr

from benchmarks.frame.pooled import rms_of
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import Optics, Scene, Sensor, render
from cmpdesign.scene.drawing.view import SceneView, scene_views

Points = NDArray[np.float64]

POINTS_PER_SIDE, LINES_PER_PX = 512, 48
REACH_SIGMA = 7.0
BAND_ROWS = 30  # drawn at once, to limit memory
MIDDLE_PX = 3.5  # half the box around a gridline's middle in which its offset is fitted


@dataclass(frozen=True)
class ImageWindow:
    """A part of the image: first column and row, width and height."""

    x: int
    y: int
    width: int
    height: int


class RenderError(NamedTuple):
    """The renderer's error in a window of one picture, in 8-bit units and px."""

    name: str
    blur_px: float
    grey_rms: float
    grey_largest: float
    edge_rms_px: float
    edge_largest_px: float
    edges: int


class CellSides(NamedTuple):
    """Straight pieces of the sides of cells: (N, 2) px starts and ends, (N,) numbers of the cells."""

    start: Points
    end: Points
    owner: NDArray[np.int64]


def reference_image(scene: Scene, view: SceneView, window: ImageWindow) -> Points:
    """(height, width, 3) BGR in 8-bit units: the inks over black in every pixel of the window, linear."""
    bands = []
    for top in range(0, window.height, BAND_ROWS):
        rows = min(BAND_ROWS, window.height - top)
        bands.append(_reference_band(scene, view, ImageWindow(window.x, window.y + top, window.width, rows)))
    return np.concatenate(bands)


def _reference_band(scene: Scene, view: SceneView, window: ImageWindow) -> Points:
    layout, blur = scene.layout, scene.blur_px
    cells = np.flatnonzero(layout.cell_color != BLACK)
    black = np.asarray(scene.ink(BLACK)[::-1], dtype=np.float64)
    over = np.array([np.subtract(scene.ink(int(c))[::-1], black) for c in layout.cell_color[cells]])
    start, end, owner = _cell_sides(layout, cells, view, window, blur)
    reach = REACH_SIGMA * blur + 1
    first = window.y - reach
    count = int(np.ceil((window.height - 1 + 2 * reach) * LINES_PER_PX))
    crossing, line = _scan_line_crossings(start, end, first, count)
    x = start[crossing, 0] + (first + (line + 0.5) / LINES_PER_PX - start[crossing, 1]) * (
        (end - start)[crossing, 0] / (end - start)[crossing, 1]
    )
    sign = np.sign((end - start)[crossing, 1]) * -_layout_orientation(layout, view)
    columns = window.x + np.arange(window.width)
    coverage = _blurred_step(columns[None, :] - x[:, None], blur)
    rows = window.y + np.arange(window.height)
    down = (
        _blurred_box(rows[:, None] - (first + (np.arange(count) + 0.5) / LINES_PER_PX), blur) / LINES_PER_PX
    )
    image = np.empty((window.height, window.width, 3))
    for channel in range(3):
        weight = sign * over[owner[crossing], channel]
        gathered = csr_array((weight, (line, np.arange(len(line)))), shape=(count, len(line)))
        image[..., channel] = black[channel] + down @ (gathered @ coverage)
    return image


def _cell_sides(
    layout: Layout, cells: NDArray[np.int64], view: SceneView, window: ImageWindow, blur_px: float
) -> CellSides:
    """The sides of cells that affect the window; ``owner`` is an index of ``cells``."""
    corners = layout.marker_xy_mm[layout.cell_corners[cells]]
    share = (np.arange(POINTS_PER_SIDE) / POINTS_PER_SIDE)[:, None]
    next_corners = np.roll(corners, -1, axis=1)
    points = corners[:, :, None] * (1 - share) + next_corners[:, :, None] * share
    px = view.image_from_layout(points.reshape(-1, 2)).reshape(len(cells), -1, 2)
    reach = REACH_SIGMA * blur_px + 2
    near = (px[..., 1].max(axis=1) > window.y - reach) & (
        px[..., 1].min(axis=1) < window.y + window.height + reach
    )
    px, owner = px[near], np.flatnonzero(near)
    return CellSides(
        px.reshape(-1, 2),
        np.roll(px, -1, axis=1).reshape(-1, 2),
        np.repeat(owner, px.shape[1]),
    )


def _scan_line_crossings(
    start: Points, end: Points, first: float, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(K,) pieces and (K,) scan lines of all crossings; line i lies at first + (i + 0.5) / ``LINES_PER_PX``."""
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    begin = np.clip(np.ceil((low - first) * LINES_PER_PX - 0.5), 0, count).astype(np.int64)
    stop = np.clip(np.ceil((high - first) * LINES_PER_PX - 0.5), 0, count).astype(np.int64)
    number = stop - begin
    piece = np.repeat(np.arange(len(start)), number)
    return piece, np.arange(len(piece)) - np.repeat(np.cumsum(number) - number, number) + begin[piece]


def _layout_orientation(layout: Layout, view: SceneView) -> float:
    """1 if the cells' corners, counter-clockwise in the layout, turn from x to y in the image, else -1."""
    a, b, c = view.image_from_layout(layout.marker_xy_mm[layout.cell_corners[0, :3]])
    return float(np.sign((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]))


def _blurred_step(distance: Points, blur_px: float) -> Points:
    """The value of a pixel at ``distance`` inside a half plane: the integral of ``_blurred_box``."""
    if blur_px == 0:
        return np.clip(distance + 0.5, 0, 1)

    def ramp(z: Points) -> Points:
        return np.asarray(z * ndtr(z) + np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi))

    return blur_px * (ramp((distance + 0.5) / blur_px) - ramp((distance - 0.5) / blur_px))


def _blurred_box(distance: Points, blur_px: float) -> Points:
    """A pixel's box convolved with a Gaussian, along one axis."""
    if blur_px == 0:
        return (np.abs(distance) < 0.5).astype(np.float64)
    return np.asarray(ndtr((distance + 0.5) / blur_px) - ndtr((distance - 0.5) / blur_px))


def measure_render_error(
    name: str, scene: Scene, blur_px: float, window: ImageWindow, size: tuple[int, int]
) -> RenderError:
    """The renderer's error in a window, on linear pictures; of several views in the first view."""
    clean = replace(scene, sensor=Sensor(bits=16, response="linear"), optics=Optics(blur_px))
    view = scene_views(clean, size)[0]
    rows, columns = slice(window.y, window.y + window.height), slice(window.x, window.x + window.width)
    drawn = render(clean, size=size).image[rows, columns] / 257
    true = reference_image(clean, view, window)
    shifts = fit_edge_offsets(drawn - true, true, clean.layout, view, window)
    difference = drawn - true
    return RenderError(
        name,
        blur_px,
        grey_rms=rms_of(difference),
        grey_largest=float(np.abs(difference).max()),
        edge_rms_px=rms_of(shifts),
        edge_largest_px=float(np.abs(shifts).max()),
        edges=len(shifts),
    )


def fit_edge_offsets(
    difference: Points, true: Points, layout: Layout, view: SceneView, window: ImageWindow
) -> Points:
    """(N,) px: the shift of every gridline inside the window along its normal, by least squares."""
    ends = layout.marker_xy_mm[layout.edges]
    middle = view.image_from_layout(ends.mean(axis=1)) - (window.x, window.y)
    direction = view.image_from_layout(0.45 * ends[:, 0] + 0.55 * ends[:, 1]) - (window.x, window.y) - middle
    slope_y, slope_x = np.gradient(true, axis=(0, 1))
    shifts = []
    for (x, y), (along_x, along_y) in zip(middle, direction, strict=True):
        left, top = int(np.ceil(x - MIDDLE_PX)), int(np.ceil(y - MIDDLE_PX))
        right, bottom = int(np.floor(x + MIDDLE_PX)) + 1, int(np.floor(y + MIDDLE_PX)) + 1
        if left < 1 or top < 1 or right >= window.width or bottom >= window.height:
            continue
        box = slice(top, bottom), slice(left, right)
        length = np.hypot(along_x, along_y)
        slope = (slope_x[box] * -along_y + slope_y[box] * along_x) / length
        if (slope**2).sum() > 100.0:  # outermost gridlines have black on both sides
            shifts.append(-(difference[box] * slope).sum() / (slope**2).sum())
    return np.array(shifts)
