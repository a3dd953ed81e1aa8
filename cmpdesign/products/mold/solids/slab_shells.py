"""Solids built face by face with shared edges, without booleans: time grows with the number of faces.

A ``Slab`` is a plate with any number of bosses, pockets and through holes. Every outline is a ``Loop``; two
outlines that belong together (a boss's root and tip) are joined by walls: planes along straight sides,
cylinders or cones along arcs. Edges are shared between neighbouring faces, so the shell is closed by
construction; nothing is intersected, sewn or healed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmpdesign.products.mold.solids.loops import Loop, bounding_boxes, frusta_volume_mm3, frustum_volume_mm3
from cmpdesign.products.mold.solids.tiled_faces import (
    PlanarFaces,
    Point,
    Wire,
    backward_wire,
    forward_wire,
    tile_faces,
    untiled_faces,
)

TOLERANCE_MM = 1e-7
TILE_MARGIN_MM = 0.05


@dataclass(frozen=True, eq=False)
class Feature:
    """A boss (height > 0) or pocket (height < 0) on a slab's top: its outline there and at its other end.

    ``island`` makes a ring of it: what lies inside that outline stays at the slab's top (a moat).
    """

    root: Loop
    tip: Loop
    height_mm: float
    island: tuple[Loop, Loop] | None = None


@dataclass(frozen=True, eq=False)
class Slab:
    """A plate from ``bottom_mm`` to ``top_mm``.

    Attributes:
        outer: its outline.
        through: holes, as (outline at the bottom, outline at the top).
        features: few, large bosses and pockets on the top.
        many: many small bosses on the top, convex.
        many_through: many small through holes, convex.
        bottom_mm, top_mm: heights of its faces.
        outer_top: its outline at the top, if its outer walls lean.
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
        """At the bottom and at the top."""
        return self.outer, self.outer_top or self.outer


