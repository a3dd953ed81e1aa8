"""Meshes drawn without a graphics card: parallel projection, depth buffer, dark outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mesh.triangle_mesh import TriangleMesh

Floats = NDArray[np.float64]
OVERSAMPLING = 2
MARGIN_SHARE = 0.04
# Faces that turn away from the light keep this much of their color.
AMBIENT_SHARE = 0.35
LIGHT_DIRECTION = np.array([0.35, 0.5, 0.8]) / np.linalg.norm([0.35, 0.5, 0.8])
OUTLINE_BRIGHTNESS = 0.35
# A step in depth is an outline when it exceeds this share of the picture's height; in shade, this difference.
DEPTH_STEP, SHADE_STEP = 0.004, 0.07


@dataclass(frozen=True)
class ViewDirection:
    """Where the picture is taken from: around z from the x axis, and above (below: negative) the plan."""

    azimuth_deg: float
    elevation_deg: float

    def axes(self) -> Floats:
        """(3, 3) rows: right, up and towards the viewer."""
        a, e = np.radians([self.azimuth_deg, self.elevation_deg])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, np.cross(towards, right), towards])


ABOVE, BELOW = ViewDirection(-60.0, 35.0), ViewDirection(-60.0, -35.0)


@dataclass(frozen=True, eq=False)
class Framing:
    """Where meshes come to lie in a picture that they fill.

    Attributes:
        axes: of the view.
        middle: (3,) of the meshes' box, along these axes, mm.
        scale: pixels per mm.
        size_px: width and height.
    """

    axes: Floats
    middle: Floats
    scale: float
    size_px: tuple[int, int]

    @classmethod
    def of(cls, meshes: Sequence[TriangleMesh], view: ViewDirection, size_px: tuple[int, int]) -> Framing:
        seen = np.concatenate([mesh.points for mesh in meshes]) @ view.axes().T
        low, high = seen.min(axis=0), seen.max(axis=0)
        scale = (1 - 2 * MARGIN_SHARE) * float((np.array(size_px) / (high - low)[:2]).min())
        return cls(view.axes(), (low + high) / 2, scale, size_px)

    def to_px(self, points: Floats) -> Floats:
        """(..., 3) points in pixels, y down; z grows towards the viewer in the same unit."""
        x, y, z = np.moveaxis((points @ self.axes.T - self.middle) * self.scale, -1, 0)
        return np.stack([self.size_px[0] / 2 + x, self.size_px[1] / 2 - y, z], axis=-1)


def draw_meshes(
    meshes: Sequence[TriangleMesh], view: ViewDirection, size_px: tuple[int, int]
) -> NDArray[np.uint8]:
    """(height, width, 3) uint8 BGR."""
    import cv2

    from cmpdesign.products.mesh.depth_buffer import fill_depth_buffer

    width, height = (OVERSAMPLING * side for side in size_px)
    framing = Framing.of(meshes, view, (width, height))
    scaled = np.concatenate([framing.to_px(mesh.points)[mesh.triangles] for mesh in meshes])
    colors = np.concatenate([np.tile(_color_bgr(mesh.color), (len(mesh.triangles), 1)) for mesh in meshes])
    shades = _triangle_shades(scaled * (1, -1, 1), view)
    depth = np.full((height, width), -np.inf)
    number = np.full((height, width), -1, dtype=np.int64)
    fill_depth_buffer(scaled, depth, number)
    picture = np.full((height, width, 3), 255.0)
    hit = number >= 0
    picture[hit] = colors[number[hit]] * shades[number[hit]][:, None]
    lines = _find_outlines(depth, number, shades, _depth_slopes(scaled))
    picture[lines] *= OUTLINE_BRIGHTNESS
    small = cv2.resize(picture.astype(np.float32), size_px, interpolation=cv2.INTER_AREA)
    return np.clip(np.rint(small), 0, 255).astype(np.uint8)


def _color_bgr(color: str) -> Floats:
    return np.array([int(color[i : i + 2], 16) for i in (5, 3, 1)], dtype=np.float64)


def _triangle_shades(corners: Floats, view: ViewDirection) -> Floats:
    """(T,) brightness of each triangle; the light stands behind the viewer's shoulder, from below at his knee."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    light = LIGHT_DIRECTION * (1, 1 if view.elevation_deg >= 0 else -1, 1)
    return np.asarray(AMBIENT_SHARE + (1 - AMBIENT_SHARE) * np.clip(normals @ light, 0, 1))


def _depth_slopes(corners: Floats) -> Floats:
    """(T, 2) how much a triangle's depth changes from a pixel to the lower and to the right one."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.abs(normals[:, 1::-1]) / np.maximum(np.abs(normals[:, 2:]), 1e-9)


def _find_outlines(
    depth: Floats, number: NDArray[np.int64], shades: Floats, slopes: Floats
) -> NDArray[np.bool_]:
    """Pixels where depth or shade jumps to the right or lower neighbour, by more than the face goes on by."""
    shade = np.where(number >= 0, shades[number], 2.0)
    far = np.where(np.isfinite(depth), depth, -1e6)
    step = DEPTH_STEP * depth.shape[0]
    lines = np.zeros(depth.shape, dtype=np.bool_)
    for axis in (0, 1):
        slope = np.where(number >= 0, slopes[number, axis], 0.0)
        index = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        after = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        jump = np.abs(np.diff(far, axis=axis)) > step + np.minimum(slope[index], slope[after])
        jump |= np.abs(np.diff(shade, axis=axis)) > SHADE_STEP
        lines[index] |= jump
    return lines


def draw_label(picture: NDArray[np.uint8], text: str, at: tuple[float, float], left: int) -> None:
    """A name at the right of what it belongs to, with a line to it."""
    import cv2

    (x, y), ink = (round(value) for value in at), (70, 70, 70)
    cv2.line(picture, [x + 6, y], [left - 6, y], (190, 190, 190), 1, cv2.LINE_AA)
    cv2.putText(picture, text, [left, y + 5], cv2.FONT_HERSHEY_SIMPLEX, 0.55, ink, 1, cv2.LINE_AA)
