"""A dowel pin: a cylinder along z from 0 to the pin's length, with chamfers at both ends."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from cmpdesign.products.mold.solids.loops import circle_loop
from cmpdesign.products.mold.solids.planar_faces import untiled_faces
from cmpdesign.products.mold.solids.shells import ShellBuilder


def pin_solid(diameter_mm: float, length_mm: float, chamfer_mm: float) -> Any:
    """TopoDS_Solid of the pin."""
    builder = ShellBuilder()
    levels = (
        (0.0, diameter_mm - 2 * chamfer_mm),
        (chamfer_mm, diameter_mm),
        (length_mm - chamfer_mm, diameter_mm),
        (length_mm, diameter_mm - 2 * chamfer_mm),
    )
    rings = []
    for number, (z, diameter) in enumerate(levels):
        plane = untiled_faces(circle_loop(np.zeros(2), diameter), ())
        if 0 < number < len(levels) - 1:
            plane.faces.clear()
        rings.append(builder.add_faces(plane, z, up=number > 0))
    for lower, upper in pairwise(rings):
        builder.add_walls(lower, 0, upper, 0, outward=True)
    return builder.solid()


def pin_volume_mm3(diameter_mm: float, length_mm: float, chamfer_mm: float) -> float:
    """The volume in closed form: a cylinder and two truncated cones."""
    wide, narrow = diameter_mm / 2, diameter_mm / 2 - chamfer_mm
    cones = 2 * chamfer_mm * (wide**2 + wide * narrow + narrow**2) / 3
    return float(np.pi * (wide**2 * (length_mm - 2 * chamfer_mm) + cones))
