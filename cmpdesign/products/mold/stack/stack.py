"""The dimensions that all parts of a mold share: silicone layers, levels, outlines, pins. Numbers only, no solids.

          pin   vent                     z
    ______|_|____||_______________|_|______   lid
    ______|_|___           _______|_|______   z_cover_mm    cover (frame of the protective layer)
    ______|_|___\\_pad_____/_______|_|______   z_marker_mm   frame (of the black layer)
    |     | |  u\\         /u      | |     |   z_base_mm     rim of the base, with the moat u
    |     |_|    \\_______/        |_|     |   0             back of the pad
    |_____________________________________|   -floor        base

Boss plates and stencils lie where the cover lies, one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.design.fiducials import fiducial_positions
from cmpdesign.design.mold_options import MoldOptions
from cmpdesign.errors import DesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.side import seen_side, turned_over
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.materials.silicones import Silicone, load_silicone
from cmpdesign.products.mold.solids.loops import Loop, Points, circle_loop, polygon_loop, rounded_rectangle
from cmpdesign.products.mold.stack.crown import END_SLOPE, STEEPEST_DEG, Crown, project_on_crown

SILICONE_LAYERS = ("base", "marker", "cover")
# Distance of a crown's foot from the pattern and from the pad's edge.
FOOT_MM = 0.2


@dataclass(frozen=True, eq=False)
class MoldStack:
    """The dimensions of a mold; lengths are those of the mold, with shrinkage added, unless stated otherwise.

    A silicone layer is an index into ``SILICONE_LAYERS``.

    Attributes:
        options: the [mold] table.
        layout: the pattern in plan, seen from above; the camera sees the pattern from below.
        silicones: silicones of the base, the marker and the cover layer.
        outline_mm: (K, 2) the pad's edge at its back, convex, before shrinkage is added.
        crown: crown of a domed pad; None for a flat pad.
        pins_mm: (4, 2) places of the pins; the holes of a turned part do not fit the pins.
        pin_diameter_mm: diameter of the pins.
    """

    options: MoldOptions
    layout: Layout
    silicones: tuple[Silicone, Silicone, Silicone]
    outline_mm: Points
    crown: Crown | None
    pins_mm: Points
    pin_diameter_mm: float

    @property
    def lean(self) -> float:
        """Tangent of the draft of walls."""
        return float(np.tan(np.radians(self.options.draft_deg)))

    @property
    def draft_mm(self) -> float:
        """Distance by which a drafted wall leans over the height of the black layer."""
        return self.lean * self.thickness_mm[1]

    @cached_property
    def thickness_mm(self) -> tuple[float, float, float]:
        """Thickness of the base, the marker and the cover layer, as cast."""
        nominal = (self.options.base_mm, self.options.marker_mm, self.options.cover_mm)
        base, marker, cover = (t * s.scale for t, s in zip(nominal, self.silicones, strict=True))
        return base, marker, cover

    @property
    def z_base_mm(self) -> float:
        return self.thickness_mm[0]

    @property
    def z_marker_mm(self) -> float:
        return self.z_base_mm + self.thickness_mm[1]

    @property
    def z_cover_mm(self) -> float:
        return self.z_marker_mm + self.thickness_mm[2]

    def edges(self, silicone_layer: int) -> tuple[Loop, Loop]:
        """The pad's edge at the lower and the upper face of a silicone layer; drafted: the edge opens upwards."""
        nominal = polygon_loop(self.outline_mm * self.silicones[silicone_layer].scale)
        lower = self.lean * sum(self.thickness_mm[:silicone_layer])
        upper = lower + self.lean * self.thickness_mm[silicone_layer]
        return nominal.offset(lower), nominal.offset(upper)

    @cached_property
    def marker_xy_mm(self) -> Points:
        """(M, 2) markers in plan, as cast."""
        return self._to_plan(self.layout.marker_xy_mm)

    def _to_plan(self, xy_mm: Points) -> Points:
        """(N, 2) points of the layout in plan, as cast: shrinkage added, then projected on the crown."""
        scaled = xy_mm * self.silicones[1].scale
        if self.crown is None:
            return scaled
        return project_on_crown(scaled, self.crown.shape, self.crown.radius_mm, self.options.projection)

    @cached_property
    def colors(self) -> tuple[int, ...]:
        """The colors with cells to fill, each with its own plate and stencil."""
        return tuple(c for c in range(len(COLORS)) if c != BLACK and (self.layout.cell_color == c).any())

    def cells(self, color: int) -> Points:
        """(N, 3 or 4, 2) corners of a color's cells in plan, counter-clockwise, as cast."""
        corners: Points = self.marker_xy_mm[self.layout.cell_corners[self.layout.cell_color == color]]
        return corners

    @cached_property
    def block(self) -> Loop:
        """Outer edge of every part: a rectangle around pins, pad and moat."""
        option = self.options
        pin_margin = option.wall_mm + self.pin_diameter_mm / 2
        pad = self.edges(2)[1].points
        pad_margin = option.parting_mm + option.moat_mm + option.wall_mm
        low = np.minimum(self.pins_mm.min(axis=0) - pin_margin, pad.min(axis=0) - pad_margin)
        high = np.maximum(self.pins_mm.max(axis=0) + pin_margin, pad.max(axis=0) + pad_margin)
        return rounded_rectangle(low, high, option.fillet_mm)

    def holes(self, clearance: bool = True) -> list[Loop]:
        """The pin holes, with clearance, or without (in the base, which holds the pins)."""
        diameter = self.pin_diameter_mm + (self.options.clearance_mm if clearance else 0.0)
        return [circle_loop(place, diameter) for place in self.pins_mm]