class ShellBuilder:
    """Collects faces of one solid; heights are given where loops are placed."""

    def __init__(self) -> None:
        from OCP.BRep import BRep_Builder
        from OCP.TopoDS import TopoDS_Shell

        self.make = BRep_Builder()
        self.shell = TopoDS_Shell()
        self.make.MakeShell(self.shell)

    def solid(self) -> Any:
        """The closed solid (TopoDS_Solid)."""
        from OCP.TopoDS import TopoDS_Solid

        self.shell.Closed(True)
        solid = TopoDS_Solid()
        self.make.MakeSolid(solid)
        self.make.Add(solid, self.shell)
        return solid

    def place(self, sheet: PlanarFaces, z: float, up: bool) -> PlacedFaces:
        """Add a sheet's faces at a height; ``up`` tells whether the material lies below them."""
        return PlacedFaces(self.make, self.shell, sheet, z, up)

    def walls(self, lower: PlacedFaces, rim: int, upper: PlacedFaces, upper_rim: int, outward: bool) -> None:
        """Join two rims side by side; ``outward`` when the material lies inside the outlines."""
        sides = len(lower.sheet.rims[rim])
        posts = [self._make_post(lower, rim, upper, upper_rim, side) for side in range(sides)]
        for side in range(sides):
            below, above = lower.sheet.rims[rim][side], upper.sheet.rims[upper_rim][side]
            after = posts[(side + 1) % sides]
            self._add_wall(lower, below, upper, above, posts[side], after, outward)

    def _make_post(self, lower: PlacedFaces, rim: int, upper: PlacedFaces, upper_rim: int, side: int) -> Any:
        """The edge from a corner of the lower rim up to the upper one's."""
        start = lower.sheet.edges[lower.sheet.rims[rim][side][0]][0]
        end = upper.sheet.edges[upper.sheet.rims[upper_rim][side][0]][0]
        return make_straight_edge(
            self.make, lower.vertices[start], lower.xyz(start), upper.vertices[end], upper.xyz(end)
        )

    def _add_wall(
        self,
        lower: PlacedFaces,
        below: list[int],
        upper: PlacedFaces,
        above: list[int],
        post: Any,
        after: Any,
        outward: bool,
    ) -> None:
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

        run, back = TopAbs_Orientation.TopAbs_FORWARD, TopAbs_Orientation.TopAbs_REVERSED
        surface = _wall_surface(lower, below, upper, above)
        face, wire = TopoDS_Face(), TopoDS_Wire()
        self.make.MakeFace(face, surface.geometry, TOLERANCE_MM)
        self.make.MakeWire(wire)
        for edge in below:
            self.make.Add(wire, lower.shapes[edge].Oriented(run))
        self.make.Add(wire, after.Oriented(run))
        for edge in reversed(above):
            self.make.Add(wire, upper.shapes[edge].Oriented(back))
        self.make.Add(wire, post.Oriented(back))
        if surface.round is not None:
            self._add_parameter_curves(surface, lower, below, upper, above, (post, after))
        wire.Closed(True)
        self.make.Add(face, wire)
        self.make.Add(self.shell, face.Oriented(run if outward else back))

    def _add_parameter_curves(
        self,
        surface: _WallSurface,
        lower: PlacedFaces,
        below: list[int],
        upper: PlacedFaces,
        above: list[int],
        posts: tuple[Any, Any],
    ) -> None:
        """Curves in the (angle, length) plane of a cylinder or cone: every edge is straight there."""
        from OCP.Geom2d import Geom2d_Line
        from OCP.gp import gp_Dir2d, gp_Pnt2d
        from OCP.TopLoc import TopLoc_Location

        assert surface.round is not None
        first, last, length = surface.round
        here = TopLoc_Location()

        def add(edge: Any, u: float, v: float, across: bool) -> None:
            line = Geom2d_Line(gp_Pnt2d(u, v), gp_Dir2d(0.0, 1.0) if across else gp_Dir2d(1.0, 0.0))
            self.make.UpdateEdge(edge, line, surface.geometry, here, TOLERANCE_MM)

        # An arc's parameter is the angle itself, so its curve starts at u = 0.
        turn = 2 * np.pi * round((lower.angles[below[0]] - first) / (2 * np.pi))
        for sheet, edges, v in ((lower, below, 0.0), (upper, above, length)):
            for edge in edges:
                turn = 2 * np.pi * np.floor((sheet.angles[edge] - first + 1e-6) / (2 * np.pi))
                add(sheet.shapes[edge], -turn, v, across=False)
        add(posts[0], first, 0.0, across=True)
        add(posts[1], last, 0.0, across=True)


@dataclass(frozen=True, eq=False)
class _WallSurface:
    """A wall's surface; for a round one the first and last angle and the length from rim to rim."""

    geometry: Any
    round: tuple[float, float, float] | None


def _wall_surface(lower: PlacedFaces, below: list[int], upper: PlacedFaces, above: list[int]) -> _WallSurface:
    start, _, centre = lower.sheet.edges[below[0]]
    a = lower.sheet.points[start]
    b = lower.sheet.points[lower.sheet.edges[below[-1]][1]]
    top = upper.sheet.points[upper.sheet.edges[above[0]][0]]
    if centre is None:
        return _WallSurface(_wall_plane(a, b, top, lower.z, upper.z), None)
    radius = float(np.hypot(a[0] - centre[0], a[1] - centre[1]))
    top_radius = float(np.hypot(top[0] - centre[0], top[1] - centre[1]))
    height = upper.z - lower.z
    first = lower.angles[below[0]]
    sweep = sum(lower.sweeps[edge] for edge in below)
    length = float(np.hypot(top_radius - radius, height))
    geometry = _round_wall_surface(centre, lower.z, radius, top_radius - radius, height)
    return _WallSurface(geometry, (first, first + sweep, length))


def _wall_plane(a: Point, b: Point, top: Point, z: float, top_z: float) -> Any:
    """The plane through two points at z and one at top_z, its normal to the right of a -> b."""
    from OCP.Geom import Geom_Plane
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    along = (b[0] - a[0], b[1] - a[1])
    rise = (top[0] - a[0], top[1] - a[1], top_z - z)
    normal = (
        along[1] * rise[2],
        -along[0] * rise[2],
        along[0] * rise[1] - along[1] * rise[0],
    )
    axes = gp_Ax3(gp_Pnt(a[0], a[1], z), gp_Dir(*normal), gp_Dir(along[0], along[1], 0.0))
    return Geom_Plane(axes)


