"""One view of a sensor: a pinhole with OpenCV's distortion, direct or through mirrors, and its exact inverse.

Camera frame: x right, y down, z forward; x_camera = R x_layout + t. An odd number of mirrors between the pattern and
the camera makes det R = -1: such a view is the mirrored picture of a virtual camera.
Distortion (k1, k2, p1, p2, k3) acts on normalised coordinates x = X / Z, y = Y / Z, r^2 = x^2 + y^2:

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

The model is valid up to the fold radius, at which the radial part turns back. Points beyond it have no picture.
Where a window and a gel lie before the pattern, X, Y, Z are the direction in which the camera sees it, see ``medium``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.errors import RigError
from extractor.space.medium import (
    Lines,
    Medium,
    PlacedWindow,
    WindowPlane,
    cross_matrix,
    gel_depth_mm,
    place_window,
    refract_points,
    refract_rays,
)

Array = NDArray[np.float64]

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)
MAX_ITERATIONS = 60  # of Newton's method
CONVERGED = 1e-13  # error in normalised coordinates, far below the accuracy of a pixel
ACCEPTED = 1e-9  # error in normalised coordinates above which a point has no inverse
MAX_HALVINGS = 12  # of a Newton step
MAX_ORTHONORMALITY_ERROR = 1e-6  # of R R^T from the identity


class Distortion(NamedTuple):
    """The coefficients of OpenCV's distortion, see the module."""

    k1: float
    k2: float
    p1: float
    p2: float
    k3: float


class Linearisation(NamedTuple):
    """Projected points and their derivatives; NaN where a point has no picture.

    Attributes:
        xy_px: (N, 2) float64, in the frame of the full image.
        by_point: (N, 2, 3) float64, px/mm, by the point in the layout frame.
        by_pose: (N, 2, 6) float64, by the pose: a turn (rad) of the pattern about the layout's origin along the
            camera's axes, then a shift (mm) along these axes.
    """

    xy_px: Array
    by_point: Array
    by_pose: Array


