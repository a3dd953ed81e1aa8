"""One view of a sensor: a camera with a lens, direct or through mirrors.

Camera frame: x right, y down, z forward; x_camera = R x_layout + t. An odd number of mirrors between the pattern and
the camera makes det R = -1: such a view is the mirrored picture of a virtual camera.
A direction (X / Z, Y / Z) passes the lens, see ``lens``; points beyond its fold radius have no picture.
Where a window and a gel lie before the pattern, X, Y, Z are the direction in which the camera sees it, see ``medium``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor._native import space as native
from extractor.errors import RigError
from extractor.space.lens import COUNTS, Lens, LensKind, LensTable
from extractor.space.medium import NO_WINDOW, Lines, Medium, PlacedWindow, WindowPlane, place_window

Array = NDArray[np.float64]

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)
MAX_ORTHONORMALITY_ERROR = 1e-6  # of R R^T from the identity


class Linearisation(NamedTuple):
    """Projected points and their derivatives; NaN where a point has no picture.

    Attributes:
        xy_px: (N, 2) float64, in the frame of the full image.
        directions: (N, 2) float64, X / Z and Y / Z in which the camera sees the points.
        by_point: (N, 2, 3) float64, px/mm, by the point in the layout frame.
        by_pose: (N, 2, 6) float64, by the pose: a turn (rad) of the pattern about the layout's origin along the
            camera's axes, then a shift (mm) along these axes.
    """

    xy_px: Array
    directions: Array
    by_point: Array
    by_pose: Array


class PlacedViewTable(NamedTuple):
    """A placed view for native loops."""

    focal_px: Array
    centre_px: Array
    lens: LensTable
    rotation: Array
    shift_mm: Array
    window: PlacedWindow


@dataclass(frozen=True, eq=False)
class View:
    """A camera's picture of the pattern, which fills the image or an area of it.

    Attributes:
        name: for messages and files.
        focal_px: (fx, fy).
        centre_px: (cx, cy), the principal point, in the frame of the full image.
        distortion: the lens' coefficients, see ``lens``.
        area_px: (x, y, width, height) of the part of the image that this view fills; None: the whole image.
        mirrored: an odd number of mirrors between the pattern and the camera; None: by det R, False without R.
        R_camera_from_layout: (3, 3) float64, orthonormal, det -1 where mirrored; None: not known.
        t_camera_from_layout_mm: (3,) float64; None: not known.
        medium: layers between the pattern and the camera; None or layers of 0 mm: air.
        window: the window's outer face in the camera's frame; the gel then reaches from the window to the pattern.
            None: the window is parallel to the pattern at rest, ``gel_mm`` before it.
        lens: the model of the lens.

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
    lens: LensKind = "perspective"

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
        if self.lens not in COUNTS:
            raise RigError(f"view {self.name!r}: lens is {self.lens!r}; expected one of {', '.join(COUNTS)}")
        for name, counts in (("focal_px", (2,)), ("centre_px", (2,)), ("distortion", COUNTS[self.lens])):
            values = np.asarray(getattr(self, name), np.float64)
            if values.ndim != 1 or len(values) not in counts or not np.isfinite(values).all():
                raise RigError(
                    f"view {self.name!r}: {name} is {getattr(self, name)}; "
                    f"expected {counts_text(counts)} finite numbers"
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
    def native(self) -> PlacedViewTable:
        """What native loops read of this placed view."""
        rotation = np.ascontiguousarray(self.R_camera_from_layout)
        shift_mm = self.t_camera_from_layout_mm
        return PlacedViewTable(
            focal_px=np.array(self.focal_px),
            centre_px=np.array(self.centre_px),
            lens=self._lens.native,
            rotation=rotation,
            shift_mm=shift_mm,
            window=(
                NO_WINDOW
                if self.medium is None
                else place_window(self.medium, self.window, rotation, shift_mm)
            ),
        )

    @cached_property
    def _lens(self) -> Lens:
        return Lens(self.lens, self.distortion)

    @property
    def fold_radius(self) -> float:
        """The normalised radius up to which the lens is valid; infinite without a limit."""
        return self._lens.fold_radius

    def at(self, rotation: Array, shift: Array) -> View:
        """The same view with this pose."""
        return replace(self, mirrored=None, R_camera_from_layout=rotation, t_camera_from_layout_mm=shift)

    def turned(self, step: Any) -> View:
        """The placed view after a turn (rad) and a shift (mm) of the pattern, ``step`` (6,), see ``Linearisation``."""
        turn, _ = cv2.Rodrigues(np.array(step[:3], np.float64))
        left, _, right = np.linalg.svd(np.asarray(turn) @ self.R_camera_from_layout)
        return self.at(left @ right, self.t_camera_from_layout_mm + np.array(step[3:], np.float64))

    def project(self, xyz_mm: Array) -> Array:
        """(N, 2) px of points (N, 3) mm in the layout frame; NaN behind the camera and beyond the fold radius."""
        return self.linearised(xyz_mm).xy_px

    def by_lens(self, directions: Array) -> Array:
        """(N, 2, 4 + K) derivatives of the pictures of directions (N, 2) by fx, fy, cx, cy and the coefficients."""
        columns = np.zeros((len(directions), 2, 4 + len(self.distortion)))
        columns[:, [0, 1], [0, 1]] = self._lens.distort(directions).xy
        columns[:, [0, 1], [2, 3]] = 1
        columns[:, :, 4:] = np.array(self.focal_px)[:, None] * self._lens.by_coefficients(directions)
        return columns

    def linearised(self, xyz_mm: Array) -> Linearisation:
        """The projections of points (N, 3) mm in the layout frame, and their derivatives by point and pose."""
        return native.linearise(self.native, np.ascontiguousarray(xyz_mm, np.float64))

    def normalised(self, xy_px: Array) -> Array:
        """(N, 2) undistorted X / Z, Y / Z of pixels (N, 2); NaN where the distortion has no inverse."""
        return self._lens.undistort(np.asarray((xy_px - self.centre_px) / self.focal_px))

    def rays(self, xy_px: Array) -> Lines:
        """The lines of sight of pixels (N, 2) in the layout frame, at the pattern.

        In air all lines start at the camera, behind a window at its inner face; NaN as in ``normalised``.
        """
        return native.rays(self.native, np.ascontiguousarray(xy_px, np.float64))

    def is_ahead(self, xyz_mm: Array) -> NDArray[np.bool_]:
        """(N,) bool, which points (N, 3) mm of the layout frame lie before the camera, behind its window if any."""
        return native.are_ahead(self.native, np.ascontiguousarray(xyz_mm, np.float64))


def counts_text(counts: tuple[int, ...]) -> str:
    """ "5, 8 or 12", for messages."""
    return " or ".join(", ".join(map(str, counts)).rsplit(", ", 1))


def is_finite(values: Array, axes: int = 1) -> NDArray[np.bool_]:
    """Whether all numbers along this number of last axes are finite."""
    return np.asarray(np.isfinite(values).all(axis=tuple(range(-axes, 0))))


def is_covariance(cov_px2: Array) -> NDArray[np.bool_]:
    """(...,) bool, which matrices (..., 2, 2) are finite and positive definite; pixels with others count as unseen."""
    safe = np.where(is_finite(cov_px2, 2)[..., None, None], cov_px2, 0.0)
    determinant = safe[..., 0, 0] * safe[..., 1, 1] - safe[..., 0, 1] * safe[..., 1, 0]
    return np.asarray((safe[..., 0, 0] > 0) & (determinant > 0))
