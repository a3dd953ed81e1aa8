"""The surface's state: smooth maps of the layout's plane to itself or into space, mm to mm, applied in sequence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError

Points = NDArray[np.float64]


class Deformation(Protocol):
    """A smooth map of (N, 2) float64 points of the layout's plane to (N, 2) or (N, 3), mm to mm."""

    def __call__(self, xy_mm: Points, /) -> Points: ...


def _offsets_and_gaussian(
    xy_mm: Points, centre_mm: tuple[float, float], radius_mm: float
) -> tuple[Points, Points]:
    """Offsets (N, 2) from the centre in units of the radius, and the Gaussian exp(-r^2 / 2) as (N, 1)."""
    offset = (xy_mm - np.asarray(centre_mm, dtype=np.float64)) / radius_mm
    return offset, np.exp(-0.5 * np.sum(offset * offset, axis=1, keepdims=True))


def _require_radius(radius_mm: float) -> None:
    if not radius_mm > 0:
        raise SceneError(f"radius_mm is {radius_mm:g}; it must be above 0 mm")


@dataclass(frozen=True)
class Press:
    """Moves points away from a centre (depth_mm > 0, a bulge) or towards it (a pinch).

    The displacement is depth_mm * r exp((1 - r^2) / 2), r = distance / radius_mm: it peaks at the radius with
    exactly ``depth_mm``. It folds where depth_mm / radius_mm leaves (-0.61, 1.36).
    """

    __pydantic_config__: ClassVar = STRICT

    radius_mm: float
    depth_mm: float
    centre_mm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _require_radius(self.radius_mm)

    def __call__(self, xy_mm: Points, /) -> Points:
        offset, gaussian = _offsets_and_gaussian(xy_mm, self.centre_mm, self.radius_mm)
        return np.asarray(xy_mm + self.depth_mm * np.exp(0.5) * gaussian * offset)


@dataclass(frozen=True)
class Twist:
    """Rotates points about a centre, counter-clockwise by ``angle_deg`` at the centre, decaying as exp(-r^2 / 2)."""

    __pydantic_config__: ClassVar = STRICT

    radius_mm: float
    angle_deg: float
    centre_mm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _require_radius(self.radius_mm)

    def __call__(self, xy_mm: Points, /) -> Points:
        offset, gaussian = _offsets_and_gaussian(xy_mm, self.centre_mm, self.radius_mm)
        angle = np.radians(self.angle_deg) * gaussian[:, 0]
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = offset.T
        turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return np.asarray(self.centre_mm) + self.radius_mm * turned


@dataclass(frozen=True)
class Shear:
    """Shifts points by ``shift_mm`` at a centre, decaying as exp(-r^2 / 2), like a tangential contact."""

    __pydantic_config__: ClassVar = STRICT

    radius_mm: float
    shift_mm: tuple[float, float]
    centre_mm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _require_radius(self.radius_mm)

    def __call__(self, xy_mm: Points, /) -> Points:
        _, gaussian = _offsets_and_gaussian(xy_mm, self.centre_mm, self.radius_mm)
        return np.asarray(xy_mm + gaussian * np.asarray(self.shift_mm))


@dataclass(frozen=True)
class Dent:
    """Moves points towards -z (depth_mm > 0), like an object pressed into the front.

    The depth is depth_mm * exp(-r^2 / 2), r = distance / radius_mm. This is the simplest surface in space and no model
    of a contact; see ``cmpdesign.contact`` for contacts.
    """

    __pydantic_config__: ClassVar = STRICT

    radius_mm: float
    depth_mm: float
    centre_mm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _require_radius(self.radius_mm)

    def __call__(self, xy_mm: Points, /) -> Points:
        _, gaussian = _offsets_and_gaussian(xy_mm, self.centre_mm, self.radius_mm)
        return np.concatenate([xy_mm, -self.depth_mm * gaussian], axis=1)


@dataclass(frozen=True)
class Surface:
    """Deformations applied in order; a deformation is any smooth callable of (N, 2) mm points.

    Each deformation maps the x and y of the deformation before. Heights are added.
    """

    deformations: tuple[Deformation | Callable[[Points], Points], ...]

    def __call__(self, xy_mm: Points, /) -> Points:
        """Positions (N, 2) in mm after all deformations; (N, 3) where one of them leaves the plane."""
        height: Points | None = None
        for deform in self.deformations:
            deformed = deform(xy_mm)
            xy_mm = deformed[:, :2]
            if deformed.shape[1] == 3:
                height = deformed[:, 2] if height is None else height + deformed[:, 2]
        return xy_mm if height is None else np.column_stack([xy_mm, height])


def composed(*deformations: Deformation | Callable[[Points], Points]) -> Surface:
    """The surface after these deformations, applied in the given order."""
    return Surface(tuple(deformations))


def require_no_fold(surface: Callable[[Points], Points], xy_mm: Points, step_mm: float) -> None:
    """Check the map's Jacobian determinant (central differences over ``step_mm``) at the points (N, 2).

    Raises:
        SceneError: the map folds or is not finite; the message names the position and the determinant.
    """
    jacobian = jacobian_determinant(surface, xy_mm, step_mm)
    folded = ~(jacobian > 0)  # also catches NaN
    if folded.any():
        worst = int(np.argmin(np.where(np.isnan(jacobian), -np.inf, jacobian)))
        x, y = xy_mm[worst]
        raise SceneError(
            f"the surface folds at ({x:.3g}, {y:.3g}) mm: its Jacobian is {jacobian[worst]:.3g}, "
            "it must stay above 0; take a smaller displacement or a larger radius_mm"
        )


def jacobian_determinant(mapped: Callable[[Points], Points], xy_mm: Points, step_mm: float) -> Points:
    """(N,) the Jacobian determinant of a map of (N, 2) points to (N, 2), by central differences over ``step_mm``."""
    x_step, y_step = np.array([step_mm, 0.0]), np.array([0.0, step_mm])
    by_x = (mapped(xy_mm + x_step) - mapped(xy_mm - x_step)) / (2 * step_mm)
    by_y = (mapped(xy_mm + y_step) - mapped(xy_mm - y_step)) / (2 * step_mm)
    return np.asarray(by_x[:, 0] * by_y[:, 1] - by_x[:, 1] * by_y[:, 0])


def fold_check_points(markers_mm: Points, cells: Sequence[NDArray[np.int32]] | NDArray[np.int32]) -> Points:
    """(N, 2) mm: markers, cell centroids and midpoints of cell sides, dense enough to detect a fold."""
    corners = markers_mm[np.asarray(cells)]
    middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
    return np.concatenate([markers_mm, corners.mean(axis=1), middles.reshape(-1, 2)])