@dataclass(frozen=True, eq=False)
class View:
    """A camera's picture of the pattern, which fills the image or an area of it.

    Attributes:
        name: for messages and files.
        focal_px: (fx, fy).
        centre_px: (cx, cy), the principal point, in the frame of the full image.
        distortion: (k1, k2, p1, p2, k3).
        area_px: (x, y, width, height) of the part of the image that this view fills; None: the whole image.
        mirrored: an odd number of mirrors between the pattern and the camera; None: by det R, False without R.
        R_camera_from_layout: (3, 3) float64, orthonormal, det -1 where mirrored; None: not known.
        t_camera_from_layout_mm: (3,) float64; None: not known.
        medium: layers between the pattern and the camera; None or layers of 0 mm: air.
        window: the window's outer face in the camera's frame; the gel then reaches from the window to the pattern.
            None: the window is parallel to the pattern at rest, ``gel_mm`` before it.

    Raises:
        RigError: a value that is impossible for a camera.
    """

    name: str
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = NO_DISTORTION
    area_px: tuple[int, int, int, int] | None = None
    mirrored: bool | None = None
    R_camera_from_layout: Any = None
    t_camera_from_layout_mm: Any = None
    medium: Medium | None = None
    window: WindowPlane | None = None

    def __post_init__(self) -> None:
        self._check_intrinsics()
        self._check_window()
        rotation, shift = self.R_camera_from_layout, self.t_camera_from_layout_mm
        if (rotation is None) != (shift is None):
            raise RigError(
                f"view {self.name!r}: R_camera_from_layout and t_camera_from_layout_mm go together; give both or none"
            )
        if rotation is None:
            object.__setattr__(self, "mirrored", bool(self.mirrored))
            return
        rotation, shift = np.array(rotation, np.float64), np.array(shift, np.float64)
        self._check_pose(rotation, shift)
        object.__setattr__(self, "R_camera_from_layout", rotation)
        object.__setattr__(self, "t_camera_from_layout_mm", shift)
        object.__setattr__(self, "mirrored", bool(np.linalg.det(rotation) < 0))

    def _check_intrinsics(self) -> None:
        for name, count in (("focal_px", 2), ("centre_px", 2), ("distortion", 5)):
            values = np.asarray(getattr(self, name), np.float64)
            if values.shape != (count,) or not np.isfinite(values).all():
                raise RigError(
                    f"view {self.name!r}: {name} is {getattr(self, name)}; expected {count} finite numbers"
                )
            object.__setattr__(self, name, tuple(float(v) for v in values))
        if min(self.focal_px) <= 0:
            raise RigError(
                f"view {self.name!r}: focal_px is {self.focal_px}; expected two numbers above 0 px"
            )
        if self.area_px is not None:
            area = tuple(int(v) for v in self.area_px)
            if len(area) != 4 or min(area[:2]) < 0 or min(area[2:]) < 1:
                raise RigError(
                    f"view {self.name!r}: area_px is {self.area_px}; expected x, y from 0 and width, height from 1 px"
                )
            object.__setattr__(self, "area_px", area)

    def _check_window(self) -> None:
        if self.medium is not None and self.medium.is_air:
            object.__setattr__(self, "medium", None)
        if self.window is None:
            return
        normal, distance_mm = np.asarray(self.window.normal, np.float64), float(self.window.distance_mm)
        if normal.shape != (3,) or not np.isfinite(normal).all() or not normal[2] > 0:
            raise RigError(
                f"view {self.name!r}: window_normal is {list(self.window.normal)}; expected 3 numbers that point away "
                "from the camera, the last one above 0"
            )
        if not 0 < distance_mm < np.inf:
            raise RigError(
                f"view {self.name!r}: window_distance_mm is {distance_mm:g}; expected a number above 0 mm"
            )
        x, y, z = (float(v) for v in normal / np.linalg.norm(normal))
        object.__setattr__(self, "window", WindowPlane((x, y, z), distance_mm))

    def _check_pose(self, rotation: Array, shift: Array) -> None:
        prefix = f"view {self.name!r}: "
        if rotation.shape != (3, 3) or not np.allclose(
            rotation @ rotation.T, np.eye(3), atol=MAX_ORTHONORMALITY_ERROR
        ):
            raise RigError(f"{prefix}R_camera_from_layout is not a 3 x 3 rotation or reflection")
        if shift.shape != (3,) or not np.isfinite(shift).all():
            raise RigError(f"{prefix}t_camera_from_layout_mm is {shift}; expected 3 finite numbers")
        if self.mirrored is not None and bool(self.mirrored) != (np.linalg.det(rotation) < 0):
            raise RigError(
                f"{prefix}mirrored is {str(bool(self.mirrored)).lower()}, but det R is {np.linalg.det(rotation):+.0f}; "
                "an odd number of mirrors means -1"
            )

    @property
    def placed(self) -> bool:
        """Whether the pose is known."""
        return self.R_camera_from_layout is not None

    @property
    def position_mm(self) -> Array:
        """(3,) float64, the position of the camera, or of its mirror image, in the layout frame."""
        return np.asarray(-self.R_camera_from_layout.T @ self.t_camera_from_layout_mm)

    @cached_property
    def _placed_window(self) -> PlacedWindow | None:
        """The window before this placed view; None in air."""
        if self.medium is None:
            return None
        return place_window(self.medium, self.window, self.R_camera_from_layout, self.t_camera_from_layout_mm)

    @cached_property
    def fold_radius(self) -> float:
        """The normalised radius at which the radial distortion turns back; infinite without one."""
        k = Distortion(*self.distortion)
        # roots in 1 / r^2, so that weak coefficients do not overflow
        inverse_squares = np.roots([1.0, 3 * k.k1, 5 * k.k2, 7 * k.k3])
        real = inverse_squares.real[abs(inverse_squares.imag) <= 1e-9 * abs(inverse_squares)]
        largest = float(real.max(initial=0.0))
        return float(1 / np.sqrt(largest)) if largest > 1e-12 else np.inf

    def at(self, rotation: Array, shift: Array) -> View:
        """The same view with this pose."""
        return replace(self, mirrored=None, R_camera_from_layout=rotation, t_camera_from_layout_mm=shift)

    def project(self, xyz_mm: Array) -> Array:
        """(N, 2) px of points (N, 3) mm in the layout frame; NaN behind the camera and beyond the fold radius."""
        return self.linearised(xyz_mm).xy_px

    def linearised(self, xyz_mm: Array) -> Linearisation:
        """The projections of points (N, 3) mm in the layout frame, and their derivatives by point and pose."""
        rotated = xyz_mm @ self.R_camera_from_layout.T
        window, seen = self._placed_window, None
        camera = rotated + self.t_camera_from_layout_mm
        if window is not None:
            seen = refract_points(window, rotated, self.t_camera_from_layout_mm)
            camera = seen.xyz
        depth = np.where(camera[:, 2] > 0, camera[:, 2], np.nan)
        normalised = camera[:, :2] / depth[:, None]
        normalised[np.hypot(*normalised.T) >= self.fold_radius] = np.nan
        distorted, by_normalised = distort_points(normalised, self.distortion)
        by_camera = np.zeros((len(normalised), 2, 3))
        by_camera[:, 0, 0] = by_camera[:, 1, 1] = 1 / depth
        by_camera[:, :, 2] = -normalised / depth[:, None]
        by_camera = np.array(self.focal_px)[:, None] * (by_normalised @ by_camera)
        xy_px = distorted * self.focal_px + self.centre_px
        if seen is not None:
            by_point = by_camera @ seen.by_point @ self.R_camera_from_layout
            return Linearisation(xy_px, by_point, by_camera @ seen.by_pose)
        by_pose = np.concatenate([by_camera @ -cross_matrix(rotated), by_camera], axis=2)
        return Linearisation(xy_px, by_camera @ self.R_camera_from_layout, by_pose)

    def normalised(self, xy_px: Array) -> Array:
        """(N, 2) undistorted X / Z, Y / Z of pixels (N, 2); NaN where the distortion has no inverse."""
        distorted = np.asarray((xy_px - self.centre_px) / self.focal_px)
        return undistort_points(distorted, self.distortion, self.fold_radius)

    def rays(self, xy_px: Array) -> Lines:
        """The lines of sight of pixels (N, 2) in the layout frame, at the pattern.

        In air all lines start at the camera, behind a window at its inner face; NaN as in ``normalised``.
        """
        normalised = self.normalised(xy_px)
        direction = np.column_stack([normalised, np.ones(len(normalised))])
        if self._placed_window is not None:
            lines = refract_rays(self._placed_window, direction)
            origin_mm = (lines.origin_mm - self.t_camera_from_layout_mm) @ self.R_camera_from_layout
            return Lines(origin_mm, lines.direction @ self.R_camera_from_layout)
        direction = direction @ self.R_camera_from_layout
        unit = np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))
        return Lines(np.tile(self.position_mm, (len(unit), 1)), unit)

    def is_ahead(self, xyz_mm: Array) -> NDArray[np.bool_]:
        """(N,) bool, which points (N, 3) mm of the layout frame lie before the camera, behind its window if any."""
        if self._placed_window is None:
            return np.asarray(xyz_mm @ self.R_camera_from_layout[2] + self.t_camera_from_layout_mm[2] > 0)
        camera = xyz_mm @ self.R_camera_from_layout.T + self.t_camera_from_layout_mm
        return np.isfinite(gel_depth_mm(self._placed_window, camera))


