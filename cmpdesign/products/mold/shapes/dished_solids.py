"""Solids with a dish: boss plates and stencils of molds for domed pads."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmpdesign.products.mold.shapes.dish import Dish
from cmpdesign.products.mold.solids.facets import FacetBuilder
from cmpdesign.products.mold.solids.loops import Loop, Points, polygon_loop
from cmpdesign.products.mold.solids.planar_faces import untiled_faces
from cmpdesign.products.mold.solids.shells import ShellBuilder
from cmpdesign.products.mold.solids.slab_shells import Slab, slab_volume_mm3

Wires = list[list[int]]
TURN_OVER = np.array([1.0, -1.0, -1.0])


def dished_plate_solid(slab: Slab, dish: Dish) -> Any:
    """A plate with its bosses up, hollowed by the dish turned about the x axis, with bosses in the hollow."""
    surface = _DishSurface(dish, 0.0)
    surface.add_bosses(dish.height_mm * -1.0)
    foot = dish.points[list(dish.foot)][::-1, :2] * TURN_OVER[:2]
    builder = ShellBuilder()
    holes = [below for below, _ in slab.through]
    bottom = builder.add_faces(untiled_faces(slab.outer, holes), slab.bottom_mm, up=False)
    top = builder.add_faces(untiled_faces(slab.outer, [*holes, polygon_loop(foot)]), slab.top_mm, up=True)
    for rim in range(1 + len(holes)):
        builder.add_walls(bottom, rim, top, rim, outward=rim == 0)
    facets = FacetBuilder(builder, np.array(surface.points) * TURN_OVER)
    facets.share_rim(top, 1 + len(holes), dish.foot[::-1])
    for wires in surface.faces:
        # The outside of the plate is the inside of the dish, so wires are reversed.
        facets.add_face([wire[::-1] for wire in wires])
    return builder.solid()


def dished_sheet_solid(slab: Slab, dish: Dish) -> Any:
    """A sheet that follows the dish on both sides, with through holes."""
    upper, lower = _DishSurface(dish, slab.top_mm), _DishSurface(dish, slab.bottom_mm)
    lower.cut_openings(0)
    upper.cut_openings(1)
    foot = polygon_loop(dish.points[list(dish.foot), :2])
    builder = ShellBuilder()
    holes = [below for below, _ in slab.through]
    bottom = builder.add_faces(untiled_faces(slab.outer, [*holes, foot]), slab.bottom_mm, up=False)
    top = builder.add_faces(untiled_faces(slab.outlines[1], [*holes, foot]), slab.top_mm, up=True)
    for rim in range(1 + len(holes)):
        builder.add_walls(bottom, rim, top, rim, outward=rim == 0)
    shift = len(lower.points)
    facets = FacetBuilder(builder, np.array([*lower.points, *upper.points]))
    facets.share_rim(bottom, 1 + len(holes), dish.foot)
    facets.share_rim(top, 1 + len(holes), [shift + point for point in dish.foot])
    for wires in lower.faces:
        facets.add_face([wire[::-1] for wire in wires])
    for wires in upper.faces:
        facets.add_face([[shift + point for point in wire] for wire in wires])
    for inner, outer in zip(lower.rims, upper.rims, strict=True):
        above = [shift + point for point in outer]
        for side in _wall_quads(inner, above):
            facets.add_face([side[::-1]])
    return builder.solid()


def dished_volume_mm3(slab: Slab, dish: Dish, kind: str) -> float:
    """Volume in closed form: of a "plate" less the dish plus bosses, or of a "sheet" less holes.

    A shear along z does not change the volume of a sheet.
    """
    volume = slab_volume_mm3(slab)
    if kind == "plate":
        return volume - dish.volume_mm3() + dish.outlines_volume_mm3()
    return volume - dish.outlines_volume_mm3()


class _DishSurface:
    """The faces of the dish moved up by z, their outside up, in the mold's frame.

    Attributes:
        points: corners (3,) of the faces, mm.
        faces: wires of each face; the first faces are the facets of the dish.
        rims: numbers of the points of each opening.
    """

    def __init__(self, dish: Dish, z: float) -> None:
        self.dish, self.z = dish, z
        self.points: list[Points] = [point + (0.0, 0.0, z) for point in dish.points]
        self.faces: list[Wires] = [[list(facet)] for facet in (*dish.facets, *dish.ends)]
        self.rims: list[list[int]] = []

    def add_outline(self, facet: int, loop: Loop, lift: float) -> list[int]:
        """Add the points of a loop on a facet's plane, lifted; their numbers."""
        z = self.dish.z_at(facet, loop.points) + self.z + lift
        first = len(self.points)
        self.points += list(np.column_stack([loop.points, z]))
        return list(range(first, len(self.points)))

    def cut_openings(self, end: int) -> None:
        """Cut the outlines out of their facets; end 0: outlines at the facet, 1: at the other end."""
        for facet, outlines in self.dish.outlines.items():
            rim = self.add_outline(facet, outlines[end], 0.0)
            self.faces[facet].append(rim[::-1])
            self.rims.append(rim)

    def add_bosses(self, lift: float) -> None:
        """Add bosses from the facets to ``lift`` (negative: below the surface, as they hang from a plate)."""
        for facet, (root, tip) in self.dish.outlines.items():
            at_root, at_tip = self.add_outline(facet, root, 0.0), self.add_outline(facet, tip, lift)
            self.faces[facet].append(at_root[::-1])
            self.faces.append([at_tip])
            self.faces += [[side[::-1]] for side in _wall_quads(at_tip, at_root)]


def _wall_quads(below: list[int], above: list[int]) -> list[list[int]]:
    """The quadrilaterals between two outlines, counter-clockwise as seen from outside the outlines."""
    after_below, after_above = [*below[1:], below[0]], [*above[1:], above[0]]
    return [list(corners) for corners in zip(below, after_below, after_above, above, strict=True)]
