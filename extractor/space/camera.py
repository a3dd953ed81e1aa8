"""One view of a sensor: a pinhole with OpenCV's distortion, direct or through mirrors, and its exact inverse.

Camera frame: x right, y down, z forward; x_camera = R x_layout + t. An odd number of mirrors between the pattern and
the camera makes det R = -1: such a view is the picture of a camera that does not exist, drawn the other way around.
Distortion (k1, k2, p1, p2, k3) acts on normalised coordinates x = X / Z, y = Y / Z, r^2 = x^2 + y^2:

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

Beyond the radius at which the radial part turns back, the model means nothing: points there have no picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.errors import RigError

Array = NDArray[np.float64]

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)
MAX_ITERATIONS = 60
CONVERGED = 1e-13  # of normalised coordinates: far below what a pixel tells
MAX_HALVINGS = 12
MAX_ORTHONORMALITY_ERROR = 1e-6  # of R R^T from the identity


@dataclass(frozen=True, eq=False)
class View:
    """A camera's picture of the pattern, or the part of it that fills an area of the image.

    Attributes:
        name: for messages and files.
        focal_px: (fx, fy).
        centre_px: (cx, cy), the principal point, in the frame of the full image.
        distortion: (k1, k2, p1, p2, k3).
        area_px: (x, y, width, height) of the part of the image that this view fills; None: all of it.
        mirrored: an odd number of mirrors between the pattern and the camera; None: as R says, else False.
        R_camera_from_layout: (3, 3) float64, orthonormal, det -1 where mirrored; None: not known.
        t_camera_from_layout_mm: (3,) float64; None: not known.

    Raises:
        RigError: a value that no camera has.
    """

    name: str
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = NO_DISTORTION
    area_px: tuple[int, int, int, int] | None = None
    mirrored: bool | None = None
    R_camera_from_layout: Any = None
    t_camera_from_layout_mm: Any = None

    def __post_init__(self) -> None:
        self._check_intrinsics()
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

    def _check_pose(self, rotation: Array, shift: Array) -> None:
        where = f"view {self.name!r}: "
        if rotation.shape != (3, 3) or not np.allclose(
            rotation @ rotation.T, np.eye(3), atol=MAX_ORTHONORMALITY_ERROR
        ):
            raise RigError(f"{where}R_camera_from_layout is not a 3 x 3 rotation or reflection")
        if shift.shape != (3,) or not np.isfinite(shift).all():
            raise RigError(f"{where}t_camera_from_layout_mm is {shift}; expected 3 finite numbers")
        if self.mirrored is not None and bool(self.mirrored) != (np.linalg.det(rotation) < 0):
            raise RigError(
                f"{where}mirrored is {str(bool(self.mirrored)).lower()}, but det R is {np.linalg.det(rotation):+.0f}; "
                "an odd number of mirrors means -1"
            )

    @property
    def placed(self) -> bool:
        """Its pose is known."""
        return self.R_camera_from_layout is not None

    @property
    def position_mm(self) -> Array:
        """(3,) where the camera, or its mirror image, stands in the layout frame."""
        return np.asarray(-self.R_camera_from_layout.T @ self.t_camera_from_layout_mm)

    @cached_property
    def fold_radius(self) -> float:
        """The normalised radius at which the radial distortion turns back; infinite where it never does."""
        k1, k2, _, _, k3 = self.distortion
        inverse_squares = np.roots([1.0, 3 * k1, 5 * k2, 7 * k3])  # of the radius: weak ones do not overflow
        real = inverse_squares.real[abs(inverse_squares.imag) <= 1e-9 * abs(inverse_squares)]
        largest = float(real.max(initial=0.0))
        return float(1 / np.sqrt(largest)) if largest > 1e-12 else np.inf

    def at(self, rotation: Array, shift: Array) -> View:
        """The same view with this pose."""
        return replace(self, mirrored=None, R_camera_from_layout=rotation, t_camera_from_layout_mm=shift)

    def project(self, xyz_mm: Array) -> Array:
        """(N, 2) px of (N, 3) mm of the layout frame; NaN behind the camera or where the model turns back."""
        return self.linearised(xyz_mm)[0]

    def linearised(self, xyz_mm: Array) -> tuple[Array, Array, Array]:
        """Pictures of points and how they move.

        Returns:
            (N, 2) px; (N, 2, 3) px/mm by the point; (N, 2, 6) by the pose: a turn (rad) of the pattern about the
            layout's origin along the camera's axes, then a shift (mm) along them. NaN where there is no picture.
        """
        turned = xyz_mm @ self.R_camera_from_layout.T
        camera = turned + self.t_camera_from_layout_mm
        depth = np.where(camera[:, 2] > 0, camera[:, 2], np.nan)
        plain = camera[:, :2] / depth[:, None]
        plain[np.hypot(*plain.T) >= self.fold_radius] = np.nan
        bent, by_plain = distort_points(plain, self.distortion)
        by_camera = np.zeros((len(plain), 2, 3))
        by_camera[:, 0, 0] = by_camera[:, 1, 1] = 1 / depth
        by_camera[:, :, 2] = -plain / depth[:, None]
        by_camera = np.array(self.focal_px)[:, None] * (by_plain @ by_camera)
        by_pose = np.concatenate([by_camera @ -cross_matrix(turned), by_camera], axis=2)
        xy_px = bent * self.focal_px + self.centre_px
        return xy_px, by_camera @ self.R_camera_from_layout, by_pose

    def normalised(self, xy_px: Array) -> Array:
        """(N, 2) undistorted X / Z, Y / Z of pixels (N, 2); NaN where the distortion has no inverse."""
        bent = np.asarray((xy_px - self.centre_px) / self.focal_px)
        return undistort_points(bent, self.distortion, self.fold_radius)

    def rays(self, xy_px: Array) -> Array:
        """(N, 3) unit directions in the layout frame, from the camera through pixels (N, 2); NaN as above."""
        plain = self.normalised(xy_px)
        along = np.column_stack([plain, np.ones(len(plain))]) @ self.R_camera_from_layout
        return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def is_finite(values: Array, axes: int = 1) -> NDArray[np.bool_]:
    """Where all numbers along the last axes are finite."""
    return np.asarray(np.isfinite(values).all(axis=tuple(range(-axes, 0))))


def is_covariance(cov_px2: Array) -> NDArray[np.bool_]:
    """Which (..., 2, 2) are finite and positive definite; a pixel whose covariance is not is taken for unseen."""
    safe = np.where(is_finite(cov_px2, 2)[..., None, None], cov_px2, 0.0)
    determinant = safe[..., 0, 0] * safe[..., 1, 1] - safe[..., 0, 1] * safe[..., 1, 0]
    return np.asarray((safe[..., 0, 0] > 0) & (determinant > 0))


def cross_matrix(vectors: Array) -> Array:
    """(N, 3, 3): the matrices that multiply a vector like a cross product from the left."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = vectors.T
    out[:, 1, 2], out[:, 2, 0], out[:, 0, 1] = -vectors.T
    return out