def is_finite(values: Array, axes: int = 1) -> NDArray[np.bool_]:
    """Whether all numbers along this number of last axes are finite."""
    return np.asarray(np.isfinite(values).all(axis=tuple(range(-axes, 0))))


def is_covariance(cov_px2: Array) -> NDArray[np.bool_]:
    """(...,) bool, which matrices (..., 2, 2) are finite and positive definite; pixels with others count as unseen."""
    safe = np.where(is_finite(cov_px2, 2)[..., None, None], cov_px2, 0.0)
    determinant = safe[..., 0, 0] * safe[..., 1, 1] - safe[..., 0, 1] * safe[..., 1, 0]
    return np.asarray((safe[..., 0, 0] > 0) & (determinant > 0))


def distort_points(normalised: Array, distortion: tuple[float, ...]) -> tuple[Array, Array]:
    """(N, 2) distorted coordinates of undistorted ones (N, 2), and their derivatives (N, 2, 2).

    Args:
        normalised: X / Z, Y / Z.
        distortion: (k1, k2, p1, p2, k3).
    """
    k = Distortion(*distortion)
    p1, p2 = k.p1, k.p2
    x, y = normalised.T
    r2 = x * x + y * y
    radial = 1 + r2 * (k.k1 + r2 * (k.k2 + r2 * k.k3))
    slope = 2 * (k.k1 + r2 * (2 * k.k2 + r2 * 3 * k.k3))  # 2 d radial / d r^2
    distorted = np.column_stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ]
    )
    derivatives = np.empty((len(normalised), 2, 2))
    derivatives[:, 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    derivatives[:, 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    derivatives[:, 0, 1] = derivatives[:, 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
    return distorted, derivatives


def undistort_points(distorted: Array, distortion: tuple[float, ...], fold_radius: float = np.inf) -> Array:
    """(N, 2) undistorted coordinates of distorted ones (N, 2), by damped Newton steps to 1e-13; NaN without an inverse.

    The usual fixed-point iteration may diverge at strong distortion without an error. A result of this function lies
    within the fold radius and is mapped onto the input again.
    """
    if not any(distortion):
        return distorted.copy()
    radius = np.hypot(*distorted.T)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        normalised = distorted * np.minimum(1.0, 0.9 * fold_radius / radius)[:, None]
    normalised[radius == 0] = 0.0
    error = np.full(len(distorted), np.inf)
    for _ in range(MAX_ITERATIONS):
        predicted, derivatives = distort_points(normalised, distortion)
        residual = distorted - predicted
        error = np.hypot(*residual.T)
        active = np.flatnonzero(error > CONVERGED * (1 + radius))
        if not len(active):
            break
        step = _newton_step(residual[active], derivatives[active])
        moved = _damped_step(
            normalised[active], step, distorted[active], error[active], distortion, fold_radius
        )
        if np.array_equal(moved, normalised[active], equal_nan=True):
            break
        normalised[active] = moved
    _, derivatives = distort_points(normalised, distortion)
    valid = np.asarray((error < ACCEPTED * (1 + radius)) & (np.hypot(*normalised.T) < fold_radius))
    valid &= np.linalg.det(np.where(np.isfinite(derivatives), derivatives, 0.0)) > 0
    normalised[~valid] = np.nan
    return np.asarray(normalised)


def _newton_step(residual: Array, derivatives: Array) -> Array:
    """(N, 2) solutions of 2 x 2 systems (N, 2, 2) for residuals (N, 2); not finite where singular."""
    (a, b), (c, d) = derivatives.transpose(1, 2, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        step = np.column_stack(
            [d * residual[:, 0] - b * residual[:, 1], a * residual[:, 1] - c * residual[:, 0]]
        )
        step /= (a * d - b * c)[:, None]
    return step


def _damped_step(
    start: Array,
    step: Array,
    distorted: Array,
    error: Array,
    distortion: tuple[float, ...],
    fold_radius: float,
) -> Array:
    """(N, 2) points after their steps, each halved until its ``error`` (N,) decreases within the fold radius.

    Points whose error does not decrease are not moved.
    """
    moved = start.copy()
    waiting = np.isfinite(step).all(axis=1)
    for _ in range(MAX_HALVINGS):
        tried = start + step
        better = np.hypot(*(distorted - distort_points(tried, distortion)[0]).T) < error
        better &= waiting & (np.hypot(*tried.T) < fold_radius)
        moved[better] = tried[better]
        waiting &= ~better
        if not waiting.any():
            break
        step = 0.5 * step
    return moved
