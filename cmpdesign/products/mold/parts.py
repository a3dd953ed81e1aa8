"""The parts of a mold: base, frame, boss plates, stencils, cover, lid, pins.

A part is described first (a ``Slab`` and, for a domed pad, curved faces) and built on demand. Boss plates are described
with their bosses up, as they are printed or milled, and are turned over for use.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.mold.shapes.bosses import boss_features, stencil_hole_outlines
from cmpdesign.products.mold.shapes.dish import Dish, make_dish
from cmpdesign.products.mold.shapes.dished_solids import (
    dished_plate_solid,
    dished_sheet_solid,
    dished_volume_mm3,
)
from cmpdesign.products.mold.solids.loops import Loop, Points, circle_loop, polygon_loop, rounded_offset
from cmpdesign.products.mold.solids.pins import pin_solid, pin_volume_mm3
from cmpdesign.products.mold.solids.slab_shells import Feature, Slab, make_slab_solid, slab_volume_mm3
from cmpdesign.products.mold.stack.stack import MoldStack

# Tangent of a vent's wall angle: a vent widens towards the outside, so that its plug tears off at the pad.
VENT_LEAN = float(np.tan(np.radians(5.0)))
# Core diameter of the M3 holes for jack screws, which push a plate off.
JACK_MM = 2.5
PIN_CHAMFER_MM = 0.3
# Thickness of the base under its blind pin holes.
PIN_FLOOR_MM = 1.0
# An outline with more corners approximates a curve and is offset with mitres instead of arcs.
MANY_CORNERS = 24
STEEL_COLOR, TRAY_COLOR, FRAME_COLOR, COVER_COLOR, LID_COLOR = (
    "#b4b8bd",
    "#8796a5",
    "#3c3c40",
    "#c9b99a",
    "#9fc6d8",
)


@dataclass(frozen=True, eq=False)
class Part:
    """One part of the mold.

    Attributes:
        name: "base", "boss-red", ...
        use: purpose of the part, in a few words.
        color: "#rrggbb" in files and pictures.
        slab: shape without the crown; None for a pin.
        z_mm: height of the part's origin in use.
        stack: dimensions of the mold.
        turned: the part is used upside down (turned about the x axis).
        crown: "" or the effect of the crown: "raised" (base), "hollow" (lid), "plate" or "sheet" (dished).
        color_number: index into ``COLORS`` of a boss plate or stencil; else -1.
    """

    name: str
    use: str
    color: str
    slab: Slab | None
    z_mm: float
    stack: MoldStack
    turned: bool = False
    crown: str = ""
    color_number: int = -1

    @property
    def pull_box_mm(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Low and high corner of the box, in the part's own frame, whose walls are pulled from silicone."""
        # Silicone layers of different shrinkage differ in size.
        edges = np.concatenate([self.stack.edges(layer)[1].points for layer in range(3)])
        (left, bottom), (right, top) = edges.min(axis=0), edges.max(axis=0)
        if self.turned:
            bottom, top = -top, -bottom
        apex = self.stack.crown.height_mm if self.stack.crown else 0.0
        heights = {
            "base": (0.0, self.stack.z_base_mm),
            "boss": (-apex, self.stack.thickness_mm[1]),
            "stencil": (0.0, apex + self.stack.options.stencil_mm),
        }
        low, high = heights.get(self.name.partition("-")[0], (0.0, float("inf")))
        return (float(left), float(bottom), low), (float(right), float(top), high)

    @cached_property
    def dish(self) -> Dish:
        """The dish of a boss plate or stencil of a domed pad."""
        return make_dish(self.stack, self.color_number, through=self.crown == "sheet")

    @cached_property
    def volume_mm3(self) -> float:
        """Volume in closed form."""
        if self.slab is None:
            return pin_volume_mm3(self.stack.pin_diameter_mm, pin_length_mm(self.stack), PIN_CHAMFER_MM)
        volume = slab_volume_mm3(self.slab)
        crown = self.stack.crown
        if crown is None or not self.crown:
            return volume
        if self.crown in ("raised", "hollow"):
            return volume + (1 if self.crown == "raised" else -1) * crown.volume_mm3()
        return dished_volume_mm3(self.slab, self.dish, self.crown)

    @cached_property
    def solid(self) -> Any:
        """TopoDS_Solid in the part's own frame."""
        if self.slab is None:
            return pin_solid(self.stack.pin_diameter_mm, pin_length_mm(self.stack), PIN_CHAMFER_MM)
        if self.crown in ("plate", "sheet"):
            build = dished_plate_solid if self.crown == "plate" else dished_sheet_solid
            return build(self.slab, self.dish)
        solid = make_slab_solid(self.slab)
        if self.crown:
            from cmpdesign.products.mold.shapes.caps import solid_with_cap

            assert self.stack.crown is not None
            return solid_with_cap(solid, self.stack.crown, raised=self.crown == "raised")
        return solid


