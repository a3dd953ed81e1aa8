"""A camera with any pose and one of OpenCV's lenses. Several pinholes may share one image.

    x_camera = R_camera_from_layout @ x_layout + t_camera_from_layout_mm

in mm: the camera frame has x right, y down, z forward. One mirror between the view and the camera makes det R = -1.
Through a window and a gel, the camera sees a point where its light leaves the window, see ``medium``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.camera.lens import COUNTS, LensKind, distort, reach_of
from cmpdesign.scene.camera.medium import Medium, WindowPlane, points_on_window, window_at_rest
from cmpdesign.scene.errors import SceneError

Points = NDArray[np.float64]
Area = tuple[int, int, int, int]  # x, y, width, height in px, as users write it

NEAREST_MM = 1e-3  # smallest depth before the camera
ORTHOGONAL = 1e-6  # largest deviation of R R^T from the unit matrix


def _front_rotation() -> Points:
    """(3, 3) rotation of a camera in front of the pattern: x right, y down, z into the pattern."""
    return np.diag([1.0, -1.0, -1.0])


class ViewDirection(NamedTuple):
    """The direction from which a camera sees a point.

    Attributes:
        tilt_deg: angle between the pattern's normal and the optical axis, -85 to 85.
        azimuth_deg: direction of the tilt, counter-clockwise from the layout's x axis.
        roll_deg: rotation of the pattern in the image, counter-clockwise as seen; at 0 the layout's y points up.
        target_mm: the point on the optical axis, layout frame.
        back: the camera is behind the pattern, at negative z.
        mirror: the image is flipped left to right, as by a mirror before the camera.
    """

    tilt_deg: float = 0.0
    azimuth_deg: float = 0.0
    roll_deg: float = 0.0
    target_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    back: bool = False
    mirror: bool = False


@dataclass(frozen=True, eq=False)
class Pinhole:
    """A view of the pattern.

    Attributes:
        focal_px: fx, fy.
        centre_px: the principal point cx, cy in the whole image's frame.
        distortion: the lens' coefficients in OpenCV's order, see ``lens``.
        R_camera_from_layout: (3, 3) float64, orthogonal; det -1 with a mirror between pattern and camera.
        t_camera_from_layout_mm: (3,) float64.
        area_px: x, y, width, height of the image's part that this view fills; None: the whole image.
        name: the view's name in messages.
        window: the window's outer face in the camera's frame, where the scene has a medium; None: parallel to the
            pattern at rest, behind the medium's gel.
        lens: the model of the lens.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    R_camera_from_layout: Points = field(default_factory=_front_rotation)
    t_camera_from_layout_mm: Points = field(default_factory=lambda: np.array([0.0, 0.0, 50.0]))
    area_px: Area | None = None
    name: str = ""
    window: WindowPlane | None = None
    lens: LensKind = "perspective"

    def __post_init__(self) -> None:
        r = _frozen_array(self.R_camera_from_layout, (3, 3), "R_camera_from_layout")
        t = _frozen_array(self.t_camera_from_layout_mm, (3,), "t_camera_from_layout_mm")
        object.__setattr__(self, "R_camera_from_layout", r)
        object.__setattr__(self, "t_camera_from_layout_mm", t)
        if not min(self.focal_px) > 0:
            raise SceneError(f"focal_px is {tuple(self.focal_px)}; both must be above 0 px")
        if not np.isfinite([*self.focal_px, *self.centre_px, *self.distortion]).all():
            raise SceneError("focal_px, centre_px and distortion must be finite numbers")
        if len(self.distortion) not in COUNTS[self.lens]:
            raise SceneError(
                f"distortion has {len(self.distortion)} numbers; a {self.lens} lens has "
                f"{' or '.join(map(str, COUNTS[self.lens]))}"
            )
        error = float(np.abs(r @ r.T - np.eye(3)).max())
        if error > ORTHOGONAL:
            raise SceneError(
                f"R_camera_from_layout is no rotation or reflection: R R^T is off the unit matrix by {error:.3g}, "
                f"at most {ORTHOGONAL:g} is allowed; give its numbers with more digits"
            )
        if self.window is not None and not (
            np.isfinite([*self.window.normal, self.window.distance_mm]).all()
            and self.window.normal[2] > 0
            and self.window.distance_mm > 0
        ):
            raise SceneError(
                f"window_normal is {list(self.window.normal)} and window_distance_mm {self.window.distance_mm:g}; the "
                "normal points away from the camera (its last number is above 0), and the distance is above 0 mm"
            )
        if self.area_px is not None and (min(self.area_px[:2]) < 0 or min(self.area_px[2:]) < 1):
            raise SceneError(
                f"area_px is {tuple(self.area_px)}; it is x, y (0 or more), width, height (1 or more) in px"
            )

    @property
    def position_mm(self) -> Points:
        """(3,) the camera's centre in the layout frame."""
        return np.asarray(-self.R_camera_from_layout.T @ self.t_camera_from_layout_mm)

    @property
    def mirrored(self) -> bool:
        """Whether the pattern at rest appears as from its back."""
        front = self.position_mm[2] > 0
        return bool(front == (np.linalg.det(self.R_camera_from_layout) < 0))

    @property
    def intrinsics(self) -> Points:
        """(3, 3): the matrix from normalised coordinates to px."""
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def homography(self) -> Points | None:
        """(3, 3) image from the layout's plane, H[2, 2] = 1; None with lens distortion.

        Raises:
            SceneError: the layout's origin has no depth before the camera.
        """
        if any(self.distortion) or self.lens != "perspective":
            return None
        h = self.intrinsics @ np.column_stack(
            [self.R_camera_from_layout[:, :2], self.t_camera_from_layout_mm]
        )
        if abs(h[2, 2]) < NEAREST_MM:
            raise SceneError(
                "the layout's origin lies beside the camera, not before the camera; move the camera away"
            )
        return np.asarray(h / h[2, 2])

    @cached_property
    def reach(self) -> float:
        """The normalised radius before the lens, up to which the radius after the lens grows; inf: always."""
        return reach_of(self.lens, self.distortion)

    def reflected(self, point_mm: Sequence[float], normal: Sequence[float]) -> Pinhole:
        """This camera behind a plane mirror: it sees the pattern's reflection.

        Args:
            point_mm: (3,) a point of the mirror, layout frame.
            normal: (3,) the mirror's normal, of any length.

        Raises:
            SceneError: the camera has a ``window``, whose plane would be another one in the reflected frame.
        """
        if self.window is not None:
            raise SceneError("give the window's plane to the reflected view, in its own frame")
        point, n = np.asarray(point_mm, dtype=np.float64), np.asarray(normal, dtype=np.float64)
        n = n / np.linalg.norm(n)
        r, t = self.R_camera_from_layout, self.t_camera_from_layout_mm
        return replace(
            self,
            R_camera_from_layout=r @ (np.eye(3) - 2 * np.outer(n, n)),
            t_camera_from_layout_mm=t + 2 * (point @ n) * (r @ n),
        )

    @classmethod
    def looking(
        cls,
        size: tuple[int, int],
        *,
        distance_mm: float,
        field_of_view_deg: float,
        distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0),
        lens: LensKind = "perspective",
        area_px: Area | None = None,
        name: str = "",
        **direction: Any,
    ) -> Pinhole:
        """A camera whose optical axis passes through a point, at the middle of the area.

        Args:
            size: the image's (width, height) px.
            distance_mm: distance from the camera's centre to the target.
            field_of_view_deg: angle across the area's width, without distortion.
            distortion, lens, area_px, name: see ``Pinhole``.
            direction: the fields of ``ViewDirection``, by keyword: ``tilt_deg``, ``azimuth_deg``, ``roll_deg``,
                ``target_mm``, ``back``, ``mirror``.

        Raises:
            SceneError: a value is out of range.
            TypeError: an unknown keyword.
        """
        view = ViewDirection(**direction)
        if not distance_mm > NEAREST_MM:
            raise SceneError(f"distance_mm is {distance_mm:g}; it must be above {NEAREST_MM:g} mm")
        if not 0 < field_of_view_deg < 180:
            raise SceneError(
                f"field_of_view_deg is {field_of_view_deg:g}; it must lie between 0 and 180 degrees"
            )
        if not abs(view.tilt_deg) <= 85:
            raise SceneError(f"tilt_deg is {view.tilt_deg:g}; it must lie between -85 and 85 degrees")
        x, y, width, height = area_px or (0, 0, *size)
        focal_px = float(0.5 * width / np.tan(np.radians(field_of_view_deg) / 2))
        r = _looking_rotation(view)
        t = np.array([0.0, 0.0, distance_mm]) - r @ np.asarray(view.target_mm, dtype=np.float64)
        if view.mirror:
            flip = np.diag([-1.0, 1.0, 1.0])
            r, t = flip @ r, flip @ t
        centre_px = (x + (width - 1) / 2, y + (height - 1) / 2)
        return cls((focal_px, focal_px), centre_px, distortion, r, t, area_px, name, lens=lens)