def _round_wall_surface(centre: Point, z: float, radius: float, growth: float, height: float) -> Any:
    from OCP.Geom import Geom_ConicalSurface, Geom_CylindricalSurface
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    axes = gp_Ax3(gp_Pnt(centre[0], centre[1], z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0))
    if abs(growth) < TOLERANCE_MM:
        return Geom_CylindricalSurface(axes, radius)
    return Geom_ConicalSurface(axes, float(np.arctan2(growth, height)), radius)


class PlacedFaces:
    """A sheet's vertices, edges and faces at a height."""

    def __init__(self, make: Any, shell: Any, sheet: PlanarFaces, z: float, up: bool) -> None:
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        self.sheet, self.z = sheet, z
        self.vertices = []
        for x, y in sheet.points:
            vertex = TopoDS_Vertex()
            make.MakeVertex(vertex, gp_Pnt(x, y, z), TOLERANCE_MM)
            self.vertices.append(vertex)
        # First angle and sweep of the arcs, by edge.
        self.angles: dict[int, float] = {}
        self.sweeps: dict[int, float] = {}
        self.shapes = [self._edge(make, number) for number in range(len(sheet.edges))]
        self._faces(make, shell, up)

    def xyz(self, point: int) -> tuple[float, float, float]:
        return (*self.sheet.points[point], self.z)

    def _edge(self, make: Any, number: int) -> Any:
        start, end, centre = self.sheet.edges[number]
        if centre is None:
            return make_straight_edge(
                make, self.vertices[start], self.xyz(start), self.vertices[end], self.xyz(end)
            )
        from OCP.Geom import Geom_Circle
        from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

        (x0, y0), (x1, y1) = self.sheet.points[start], self.sheet.points[end]
        angle = float(np.arctan2(y0 - centre[1], x0 - centre[0])) % (2 * np.pi)
        sweep = (float(np.arctan2(y1 - centre[1], x1 - centre[0])) - angle) % (2 * np.pi)
        self.angles[number], self.sweeps[number] = angle, sweep
        axes = gp_Ax2(gp_Pnt(*centre, self.z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0))
        curve = Geom_Circle(axes, float(np.hypot(x0 - centre[0], y0 - centre[1])))
        return _make_edge(make, curve, self.vertices[start], self.vertices[end], angle, angle + sweep)

    def _faces(self, make: Any, shell: Any, up: bool) -> None:
        from OCP.Geom import Geom_Plane
        from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Face

        orientation = TopAbs_Orientation.TopAbs_FORWARD if up else TopAbs_Orientation.TopAbs_REVERSED
        plane = Geom_Plane(gp_Ax3(gp_Pnt(0.0, 0.0, self.z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0)))
        for wires in self.sheet.faces:
            face = TopoDS_Face()
            make.MakeFace(face, plane, TOLERANCE_MM)
            for wire in wires:
                make.Add(face, self._wire(make, wire))
            make.Add(shell, face.Oriented(orientation))

    def _wire(self, make: Any, steps: Wire) -> Any:
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Wire

        wire = TopoDS_Wire()
        make.MakeWire(wire)
        for edge, along in steps:
            orientation = TopAbs_Orientation.TopAbs_FORWARD if along else TopAbs_Orientation.TopAbs_REVERSED
            make.Add(wire, self.shapes[edge].Oriented(orientation))
        wire.Closed(True)
        return wire


def make_straight_edge(
    make: Any,
    start: Any,
    start_xyz: tuple[float, float, float],
    end: Any,
    end_xyz: tuple[float, float, float],
) -> Any:
    from OCP.Geom import Geom_Line
    from OCP.gp import gp_Dir, gp_Pnt

    dx, dy, dz = (b - a for a, b in zip(start_xyz, end_xyz, strict=True))
    line = Geom_Line(gp_Pnt(*start_xyz), gp_Dir(dx, dy, dz))
    return _make_edge(make, line, start, end, 0.0, float((dx * dx + dy * dy + dz * dz) ** 0.5))