def make_parts(stack: MoldStack) -> list[Part]:
    """Describe every part once, in the order of use; solids are built on demand."""
    plates = [
        part
        for color in stack.colors
        for part in (_boss_plate_part(stack, color), _stencil_part(stack, color))
    ]
    return [
        _base_part(stack),
        _frame_part(stack),
        *plates,
        _cover_part(stack),
        _lid_part(stack),
        _pin_part(stack),
    ]


def pin_length_mm(stack: MoldStack) -> float:
    """Length of a pin: from the bottom of its hole to 1 mm below the lid's back."""
    height = 0.0 if stack.crown is None else stack.crown.height_mm
    return pin_depth_mm(stack) + stack.z_cover_mm - stack.z_base_mm + stack.options.plate_mm + height - 1.0


def pin_depth_mm(stack: MoldStack) -> float:
    """Depth of the blind pin holes in the base."""
    return stack.z_base_mm + stack.options.floor_mm - PIN_FLOOR_MM


def _base_part(stack: MoldStack) -> Part:
    option, lean = stack.options, stack.lean
    low, high = stack.edges(0)
    pad = Feature(high, low, -stack.z_base_mm)
    inner = _offset_outline(high, option.parting_mm)
    outer = _offset_outline(high, option.parting_mm + option.moat_mm)
    depth = option.moat_depth_mm
    moat = Feature(outer, outer.offset(-lean * depth), -depth, (inner, inner.offset(lean * depth)))
    sockets = [Feature(hole, hole, -pin_depth_mm(stack)) for hole in stack.holes(clearance=False)]
    slab = Slab(stack.block, -option.floor_mm, stack.z_base_mm, (), (pad, moat, *sockets))
    crown = "raised" if stack.crown else ""
    return Part("base", "tray of the clear base layer", TRAY_COLOR, slab, 0.0, stack, crown=crown)


def _offset_outline(edge: Loop, offset_mm: float) -> Loop:
    return (
        rounded_offset(edge.points, offset_mm) if len(edge.points) <= MANY_CORNERS else edge.offset(offset_mm)
    )


def _frame_part(stack: MoldStack) -> Part:
    slab = _ring_slab(stack, 1)
    return Part("frame", "pouring frame of the black layer", FRAME_COLOR, slab, stack.z_base_mm, stack)


def _cover_part(stack: MoldStack) -> Part:
    slab = _ring_slab(stack, 2)
    return Part("cover", "frame of the protective layer", COVER_COLOR, slab, stack.z_marker_mm, stack)


def _ring_slab(stack: MoldStack, silicone_layer: int) -> Slab:
    """A frame of the thickness of a silicone layer."""
    holes = [stack.edges(silicone_layer), *((hole, hole) for hole in stack.holes())]
    return Slab(stack.block, 0.0, stack.thickness_mm[silicone_layer], holes)


def _boss_plate_part(stack: MoldStack, color: int) -> Part:
    name = COLORS[color]
    bosses = () if stack.crown else [_mirror_feature(boss) for boss in boss_features(stack, color)]
    holes = [_mirror_loop(loop) for loop in (*stack.holes(), *jack_holes(stack))]
    depth = stack.options.plate_mm + (stack.crown.height_mm if stack.crown else 0.0)
    slab = Slab(_mirror_loop(stack.block), -depth, 0.0, [(h, h) for h in holes], many=bosses)
    return Part(
        name=f"boss-{name}",
        use=f"bosses that leave the {name} cavities in the black layer",
        color=stack.layout.palette[name],
        slab=slab,
        z_mm=stack.z_marker_mm,
        stack=stack,
        turned=True,
        crown="plate" if stack.crown else "",
        color_number=color,
    )


