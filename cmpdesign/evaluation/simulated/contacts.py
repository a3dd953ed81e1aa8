"""The contacts of the experiments, solved once and then shifted: the elastic layer is uniform."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluation.simulated.sensor import parse_sensor

if TYPE_CHECKING:
    from cmpdesign.contact import Contact, Indenter, Motion

Points = NDArray[np.float64]
REST = "rest"  # no object


@dataclass(frozen=True)
class ContactLoad:
    """An object and its motion.

    Attributes:
        object: a name of ``make_indenter``, or ``REST``.
        press_mm, shear_mm, twist_deg: as ``contact.Motion``; a positive twist is counter-clockwise from the front.
    """

    object: str
    press_mm: float
    shear_mm: tuple[float, float] = (0.0, 0.0)
    twist_deg: float = 0.0


def make_indenter(name: str) -> Indenter:
    """An object of the experiments, of the article's size where stated (cube 15 mm, ball 20 mm), else assumed."""
    from cmpdesign.contact import Ball, Cube, Cylinder, Rib, Ring, Wedge

    made: dict[str, Callable[[], Indenter]] = {
        "ball": lambda: Ball(10.0),
        "ring": lambda: Ring(6.0, 2.0),
        "cylinder": lambda: Cylinder(5.0, 14.0, axis_deg=30.0),
        "rib": lambda: Rib(2.0, 14.0, 0.2, turn_deg=20.0),
        "wedge": lambda: Wedge(90.0, 14.0, 0.2, turn_deg=-35.0),
        "large_ball": lambda: Ball(20.0),
        "cube": lambda: Cube(15.0, 0.2),
    }
    return made[name]()


def load_motion(load: ContactLoad) -> Motion:
    """The motion of a load."""
    from cmpdesign.contact import Motion

    return Motion(load.press_mm, load.shear_mm, load.twist_deg)


@lru_cache(maxsize=16)
def solve_contact(sensor_text: str, load: ContactLoad) -> Contact:
    """The contact at the middle of the sensor's elastic layer."""
    from cmpdesign.contact import solve

    sensor = parse_sensor(sensor_text)
    table = sensor.table.contact
    return solve(
        sensor.elastomer,
        make_indenter(load.object),
        load_motion(load),
        friction=table.friction,
        size_mm=table.size_mm,
        grid=table.grid,
        steps=table.steps,
    )


@dataclass(frozen=True, eq=False)
class PlacedSurface:
    """A surface with a contact at ``centre_mm``, turned counter-clockwise: maps (N, 2) mm to (N, 3) mm."""

    surface_at_origin: Callable[[Points], Points]
    centre_mm: tuple[float, float]
    turn_deg: float = 0.0

    def __call__(self, xy_mm: Points, /) -> Points:
        offset = np.asarray(self.centre_mm)
        cos, sin = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        turned_back = np.array([[cos, -sin], [sin, cos]])
        found = self.surface_at_origin((np.asarray(xy_mm) - offset) @ turned_back)
        found[:, :2] = found[:, :2] @ turned_back.T + offset
        return found

    def displacement_mm(self, xy_mm: Points) -> Points:
        """(N, 3) mm: displacements of points (N, 2) mm of the flat surface."""
        moved = self(xy_mm)
        moved[:, :2] -= xy_mm
        return moved


def _flat_surface(xy_mm: Points) -> Points:
    return np.column_stack([xy_mm, np.zeros(len(xy_mm))])


@lru_cache(maxsize=16)
def _contact_relief(sensor_text: str, load: ContactLoad) -> Callable[[Points], Points]:
    return solve_contact(sensor_text, load).marker_layer() if load.object != REST else _flat_surface


def place_surface(
    sensor_text: str, load: ContactLoad, centre_mm: tuple[float, float], turn_deg: float = 0.0
) -> PlacedSurface:
    """The pattern under a load at a position, turned counter-clockwise: the layer is the same in all directions."""
    return PlacedSurface(_contact_relief(sensor_text, load), centre_mm, turn_deg)
