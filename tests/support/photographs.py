"""Photographs of a written SVG by another renderer: resvg draws it, OpenCV warps, blurs and noises it.

    mm on the sheet -> raster of resvg -> image at OVERSAMPLING times the scale -> mean over boxes -> image

resvg's pixel (0, 0) covers [0, 1] x [0, 1] of the raster, so that its centre stands at 0.5; in every image that OpenCV
touches it stands at 0. The pose below is written anew: nothing is shared with the scenes' camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import resvg_py
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.products.drawing.svg import layout_to_svg

OVERSAMPLING = 4
PAPER = (225, 230, 228)
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """One photograph: pitch in px before the tilt; angles in degrees, the rotation counter-clockwise as seen."""

    pitch_px: float = 20.0
    rotation_deg: float = 0.0
    tilt_deg: float = 0.0
    tilt_axis_deg: float = 0.0
    mirrored: bool = False
    blur_px: float = 0.7
    noise: float = 2.0
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Photograph:
    """``image`` (H, W, 3) uint8 BGR and the markers' true places (M, 2) in its frame."""

    image: NDArray[np.uint8]
    xy_px: NDArray[np.float64]


def rasterise(svg: str, px_per_mm: float) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 BGR, drawn by resvg. Given a width in px it would round the scale; given dpi it does not."""
    png = resvg_py.svg_to_bytes(svg_string=svg, dpi=25.4 * px_per_mm, skip_system_fonts=True)
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image, np.uint8)


def raster_from_layout(layout: Layout, px_per_mm: float) -> Matrix:
    """(3, 3): mm of the layout to a raster's pixels, (0, 0) the centre of the top-left one."""
    left, top = layout.outline_mm[:, 0].min(), layout.outline_mm[:, 1].max()
    s = px_per_mm
    return np.array([[s, 0, -s * left - 0.5], [0, -s, s * top - 0.5], [0, 0, 1]])


def pose(layout: Layout, view: View, focal_px: float) -> Matrix:
    """(3, 3) px from mm about the optical axis: scale, mirror, turn, tilt, perspective."""
    scale = view.pitch_px / float(layout.parameters["pitch_mm"])
    turn, tilt, axis = np.radians([view.rotation_deg, view.tilt_deg, view.tilt_axis_deg])
    cos, sin = np.cos(turn), np.sin(turn)
    flat = np.array([[cos, -sin], [sin, cos]]) @ np.diag([-scale if view.mirrored else scale, scale])
    rotation = cv2.Rodrigues(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))[0]
    space = rotation[:, :2] @ flat  # x right, y up, z towards the camera
    return np.array(
        [
            [focal_px * space[0, 0], focal_px * space[0, 1], 0],
            [-focal_px * space[1, 0], -focal_px * space[1, 1], 0],
            [-space[2, 0], -space[2, 1], focal_px],
        ]
    )


def through(h: Matrix, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 2) through a homography."""
    mapped = np.column_stack([xy, np.ones(len(xy))]) @ h.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def photograph(layout: Layout, view: View, margin_px: int = 12) -> Photograph:
    """The layout's SVG as a camera sees it, as large as the pattern needs."""
    focal_px = 3.0 * view.pitch_px * max(layout.size_mm) / float(layout.parameters["pitch_mm"])
    h = pose(layout, view, focal_px)
    rim = through(h, layout.outline_mm)
    low = np.floor(rim.min(axis=0)) - margin_px
    width, height = (np.ceil(rim.max(axis=0)) + margin_px - low).astype(int)
    h = np.array([[1, 0, -low[0]], [0, 1, -low[1]], [0, 0, 1]]) @ h

    scale = OVERSAMPLING * view.pitch_px / float(layout.parameters["pitch_mm"])
    raster = rasterise(layout_to_svg(layout), scale)
    middle = (
        OVERSAMPLING - 1
    ) / 2  # where a pixel's centre lies among the small pixels that it is the mean of
    finer = np.array([[OVERSAMPLING, 0, middle], [0, OVERSAMPLING, middle], [0, 0, 1]])
    warp = finer @ h @ np.linalg.inv(raster_from_layout(layout, scale))
    size = (int(width) * OVERSAMPLING, int(height) * OVERSAMPLING)
    large = cv2.warpPerspective(raster, warp, size, flags=cv2.INTER_LINEAR, borderValue=PAPER)
    image = cv2.resize(large, (int(width), int(height)), interpolation=cv2.INTER_AREA).astype(np.float32)
    if view.blur_px > 0:
        image = cv2.GaussianBlur(image, (0, 0), view.blur_px)
    noise = np.random.default_rng(view.seed).standard_normal(image.shape, dtype=np.float32)
    noisy = np.clip(np.rint(image + view.noise * noise), 0, 255).astype(np.uint8)
    return Photograph(noisy, through(h, layout.marker_xy_mm))