def _stencil_part(stack: MoldStack, color: int) -> Part:
    name = COLORS[color]
    through = () if stack.crown else stencil_hole_outlines(stack, color)
    holes = [(hole, hole) for hole in stack.holes()]
    slab = Slab(stack.block, 0.0, stack.options.stencil_mm, holes, many_through=through)
    return Part(
        name=f"stencil-{name}",
        use=f"mask for filling the {name} cavities",
        color=stack.layout.palette[name],
        slab=slab,
        z_mm=stack.z_marker_mm,
        stack=stack,
        crown="sheet" if stack.crown else "",
        color_number=color,
    )


def _lid_part(stack: MoldStack) -> Part:
    holes = [(hole, hole) for hole in (*stack.holes(), *jack_holes(stack))]
    slab = Slab(stack.block, 0.0, lid_height_mm(stack), [*holes, *vent_holes(stack)])
    crown = "hollow" if stack.crown else ""
    return Part("lid", "closes the base and the cover", LID_COLOR, slab, stack.z_cover_mm, stack, crown=crown)


def _pin_part(stack: MoldStack) -> Part:
    return Part("pin", "dowel, four of them", STEEL_COLOR, None, stack.z_base_mm - pin_depth_mm(stack), stack)


def lid_height_mm(stack: MoldStack) -> float:
    """Thickness of the lid outside the crown."""
    return stack.options.plate_mm + (stack.crown.height_mm if stack.crown else 0.0)


def vent_holes(stack: MoldStack) -> list[tuple[Loop, Loop]]:
    """The outlines of every vent at the lid's lower and upper face."""
    diameter = stack.options.vent_mm
    upper = diameter + 2 * VENT_LEAN * lid_height_mm(stack)
    return [(circle_loop(place, diameter), circle_loop(place, upper)) for place in vent_places(stack)]


def vent_places(stack: MoldStack) -> Points:
    """(V, 2) places of the vents: inside the pad's edge, at equal distances along the edge from its first corner."""
    count = stack.options.vents
    inset = stack.options.vent_mm / 2 + 0.1
    smaller = min(
        (stack.edges(silicone_layer)[0] for silicone_layer in (0, 2)), key=lambda loop: loop.area_mm2()
    )
    path = polygon_loop(smaller.points).offset(-inset).points
    sides = np.hypot(*(np.roll(path, -1, axis=0) - path).T)
    along = np.concatenate([[0.0], np.cumsum(sides)])
    closed = np.concatenate([path, path[:1]])
    vent_along = np.arange(count) * along[-1] / max(count, 1)
    return np.stack([np.interp(vent_along, along, closed[:, axis]) for axis in (0, 1)], axis=-1)


def jack_holes(stack: MoldStack) -> list[Loop]:
    """Two tapped holes over the base's solid rim, a quarter of the height from opposite corners."""
    left, bottom = stack.pins_mm[0]
    right, top = stack.pins_mm[1][0], stack.pins_mm[2][1]
    quarter = (top - bottom) / 4
    return [circle_loop(np.array(p), JACK_MM) for p in ((left, bottom + quarter), (right, top - quarter))]


def _mirror_feature(boss: Feature) -> Feature:
    """A boss on a plate with its bosses up."""
    return Feature(_mirror_loop(boss.root), _mirror_loop(boss.tip), boss.height_mm)


def _mirror_loop(loop: Loop) -> Loop:
    """A loop on a plate with its bosses up: y mirrored, still counter-clockwise."""
    mirror = np.array([1.0, -1.0])
    # Side i runs from point i to i + 1. In reverse order the centre of side i belongs to point i + 1.
    return Loop(np.roll(loop.points[::-1], 1, axis=0) * mirror, loop.centres[::-1] * mirror)
