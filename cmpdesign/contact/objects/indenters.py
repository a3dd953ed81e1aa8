"""Rigid objects that touch the elastic layer, by the height of their underside above its lowest point."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.errors import require

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Indenter(ABC):
    """A rigid object.

    Attributes:
        centre_mm: x and y of the centre in the layout frame.
        turn_deg: rotation about the centre, counter-clockwise from the front.
        positive: names of the fields that must be above 0.
    """

    centre_mm: tuple[float, float] = (0.0, 0.0)
    turn_deg: float = 0.0

    positive: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, int | float):
                require(math.isfinite(value), field.name, value, "finite")
        good = len(self.centre_mm) == 2 and all(math.isfinite(value) for value in self.centre_mm)
        require(good, "centre_mm", self.centre_mm, "two finite lengths, x and y")
        for name in self.positive:
            require(getattr(self, name) > 0, name, f"{getattr(self, name):g}", "above 0")

    def height_mm(self, x_mm: Array, y_mm: Array) -> Array:
        """Height of the underside above its lowest point at points of the layout frame; inf outside the object."""
        c, s = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        x, y = np.asarray(x_mm) - self.centre_mm[0], np.asarray(y_mm) - self.centre_mm[1]
        return self.profile_mm(c * x + s * y, c * y - s * x)

    @abstractmethod
    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        """Height of the underside above its lowest point at points of the object's frame; inf outside the object."""

    @property
    @abstractmethod
    def smallest_radius_mm(self) -> float:
        """The smallest radius of curvature of the underside, which the grid must resolve; 0 for sharp edges."""


def spherical_profile(distance_mm: Array, radius_mm: float) -> Array:
    """Height of a circle of this radius at a distance from its lowest point; inf beyond the radius."""
    inside = np.abs(distance_mm) <= radius_mm
    # r - sqrt(r^2 - d^2) without cancellation.
    distance_squared = np.where(inside, distance_mm, 0.0) ** 2
    height = (
        distance_squared / (radius_mm + np.sqrt(radius_mm**2 - distance_squared))
        if radius_mm > 0
        else distance_squared
    )
    return np.where(inside, height, np.inf)


def rounded_rectangle_profile(
    x_mm: Array, y_mm: Array, size_mm: tuple[float, float], edge_radius_mm: float
) -> Array:
    """Height of a flat rectangle (width, height) with rounded edges; inf outside."""
    beyond_x = np.maximum(np.abs(x_mm) - (size_mm[0] / 2 - edge_radius_mm), 0.0)
    beyond_y = np.maximum(np.abs(y_mm) - (size_mm[1] / 2 - edge_radius_mm), 0.0)
    return spherical_profile(np.hypot(beyond_x, beyond_y), edge_radius_mm)


def _require_edge_radius(edge_mm: float, largest_mm: float, name: str = "edge_radius_mm") -> None:
    require(0 <= edge_mm <= largest_mm, name, f"{edge_mm:g}", f"from 0 to {largest_mm:g} mm for this object")


@dataclass(frozen=True)
class Ball(Indenter):
    """A ball."""

    radius_mm: float
    positive: ClassVar[tuple[str, ...]] = ("radius_mm",)

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        return spherical_profile(np.hypot(x_mm, y_mm), self.radius_mm)

    @property
    def smallest_radius_mm(self) -> float:
        return self.radius_mm


@dataclass(frozen=True)
class Cylinder(Indenter):
    """A cylinder on its side, with its axis at ``axis_deg`` from x and flat, sharp ends."""

    radius_mm: float
    length_mm: float
    axis_deg: float = 0.0
    positive: ClassVar[tuple[str, ...]] = ("radius_mm", "length_mm")

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        c, s = np.cos(np.radians(self.axis_deg)), np.sin(np.radians(self.axis_deg))
        along, across = c * x_mm + s * y_mm, c * y_mm - s * x_mm
        return np.where(
            np.abs(along) <= self.length_mm / 2, spherical_profile(across, self.radius_mm), np.inf
        )

    @property
    def smallest_radius_mm(self) -> float:
        return self.radius_mm


