"""Walls between the holes, openings and bosses of each part, from outlines in plan, before a solid is built."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from cmpdesign.layout.checks import Finding
from cmpdesign.products.mold.parts import PIN_CHAMFER_MM, jack_holes, lid_height_mm, vent_holes
from cmpdesign.products.mold.shapes.bosses import STENCIL_LEAN, stencil_hole_outlines
from cmpdesign.products.mold.shapes.cavities import open_insets
from cmpdesign.products.mold.solids.loops import Loop
from cmpdesign.products.mold.solids.slab_shells import TILE_MARGIN_MM
from cmpdesign.products.mold.stack.stack import MoldStack

# Least wall between two features of a part.
MIN_WALL_MM = 0.3
MIN_STENCIL_WEB_MM, MIN_MOAT_MM = 0.01, 0.1
# Least diameter of a pin between its chamfers.
MIN_PIN_TIP_MM = 0.4
PINS, JACKS, VENTS, PAD = "a pin hole", "a jack screw's hole", "a vent", "the pad's opening"
CELLS, EDGE = "the cells", "the outer edge"
# The change to make, by a feature of the pair; the first change that applies.
REMEDIES = {
    VENTS: "make mold.vents fewer or mold.vent_mm smaller",
    EDGE: "make mold.wall_mm larger",
    JACKS: "make mold.pin_diameter_mm smaller, or fiducials.gap_mm or the pattern larger",
    PINS: "make fiducials.gap_mm larger, or mold.pin_diameter_mm smaller",
}


class PlanFeature(NamedTuple):
    """A feature of a part in plan: its name, and its outline (shapely geometry)."""

    name: str
    shape: Any


def clearance_findings(stack: MoldStack) -> Iterator[Finding]:
    """Errors where two features of a part overlap or leave less than ``MIN_WALL_MM``; one for each kind of pair."""
    for part, features in _features_by_part(stack).items():
        least: dict[tuple[str, str], float] = {}
        for first, second in combinations(features, 2):
            pair = (first.name, second.name)
            distance = _distance_mm(first.shape, second.shape)
            least[pair] = min(distance, least.get(pair, distance))
        for (one, other), distance in least.items():
            if distance < MIN_WALL_MM:
                remedy = next(text for name, text in REMEDIES.items() if name in (one, other))
                named = f"{one} and another" if one == other else f"{one} and {other}"
                subject = f"wall between {named} in {part}"
                yield Finding(subject, distance, MIN_WALL_MM, "mm", remedy, "error")
    yield from _stencil_findings(stack)
    yield from _size_findings(stack)


def _size_findings(stack: MoldStack) -> Iterator[Finding]:
    tip = stack.pin_diameter_mm - 2 * PIN_CHAMFER_MM
    if tip < MIN_PIN_TIP_MM:
        remedy = "make mold.pin_diameter_mm (or fiducials.diameter_mm) larger"
        yield Finding("diameter of a pin between its chamfers", tip, MIN_PIN_TIP_MM, "mm", remedy, "error")
    option = stack.options
    moat = option.moat_mm - 2 * stack.lean * option.moat_depth_mm
    if moat < MIN_MOAT_MM:
        remedy = "make mold.moat_mm larger, or mold.moat_depth_mm or mold.draft_deg smaller"
        yield Finding("width of the moat at its floor", moat, MIN_MOAT_MM, "mm", remedy, "error")
    width = min(float(np.ptp(stack.edges(layer)[0].points, axis=0).min()) for layer in (0, 2))
    if stack.options.vents and width < 3 * stack.options.vent_mm:
        remedy = "make mold.vent_mm smaller, or mold.vents 0"
        yield Finding(
            "width of the pad under its vents", width, 3 * stack.options.vent_mm, "mm", remedy, "error"
        )


def _stencil_findings(stack: MoldStack) -> Iterator[Finding]:
    """Errors where the holes of a stencil, which widen upwards, come too near to each other."""
    import shapely

    least = float("inf")
    for color in stack.colors:
        upper = [outline.with_chords() for _, outline in stencil_hole_outlines(stack, color)]
        holes = [shapely.Polygon(loop.points) for loop in upper]
        if len(holes) > 1:
            _, distances = shapely.STRtree(holes).query_nearest(holes, exclusive=True, return_distance=True)
            least = min(least, float(distances.min()))
        if stack.crown is not None:
            # On a dome every hole lies in a separate facet.
            widest = float(open_insets(stack, color).min()) + stack.options.clearance_mm
            least = min(least, 2 * (widest - STENCIL_LEAN * stack.options.stencil_mm))
    if least < MIN_STENCIL_WEB_MM:
        remedy = "make mold.stencil_mm smaller or mold.clearance_mm larger"
        yield Finding(
            "wall between two holes of a stencil's upper face",
            least,
            MIN_STENCIL_WEB_MM,
            "mm",
            remedy,
            "error",
        )


def _distance_mm(first: Any, second: Any) -> float:
    """The distance of two shapes; for overlapping shapes, the negative depth of the overlap."""
    import shapely

    distance = float(shapely.distance(first, second))
    if distance > 0:
        return distance
    shared = shapely.intersection(first, second)
    left, bottom, right, top = shared.bounds
    return -float(min(right - left, top - bottom))


def _features_by_part(stack: MoldStack) -> dict[str, list[PlanFeature]]:
    """The features of every part that must not meet."""
    import shapely

    pins = [_feature(PINS, hole) for hole in stack.holes()]
    jacks = [_feature(JACKS, hole) for hole in jack_holes(stack)]
    vents = [_feature(VENTS, outer) for _, outer in vent_holes(stack)]
    edge = [PlanFeature(EDGE, shapely.LinearRing(stack.block.with_chords().points))]
    cells = [_cells_feature(stack)]
    return {
        "the frame": [*pins, _feature(PAD, stack.edges(1)[1])],
        "the cover": [*pins, _feature(PAD, stack.edges(2)[1])],
        "the boss plates": [*pins, *jacks, *cells, *edge],
        "the stencils": [*pins, *cells],
        f"the lid, {lid_height_mm(stack):.3g} mm thick": [*pins, *jacks, *vents, *edge],
    }


def _feature(name: str, loop: Loop) -> PlanFeature:
    import shapely

    return PlanFeature(name, shapely.Polygon(loop.with_chords().points))


def _cells_feature(stack: MoldStack) -> PlanFeature:
    """The box around all bosses or holes of a plate, with the margin of the faces between them."""
    import shapely

    cells = np.concatenate([stack.cells(color).reshape(-1, 2) for color in stack.colors])
    margin = stack.draft_mm + TILE_MARGIN_MM
    low, high = cells.min(axis=0) - margin, cells.max(axis=0) + margin
    return PlanFeature(CELLS, shapely.box(*low, *high))
