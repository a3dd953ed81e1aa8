"""Pictures of triangle meshes by parallel projection, with a depth buffer and dark outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mesh.triangle_mesh import TriangleMesh

Floats = NDArray[np.float64]
OVERSAMPLING = 2
MARGIN_SHARE = 0.04
# Faces turned away from the light keep this share of their color.
AMBIENT_SHARE = 0.35
LIGHT_DIRECTION = np.array([0.35, 0.5, 0.8]) / np.linalg.norm([0.35, 0.5, 0.8])
OUTLINE_BRIGHTNESS, WHITE_BGR = 0.35, (255.0, 255.0, 255.0)
# An outline is a jump in depth by more than this share of the picture's height, or in shade by more than this.
DEPTH_JUMP, SHADE_JUMP = 0.004, 0.07


@dataclass(frozen=True)
class PictureDirection:
    """Direction towards the viewer: the angle about z from the x axis, and the elevation over the xy plane."""

    azimuth_deg: float
    elevation_deg: float

    def axes(self) -> Floats:
        """(3, 3) rows: right, up and towards the viewer."""
        a, e = np.radians([self.azimuth_deg, self.elevation_deg])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, np.cross(towards, right), towards])


ABOVE, BELOW = PictureDirection(-60.0, 35.0), PictureDirection(-60.0, -35.0)


@dataclass(frozen=True, eq=False)
class Framing:
    """The map from mm to pixels for which triangle meshes fill a picture.

    Attributes:
        axes: (3, 3) rows: right, up and towards the viewer.
        middle: (3,) middle of the meshes' bounding box along these axes, mm.
        scale: pixels per mm.
        size_px: width and height of the picture.
    """

    axes: Floats
    middle: Floats
    scale: float
    size_px: tuple[int, int]

    @classmethod
    def of(
        cls, meshes: Sequence[TriangleMesh], direction: PictureDirection, size_px: tuple[int, int]
    ) -> Framing:
        """The framing of meshes in a picture of ``size_px`` (width, height), with a margin of ``MARGIN_SHARE``."""
        projected = np.concatenate([mesh.points for mesh in meshes]) @ direction.axes().T
        low, high = projected.min(axis=0), projected.max(axis=0)
        scale = (1 - 2 * MARGIN_SHARE) * float((np.array(size_px) / (high - low)[:2]).min())
        return cls(direction.axes(), (low + high) / 2, scale, size_px)

    def to_px(self, points: Floats) -> Floats:
        """(..., 3) points from mm to pixels: x right, y down, z towards the viewer in the same unit."""
        x, y, z = np.moveaxis((points @ self.axes.T - self.middle) * self.scale, -1, 0)
        return np.stack([self.size_px[0] / 2 + x, self.size_px[1] / 2 - y, z], axis=-1)


def draw_meshes(
    meshes: Sequence[TriangleMesh], direction: PictureDirection, size_px: tuple[int, int]
) -> NDArray[np.uint8]:
    """Draw meshes so that they fill a picture.

    Args:
        meshes: in mm.
        direction: from the meshes towards the viewer.
        size_px: width and height.

    Returns:
        (height, width, 3) uint8 BGR on white.
    """
    import cv2

    from cmpdesign._native import depth_buffer

    width, height = (OVERSAMPLING * side for side in size_px)
    framing = Framing.of(meshes, direction, (width, height))
    corners = np.concatenate([framing.to_px(mesh.points)[mesh.triangles] for mesh in meshes])
    colors = np.concatenate([np.tile(_color_bgr(mesh.color), (len(mesh.triangles), 1)) for mesh in meshes])
    shades = _triangle_shades(corners * (1, -1, 1), direction)
    depth = np.full((height, width), -np.inf)
    number = np.full((height, width), -1, dtype=np.int64)
    depth_buffer.fill_depth_buffer(corners, depth, number)
    # The last row of every table belongs to the number -1, of pixels without a triangle.
    picture = np.vstack([colors * shades[:, None], [WHITE_BGR]]).astype(np.float32)[number]
    outlines = _find_outlines(depth, number, np.append(shades, 2.0), _depth_slopes(corners))
    picture[outlines] *= OUTLINE_BRIGHTNESS
    small = cv2.resize(picture, size_px, interpolation=cv2.INTER_AREA)
    return np.clip(np.rint(small), 0, 255).astype(np.uint8)


def _color_bgr(color: str) -> Floats:
    return np.array([int(color[i : i + 2], 16) for i in (5, 3, 1)], dtype=np.float64)


def _triangle_shades(corners: Floats, direction: PictureDirection) -> Floats:
    """(T,) brightness of each triangle; the light's y component is mirrored for pictures from below."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    light = LIGHT_DIRECTION * (1, 1 if direction.elevation_deg >= 0 else -1, 1)
    return np.asarray(AMBIENT_SHARE + (1 - AMBIENT_SHARE) * np.clip(normals @ light, 0, 1))


def _depth_slopes(corners: Floats) -> Floats:
    """(T + 1, 2) change of a triangle's depth from a pixel to the pixel below and to the pixel right of it; then 0."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slopes = np.abs(normals[:, 1::-1]) / np.maximum(np.abs(normals[:, 2:]), 1e-9)
    return np.vstack([slopes, np.zeros(2)])


def _find_outlines(
    depth: Floats, number: NDArray[np.int64], shades: Floats, slopes: Floats
) -> NDArray[np.bool_]:
    """(H, W) True where depth or shade jumps to the right or lower pixel by more than the faces' own slope."""
    shade = shades[number]
    far = np.where(np.isfinite(depth), depth, -1e6)
    least_jump = DEPTH_JUMP * depth.shape[0]
    outlines = np.zeros(depth.shape, dtype=np.bool_)
    for axis in (0, 1):
        slope = slopes[:, axis][number]
        index = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        after = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        jump = np.abs(np.diff(far, axis=axis)) > least_jump + np.minimum(slope[index], slope[after])
        jump |= np.abs(np.diff(shade, axis=axis)) > SHADE_JUMP
        outlines[index] |= jump
    return outlines


def draw_label(picture: NDArray[np.uint8], text: str, place: tuple[float, float], left: int) -> None:
    """Draw a text at x = ``left`` px and a horizontal line from ``place`` (x, y in px) to the text."""
    import cv2

    x, y = round(place[0]), round(place[1])
    cv2.line(picture, [x + 6, y], [left - 6, y], (190, 190, 190), 1, cv2.LINE_AA)
    origin, color = [left, y + 5], (70, 70, 70)
    cv2.putText(picture, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.55, color, 1, cv2.LINE_AA)