@dataclass(frozen=True)
class Punch(Indenter):
    """An upright cylinder: a flat disc with its edge rounded by ``edge_radius_mm``."""

    radius_mm: float
    edge_radius_mm: float = 0.0
    positive: ClassVar[tuple[str, ...]] = ("radius_mm",)

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_edge_radius(self.edge_radius_mm, self.radius_mm)

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        beyond = np.maximum(np.hypot(x_mm, y_mm) - (self.radius_mm - self.edge_radius_mm), 0.0)
        return spherical_profile(beyond, self.edge_radius_mm)

    @property
    def smallest_radius_mm(self) -> float:
        return self.edge_radius_mm


@dataclass(frozen=True)
class Ring(Indenter):
    """A flat ring: a tube of radius ``tube_mm`` along a circle of radius ``radius_mm``."""

    radius_mm: float
    tube_mm: float
    positive: ClassVar[tuple[str, ...]] = ("radius_mm", "tube_mm")

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_edge_radius(self.tube_mm, self.radius_mm, "tube_mm")

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        return spherical_profile(np.hypot(x_mm, y_mm) - self.radius_mm, self.tube_mm)

    @property
    def smallest_radius_mm(self) -> float:
        return self.tube_mm


@dataclass(frozen=True)
class Rib(Indenter):
    """A straight rib along x with a flat top; its edges are rounded by ``edge_radius_mm``."""

    width_mm: float
    length_mm: float
    edge_radius_mm: float = 0.2
    positive: ClassVar[tuple[str, ...]] = ("width_mm", "length_mm")

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_edge_radius(self.edge_radius_mm, min(self.width_mm, self.length_mm) / 2)

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        return rounded_rectangle_profile(x_mm, y_mm, (self.length_mm, self.width_mm), self.edge_radius_mm)

    @property
    def smallest_radius_mm(self) -> float:
        return self.edge_radius_mm


@dataclass(frozen=True)
class Wedge(Indenter):
    """A wedge with its blade along x: ``angle_deg`` between its faces, its blade rounded by ``tip_radius_mm``."""

    angle_deg: float
    length_mm: float
    tip_radius_mm: float = 0.2
    positive: ClassVar[tuple[str, ...]] = ("length_mm",)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(0 < self.angle_deg < 180, "angle_deg", f"{self.angle_deg:g}", "above 0 and below 180")
        require(self.tip_radius_mm >= 0, "tip_radius_mm", f"{self.tip_radius_mm:g}", "0 or more")

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        half = np.radians(self.angle_deg / 2)
        slope, distance = 1 / np.tan(half), np.abs(y_mm)
        tangent = self.tip_radius_mm * np.cos(half)  # distance at which the round tip meets the faces
        face = self.tip_radius_mm * (1 - np.sin(half)) + slope * (distance - tangent)
        height = np.where(
            distance < tangent, spherical_profile(np.minimum(distance, tangent), self.tip_radius_mm), face
        )
        return np.where(np.abs(x_mm) <= self.length_mm / 2, height, np.inf)

    @property
    def smallest_radius_mm(self) -> float:
        return self.tip_radius_mm


@dataclass(frozen=True)
class Cube(Indenter):
    """A cube on its face; the face's edges are rounded by ``edge_radius_mm``."""

    side_mm: float
    edge_radius_mm: float = 0.2
    positive: ClassVar[tuple[str, ...]] = ("side_mm",)

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_edge_radius(self.edge_radius_mm, self.side_mm / 2)

    def profile_mm(self, x_mm: Array, y_mm: Array) -> Array:
        return rounded_rectangle_profile(x_mm, y_mm, (self.side_mm, self.side_mm), self.edge_radius_mm)

    @property
    def smallest_radius_mm(self) -> float:
        return self.edge_radius_mm
