"""Solids built face by face with shared edges, without boolean operations, in a time linear in the faces.

A ``Slab`` is a plate with any number of bosses, pockets and through holes. Every outline is a ``Loop``. Walls join two
paired outlines (a boss's root and tip): planes along straight sides, cylinders or cones along arcs. Neighbouring faces
share their edges, so the shell is closed by construction; nothing is intersected, sewn or healed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cmpdesign.products.mold.solids.loops import Loop, bounding_boxes, frusta_volume_mm3, frustum_volume_mm3
from cmpdesign.products.mold.solids.planar_faces import (
    PlanarFaces,
    backward_wire,
    forward_wire,
    untiled_faces,
)
from cmpdesign.products.mold.solids.shells import PlacedFaces, ShellBuilder
from cmpdesign.products.mold.solids.tiled_faces import tile_faces

# Distance from the bounding box of features to the border of their tiles.
TILE_MARGIN_MM = 0.05


@dataclass(frozen=True, eq=False)
class Feature:
    """A boss (height > 0) or pocket (height < 0) on a slab's top.

    Attributes:
        root: outline at the slab's top.
        tip: outline at the other end.
        height_mm: height of the tip over the slab's top.
        island: inner outlines at the slab's top and at the other end, for a ring-shaped feature such as a moat.
    """

    root: Loop
    tip: Loop
    height_mm: float
    island: tuple[Loop, Loop] | None = None


@dataclass(frozen=True, eq=False)
class Slab:
    """A plate from ``bottom_mm`` to ``top_mm``.

    Attributes:
        outer: outline of the plate; at the bottom if the outer walls lean.
        bottom_mm, top_mm: heights of the faces.
        through: through holes, as (outline at the bottom, outline at the top).
        features: few, large bosses and pockets on the top.
        many: many small convex bosses on the top.
        many_through: many small convex through holes, as ``through``.
        outer_top: outline at the top if the outer walls lean.
    """

    outer: Loop
    bottom_mm: float
    top_mm: float
    through: Sequence[tuple[Loop, Loop]] = ()
    features: Sequence[Feature] = ()
    many: Sequence[Feature] = ()
    many_through: Sequence[tuple[Loop, Loop]] = ()
    outer_top: Loop | None = None

    @property
    def outlines(self) -> tuple[Loop, Loop]:
        """The outlines at the bottom and at the top."""
        return self.outer, self.outer_top or self.outer


def make_slab_solid(slab: Slab) -> Any:
    """The slab as a solid (TopoDS_Solid) with the volume ``slab_volume_mm3``."""
    builder = ShellBuilder()
    bottom = builder.add_faces(_bottom_faces(slab), slab.bottom_mm, up=False)
    top = builder.add_faces(_top_faces(slab), slab.top_mm, up=True)
    builder.add_walls(bottom, 0, top, 0, outward=True)
    for number in range(len(slab.through)):
        builder.add_walls(bottom, 1 + number, top, 1 + number, outward=False)
    rim = 1 + len(slab.through)
    for feature in slab.features:
        _add_feature(builder, top, rim, feature)
        rim += 1 if feature.island is None else 2
    below = 1 + len(slab.through)
    for number in range(len(slab.many_through)):
        builder.add_walls(bottom, below + number, top, rim + number, outward=False)
    rim += len(slab.many_through)
    for number, feature in enumerate(slab.many):
        _add_feature(builder, top, rim + number, feature)
    return builder.solid()


def _bottom_faces(slab: Slab) -> PlanarFaces:
    holes = [below for below, _ in slab.through]
    return tile_faces(slab.outer, holes, [below for below, _ in slab.many_through], TILE_MARGIN_MM)


def _top_faces(slab: Slab) -> PlanarFaces:
    """The faces of the top; the area inside an island's outline is a face of its own."""
    holes = [above for _, above in slab.through]
    islands: list[int] = []
    for feature in slab.features:
        holes.append(feature.root)
        if feature.island is not None:
            holes.append(feature.island[0])
            islands.append(len(holes))
    many = [above for _, above in slab.many_through] + [feature.root for feature in slab.many]
    if not islands:
        return tile_faces(slab.outlines[1], holes, many, TILE_MARGIN_MM)
    return _faces_with_islands(slab, holes, islands)


def _faces_with_islands(slab: Slab, holes: list[Loop], islands: list[int]) -> PlanarFaces:
    """The faces of the top: rims inside an island are cut out of the island, other rims out of the slab."""
    outer = slab.outlines[1]
    plane = untiled_faces(outer, holes)
    boxes = bounding_boxes([outer, *holes])

    def inside(inner: int, outer: int) -> bool:
        low, high = boxes[outer]
        return inner != outer and bool((boxes[inner][0] > low).all() and (boxes[inner][1] < high).all())

    members = {island: [i for i in range(1, len(boxes)) if inside(i, island)] for island in islands}
    on_islands = {i for island in islands for i in (island, *members[island])}
    others = [i for i in range(1, len(boxes)) if i not in on_islands]
    plane.faces = [[forward_wire(plane.rim_edges(0)), *(backward_wire(plane.rim_edges(i)) for i in others)]]
    for island in islands:
        cut_out = [backward_wire(plane.rim_edges(i)) for i in members[island]]
        plane.faces.append([forward_wire(plane.rim_edges(island)), *cut_out])
    return plane


def _add_feature(builder: ShellBuilder, top: PlacedFaces, rim: int, feature: Feature) -> None:
    holes = [] if feature.island is None else [feature.island[1]]
    end = builder.add_faces(untiled_faces(feature.tip, holes), top.z + feature.height_mm, up=True)
    raised = feature.height_mm > 0
    for number in range(1 + len(holes)):
        outward = raised != (number == 1)
        if raised:
            builder.add_walls(top, rim + number, end, number, outward)
        else:
            builder.add_walls(end, number, top, rim + number, outward)


def slab_volume_mm3(slab: Slab) -> float:
    """The slab's volume in closed form, from areas of outlines."""
    height = slab.top_mm - slab.bottom_mm
    volume = frustum_volume_mm3(*slab.outlines, height)
    volume -= frusta_volume_mm3([*slab.through, *slab.many_through], height)
    for feature in slab.features:
        volume += frustum_volume_mm3(feature.root, feature.tip, feature.height_mm)
        if feature.island is not None:
            volume -= frustum_volume_mm3(*feature.island, feature.height_mm)
    for boss_height in {feature.height_mm for feature in slab.many}:
        pairs = [(feature.root, feature.tip) for feature in slab.many if feature.height_mm == boss_height]
        volume += frusta_volume_mm3(pairs, boss_height)
    return volume