def distort_points(plain: Array, distortion: tuple[float, ...]) -> tuple[Array, Array]:
    """(N, 2) distorted normalised coordinates and (N, 2, 2) their derivatives by the plain ones."""
    k1, k2, p1, p2, k3 = distortion
    x, y = plain.T
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))  # d radial / d r^2, twice
    bent = np.column_stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ]
    )
    by_plain = np.empty((len(plain), 2, 2))
    by_plain[:, 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    by_plain[:, 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    by_plain[:, 0, 1] = by_plain[:, 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
    return bent, by_plain


def undistort_points(bent: Array, distortion: tuple[float, ...], fold_radius: float = np.inf) -> Array:
    """(N, 2) plain normalised coordinates, by damped Newton steps to 1e-13; NaN where there are none.

    A fixed-point iteration, as is common, diverges at strong distortion and does not say so. Here a result is inside
    the radius at which the model turns back and is carried onto the input again, or it is NaN.
    """
    if not any(distortion):
        return bent.copy()
    radius = np.hypot(*bent.T)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        plain = bent * np.minimum(1.0, 0.9 * fold_radius / radius)[:, None]
    plain[radius == 0] = 0.0
    error = np.full(len(bent), np.inf)
    for _ in range(MAX_ITERATIONS):
        there, by_plain = distort_points(plain, distortion)
        away = bent - there
        error = np.hypot(*away.T)
        todo = np.flatnonzero(error > CONVERGED * (1 + radius))
        if not len(todo):
            break
        moved = _damped_newton_step(
            plain[todo], bent[todo], away[todo], by_plain[todo], distortion, fold_radius
        )
        if np.array_equal(moved, plain[todo], equal_nan=True):
            break
        plain[todo] = moved
    _, by_plain = distort_points(plain, distortion)
    good = np.asarray((error < 1e-9 * (1 + radius)) & (np.hypot(*plain.T) < fold_radius))
    good &= np.linalg.det(np.where(np.isfinite(by_plain), by_plain, 0.0)) > 0
    plain[~good] = np.nan
    return np.asarray(plain)


def _damped_newton_step(
    plain: Array,
    bent: Array,
    away: Array,
    by_plain: Array,
    distortion: tuple[float, ...],
    fold_radius: float,
) -> Array:
    """A Newton step, halved until it stays inside the model and the error gets smaller; else none."""
    (a, b), (c, d) = by_plain.transpose(1, 2, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        step = np.column_stack([d * away[:, 0] - b * away[:, 1], a * away[:, 1] - c * away[:, 0]])
        step /= (a * d - b * c)[:, None]
    out, error = plain.copy(), np.hypot(*away.T)
    waiting = np.isfinite(step).all(axis=1)
    for _ in range(MAX_HALVINGS):
        tried = plain + step
        better = np.hypot(*(bent - distort_points(tried, distortion)[0]).T) < error
        better &= waiting & (np.hypot(*tried.T) < fold_radius)
        out[better] = tried[better]
        waiting &= ~better
        if not waiting.any():
            break
        step *= 0.5
    return out