def make_stack(design: Design, layout: Layout) -> MoldStack:
    """Compute the dimensions of a design's mold.

    Raises:
        DesignError: an unknown silicone, or a crown that is too small for the pattern.
    """
    option = design.mold
    base, marker, cover = (
        load_silicone(n) for n in (option.base_silicone, option.marker_silicone, option.cover_silicone)
    )
    four_fiducials = design.fiducials.model_copy(update={"count": 4})
    marks = replace(layout, fiducials_mm=fiducial_positions(four_fiducials, layout.outline_mm))
    pins, layout = plan_of(marks).fiducials_mm, plan_of(layout)
    diameter = option.pin_diameter_mm or design.fiducials.diameter_mm
    crown, outline = None, layout.outline_mm
    if option.crown != "none":
        crown, outline = _make_crown(option, layout, marker.scale)
    return MoldStack(option, layout, (base, marker, cover), outline, crown, pins, diameter)


def plan_of(layout: Layout) -> Layout:
    """The layout in a mold, seen from above: the camera, below, sees the designed side."""
    return layout if seen_side(layout.mirrored) == "back" else turned_over(layout)


def _make_crown(option: MoldOptions, layout: Layout, scale: float) -> tuple[Crown, Points]:
    """The smallest crown that contains the pattern, and the (K, 2) round or rectangular outline of the pad."""
    from cmpdesign.layout.outline import circle_outline as round_outline
    from cmpdesign.layout.outline import rectangle_outline

    if option.crown_radius_mm is None:
        raise DesignError(f'mold.crown = "{option.crown}" needs mold.crown_radius_mm')
    radius = option.crown_radius_mm * scale
    points = layout.marker_xy_mm[np.unique(layout.cell_corners)] * scale
    distance = np.hypot(*points.T) if option.crown == "sphere" else np.abs(points[:, 0])
    extent = float(distance.max())
    slope = extent / radius if option.projection == "equidistant" else np.arcsin(min(1.0, extent / radius))
    if np.degrees(slope) > STEEPEST_DEG:
        raise DesignError(
            f"mold.crown_radius_mm = {option.crown_radius_mm:g} mm: at the pattern's edge, "
            f"{extent / scale:.3g} mm "
            f"from the apex, the dome is {np.degrees(slope):.3g} deg steep, limit {STEEPEST_DEG:g} deg; "
            "make the radius larger or the pattern smaller"
        )
    reach = float(radius * np.sin(slope)) + FOOT_MM
    if reach >= radius * np.sin(np.radians(STEEPEST_DEG + 10)):
        raise DesignError(
            f"mold.crown_radius_mm = {option.crown_radius_mm:g} mm leaves no foot; make the radius larger"
        )
    edge = crown_edge_mm(option, layout)
    if option.crown == "sphere":
        crown = Crown("sphere", radius, reach, reach)
        # The sides of an inscribed polygon are nearer to the centre than its corners.
        return crown, round_outline(2 * (reach / scale + edge) / np.cos(np.pi / 360))
    height = Crown("cylinder", radius, reach, np.inf).height_mm
    length = float(np.abs(points[:, 1]).max()) + FOOT_MM + height / END_SLOPE
    crown = Crown("cylinder", radius, reach, length)
    return crown, rectangle_outline(2 * (reach / scale + edge), 2 * (length / scale + edge))


def crown_edge_mm(option: MoldOptions, layout: Layout) -> float:
    """Width of the flat edge around a crown: the border's width, or the width for vents if larger."""
    return max(layout.border_mm, option.vent_mm + 2 * FOOT_MM if option.vents else 0.0)
