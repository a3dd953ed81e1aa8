"""The plain camera: a pinhole described by its image of the pattern. For a plane it is a homography from mm to px."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.scene.camera.pinhole import Pinhole
from cmpdesign.scene.errors import STRICT, SceneError


@dataclass(frozen=True)
class Camera:
    """A pinhole whose picture shows the layout's plane.

    Attributes:
        pitch_px: one pitch of the layout at the pattern's middle, without foreshortening by the tilt.
        rotation_deg: rotation of the pattern in the image, counter-clockwise as seen.
        tilt_deg: angle between the optical axis and the pattern's normal, -85 to 85.
        tilt_axis_deg: direction of the tilt's axis, counter-clockwise from the right.
        centre_px: image position of the middle of the pattern's outline; None: the image's centre.
        focal_px: focal length, and distance in px; a small value means strong perspective. None: 1.5 times the
            image's longer side.
        mirrored: the camera sees the pattern's back; None: as designed.
    """

    __pydantic_config__: ClassVar = STRICT

    pitch_px: float = 20.0
    rotation_deg: float = 0.0
    tilt_deg: float = 0.0
    tilt_axis_deg: float = 0.0
    centre_px: tuple[float, float] | None = None
    focal_px: float | None = None
    mirrored: bool | None = None

    def __post_init__(self) -> None:
        if not self.pitch_px > 0:
            raise SceneError(f"pitch_px is {self.pitch_px:g}; it must be above 0 px")
        if not abs(self.tilt_deg) <= 85:
            raise SceneError(f"tilt_deg is {self.tilt_deg:g}; it must lie between -85 and 85 degrees")
        if self.focal_px is not None and not self.focal_px > 0:
            raise SceneError(f"focal_px is {self.focal_px:g}; it must be above 0 px")


def is_mirrored(camera: Camera, layout: Layout) -> bool:
    """Whether this camera sees the layout's back."""
    return layout.mirrored if camera.mirrored is None else camera.mirrored


def pitch_mm(layout: Layout) -> float:
    """The layout's pitch in mm; without this parameter the median length of its edges."""
    if "pitch_mm" in layout.parameters:
        return float(layout.parameters["pitch_mm"])
    ends = layout.marker_xy_mm[layout.edges]
    return float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))


def camera_homography(camera: Camera, layout: Layout, size: tuple[int, int]) -> NDArray[np.float64]:
    """H_image_from_layout, (3, 3) float64, H[2, 2] = 1; ``size`` is the image's (width, height)."""
    focal, (centre_x, centre_y) = _focal_px(camera, size), _centre_px(camera, size)
    scale, middle = camera.pitch_px / pitch_mm(layout), _layout_middle_mm(layout)
    planar = scale * _image_axes(camera, layout)
    from_middle = np.column_stack([np.eye(2), -middle])
    tilted = _tilt_rotation(camera)[:, :2] @ planar
    pose = tilted @ from_middle + np.outer([0.0, 0.0, focal], [0.0, 0.0, 1.0])
    intrinsics = np.array([[focal, 0.0, centre_x], [0.0, focal, centre_y], [0.0, 0.0, 1.0]])
    h = intrinsics @ pose
    return np.asarray(h / h[2, 2], dtype=np.float64)


def to_pinhole(camera: Camera, layout: Layout, size: tuple[int, int]) -> Pinhole:
    """The equivalent pinhole: its homography of the layout's plane is ``camera_homography``."""
    focal = _focal_px(camera, size)
    planar = _image_axes(camera, layout)
    # From the front the layout's z axis points towards the camera, from the back away from the camera.
    r = _tilt_rotation(camera) @ np.block(
        [[planar, np.zeros((2, 1))], [np.zeros((1, 2)), np.linalg.det(planar)]]
    )
    centre_mm = np.array([0.0, 0.0, focal * pitch_mm(layout) / camera.pitch_px])
    return Pinhole(
        (focal, focal),
        _centre_px(camera, size),
        R_camera_from_layout=r,
        t_camera_from_layout_mm=centre_mm - r[:, :2] @ _layout_middle_mm(layout),
    )


def _focal_px(camera: Camera, size: tuple[int, int]) -> float:
    return camera.focal_px if camera.focal_px is not None else 1.5 * max(size)


def _centre_px(camera: Camera, size: tuple[int, int]) -> tuple[float, float]:
    return camera.centre_px or ((size[0] - 1) / 2, (size[1] - 1) / 2)


def _layout_middle_mm(layout: Layout) -> NDArray[np.float64]:
    """(2,) mm: the middle of the outline's bounding box."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    return np.asarray(np.round(0.5 * (low + high), 9))


def _image_axes(camera: Camera, layout: Layout) -> NDArray[np.float64]:
    """(2, 2): the layout's axes in image coordinates, before the tilt."""
    turn = np.radians(camera.rotation_deg)
    side = -1.0 if is_mirrored(camera, layout) else 1.0
    cos, sin = np.cos(turn), np.sin(turn)
    # The image's y points down: a rotation that looks counter-clockwise is clockwise in image coordinates.
    return np.asarray(np.diag([1.0, -1.0]) @ np.array([[cos, -sin], [sin, cos]]) @ np.diag([side, 1.0]))


def _tilt_rotation(camera: Camera) -> NDArray[np.float64]:
    axis = np.radians(camera.tilt_axis_deg)
    return _axis_rotation(np.array([np.cos(axis), -np.sin(axis), 0.0]), np.radians(camera.tilt_deg))


def _axis_rotation(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Rotation matrix about a unit axis (Rodrigues)."""
    x, y, z = axis[0], axis[1], axis[2]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross))


def project_by_homography(h: NDArray[np.float64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map points (..., 2) mm by a homography to px.

    Raises:
        SceneError: a point lies behind the camera.
    """
    x, y = xy[..., 0], xy[..., 1]
    depth = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    if not np.all(depth > 1e-3):
        raise SceneError(
            "a part of the pattern lies behind the camera; "
            "take a smaller tilt_deg, a smaller pitch_px or a larger focal_px"
        )
    u = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / depth
    v = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / depth
    return np.asarray(np.stack([u, v], axis=-1), dtype=np.float64)