def _looking_rotation(view: ViewDirection) -> Points:
    """(3, 3) rotation of ``Pinhole.looking``."""
    tilt, azimuth, roll = np.radians([view.tilt_deg, view.azimuth_deg, view.roll_deg])
    side = -1.0 if view.back else 1.0
    towards = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), side * np.cos(tilt)])
    forward = -towards
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    upright = np.stack([right, np.cross(forward, right), forward])
    cos, sin = np.cos(roll), np.sin(roll)
    # The image's y points down: a rotation that looks counter-clockwise is clockwise in image coordinates.
    return np.asarray(np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ upright)


def _frozen_array(value: object, shape: tuple[int, ...], name: str) -> Points:
    array = np.array(value, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise SceneError(f"{name} has the shape {array.shape}; it must hold finite numbers of shape {shape}")
    array.setflags(write=False)
    return array


def project_3d(camera: Pinhole, xyz_mm: Points, medium: Medium | None = None) -> Points:
    """Project points (N, 3) mm of the layout frame to (N, 2) px of the whole image.

    Args:
        camera: the view.
        xyz_mm: the points.
        medium: window and gel before them; None: air.

    Raises:
        SceneError: a point lies behind the camera or in the window, or beyond the radius where the distortion is
            defined.
    """
    r, t = camera.R_camera_from_layout, camera.t_camera_from_layout_mm
    xyz_camera = xyz_mm @ r.T + t
    if medium is not None:
        try:
            xyz_camera = points_on_window(medium, camera.window or window_at_rest(medium, r, t), xyz_camera)
        except SceneError as error:
            raise SceneError(f"{_camera_label(camera)}{error}") from None
    depth = xyz_camera[:, 2]
    if not np.all(depth > NEAREST_MM):
        if not np.isfinite(depth).all():
            raise SceneError(f"{_camera_label(camera)}the surface is not finite everywhere; correct the map")
        worst = int(np.argmin(depth))
        position = ", ".join(f"{value:.3g}" for value in xyz_mm[worst])
        raise SceneError(
            f"{_camera_label(camera)}a part of the pattern lies behind the camera: ({position}) mm has a depth of "
            f"{depth[worst]:.3g} mm, it must be above 0 mm; move the camera away or tilt it less"
        )
    xy = xyz_camera[:, :2] / depth[:, None]
    if any(camera.distortion) or camera.lens != "perspective":
        xy = distort_points(camera, xy)
    return np.asarray(xy * np.asarray(camera.focal_px) + np.asarray(camera.centre_px))


def depth_mm(camera: Pinhole, xyz_mm: Points) -> Points:
    """(N,) depth in mm before the camera, along its axis, of points (N, 3) mm of the layout frame."""
    return np.asarray(xyz_mm @ camera.R_camera_from_layout[2] + camera.t_camera_from_layout_mm[2])


def distort_points(camera: Pinhole, xy: Points) -> Points:
    """Normalised coordinates (N, 2) after the lens, of coordinates (N, 2) before it.

    Raises:
        SceneError: a point lies beyond ``Pinhole.reach``.
    """
    radius = np.hypot(*xy.T).max(initial=0.0)
    if radius >= camera.reach:
        raise SceneError(
            f"{_camera_label(camera)}the pattern reaches {radius:.3g} focal lengths from the "
            f"optical axis, but the "
            f"distortion turns back on itself at {camera.reach:.3g}; take a weaker distortion or move the camera away"
        )
    return distort(camera.lens, camera.distortion, xy)


def _camera_label(camera: Pinhole) -> str:
    return f"view {camera.name}: " if camera.name else ""