def _make_edge(make: Any, curve: Any, start: Any, end: Any, first: float, last: float) -> Any:
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import TopoDS_Edge

    edge = TopoDS_Edge()
    make.MakeEdge(edge, curve, TOLERANCE_MM)
    make.Add(edge, start.Oriented(TopAbs_Orientation.TopAbs_FORWARD))
    make.Add(edge, end.Oriented(TopAbs_Orientation.TopAbs_REVERSED))
    make.Range(edge, first, last)
    return edge


def make_slab_solid(slab: Slab) -> Any:
    """The slab as a solid (TopoDS_Solid), its volume ``slab_volume_mm3``."""
    builder = ShellBuilder()
    bottom = builder.place(_bottom_faces(slab), slab.bottom_mm, up=False)
    top = builder.place(_top_faces(slab), slab.top_mm, up=True)
    builder.walls(bottom, 0, top, 0, outward=True)
    for number in range(len(slab.through)):
        builder.walls(bottom, 1 + number, top, 1 + number, outward=False)
    rim = 1 + len(slab.through)
    for feature in slab.features:
        _add_feature(builder, top, rim, feature)
        rim += 1 if feature.island is None else 2
    below = 1 + len(slab.through)
    for number in range(len(slab.many_through)):
        builder.walls(bottom, below + number, top, rim + number, outward=False)
    rim += len(slab.many_through)
    for number, feature in enumerate(slab.many):
        _add_feature(builder, top, rim + number, feature)
    return builder.solid()


def _bottom_faces(slab: Slab) -> PlanarFaces:
    holes = [below for below, _ in slab.through]
    return tile_faces(slab.outer, holes, [below for below, _ in slab.many_through], TILE_MARGIN_MM)


def _top_faces(slab: Slab) -> PlanarFaces:
    """The top's faces; an island's outline belongs to a face of its own, inside the ring."""
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
    """Rims inside an island are cut out of it, the others out of the slab."""
    outer = slab.outlines[1]
    sheet = untiled_faces(outer, holes)
    boxes = bounding_boxes([outer, *holes])

    def inside(inner: int, outer: int) -> bool:
        low, high = boxes[outer]
        return inner != outer and bool((boxes[inner][0] > low).all() and (boxes[inner][1] < high).all())

    members = {island: [i for i in range(1, len(boxes)) if inside(i, island)] for island in islands}
    taken = {i for island in islands for i in (island, *members[island])}
    free = [i for i in range(1, len(boxes)) if i not in taken]
    sheet.faces = [[forward_wire(sheet.around(0)), *(backward_wire(sheet.around(i)) for i in free)]]
    for island in islands:
        cut_out = [backward_wire(sheet.around(i)) for i in members[island]]
        sheet.faces.append([forward_wire(sheet.around(island)), *cut_out])
    return sheet


def _add_feature(builder: ShellBuilder, top: PlacedFaces, rim: int, feature: Feature) -> None:
    holes = [] if feature.island is None else [feature.island[1]]
    end = builder.place(untiled_faces(feature.tip, holes), top.z + feature.height_mm, up=True)
    raised = feature.height_mm > 0
    for number in range(1 + len(holes)):
        outward = raised != (number == 1)
        if raised:
            builder.walls(top, rim + number, end, number, outward)
        else:
            builder.walls(end, number, top, rim + number, outward)


def slab_volume_mm3(slab: Slab) -> float:
    """The slab's volume in closed form, from areas of outlines."""
    height = slab.top_mm - slab.bottom_mm
    volume = frustum_volume_mm3(*slab.outlines, height)
    volume -= frusta_volume_mm3([*slab.through, *slab.many_through], height)
    for feature in slab.features:
        volume += frustum_volume_mm3(feature.root, feature.tip, feature.height_mm)
        if feature.island is not None:
            volume -= frustum_volume_mm3(*feature.island, feature.height_mm)
    for tall in {feature.height_mm for feature in slab.many}:
        pairs = [(feature.root, feature.tip) for feature in slab.many if feature.height_mm == tall]
        volume += frusta_volume_mm3(pairs, tall)
    return volume
