"""Solids built face by face with shared edges, without boolean operations, in a time linear in the faces.

A ``Slab`` is a plate with any number of bosses, pockets and through holes. Every outline is a ``Loop``. Walls join two
paired outlines (a boss's root and tip): planes along straight sides, cylinders or cones along arcs. Neighbouring faces
share their edges, so the shell is closed by construction; nothing is intersected, sewn or healed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

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

# Tolerance of the kernel's vertices, edges and faces.
TOLERANCE_MM = 1e-7
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


class ShellBuilder:
    """Collects the faces of one solid."""

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

    def add_faces(self, plane: PlanarFaces, z: float, up: bool) -> PlacedFaces:
        """Add the faces of a plane at height z; ``up`` if the material lies below the faces."""
        return PlacedFaces(self.make, self.shell, plane, z, up)

    def add_walls(
        self, lower: PlacedFaces, rim: int, upper: PlacedFaces, upper_rim: int, outward: bool
    ) -> None:
        """Join two rims side by side by walls; ``outward`` if the material lies inside the outlines."""
        sides = len(lower.plane.rims[rim])
        posts = [self._make_post(lower, rim, upper, upper_rim, side) for side in range(sides)]
        for side in range(sides):
            wall = _Wall(
                lower=lower,
                below=lower.plane.rims[rim][side],
                upper=upper,
                above=upper.plane.rims[upper_rim][side],
                first_post=posts[side],
                last_post=posts[(side + 1) % sides],
            )
            self._add_wall(wall, outward)

    def _make_post(self, lower: PlacedFaces, rim: int, upper: PlacedFaces, upper_rim: int, side: int) -> Any:
        """The edge from a side's first corner on the lower rim to that on the upper rim."""
        start = lower.plane.edges[lower.plane.rims[rim][side][0]].start
        end = upper.plane.edges[upper.plane.rims[upper_rim][side][0]].start
        return make_straight_edge(
            self.make, lower.vertices[start], lower.xyz(start), upper.vertices[end], upper.xyz(end)
        )

    def _add_wall(self, wall: _Wall, outward: bool) -> None:
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

        forward, backward = TopAbs_Orientation.TopAbs_FORWARD, TopAbs_Orientation.TopAbs_REVERSED
        surface = _wall_surface(wall)
        face, wire = TopoDS_Face(), TopoDS_Wire()
        self.make.MakeFace(face, surface.geometry, TOLERANCE_MM)
        self.make.MakeWire(wire)
        for edge in wall.below:
            self.make.Add(wire, wall.lower.shapes[edge].Oriented(forward))
        self.make.Add(wire, wall.last_post.Oriented(forward))
        for edge in reversed(wall.above):
            self.make.Add(wire, wall.upper.shapes[edge].Oriented(backward))
        self.make.Add(wire, wall.first_post.Oriented(backward))
        if surface.span is not None:
            self._add_parameter_curves(wall, surface.geometry, surface.span)
        wire.Closed(True)
        self.make.Add(face, wire)
        self.make.Add(self.shell, face.Oriented(forward if outward else backward))

    def _add_parameter_curves(self, wall: _Wall, geometry: Any, span: _RoundSpan) -> None:
        """Add the edges' curves in the (angle, length) plane of a cylinder or cone, where every edge is straight."""
        from OCP.Geom2d import Geom2d_Line
        from OCP.gp import gp_Dir2d, gp_Pnt2d
        from OCP.TopLoc import TopLoc_Location

        identity = TopLoc_Location()

        def add_curve(edge: Any, u: float, v: float, across: bool) -> None:
            line = Geom2d_Line(gp_Pnt2d(u, v), gp_Dir2d(0.0, 1.0) if across else gp_Dir2d(1.0, 0.0))
            self.make.UpdateEdge(edge, line, geometry, identity, TOLERANCE_MM)

        # The parameter of an arc is the angle itself, so the arc's curve starts at u = 0.
        for placed, edges, v in ((wall.lower, wall.below, 0.0), (wall.upper, wall.above, span.length_mm)):
            for edge in edges:
                turn = 2 * np.pi * np.floor((placed.angles[edge] - span.first + 1e-6) / (2 * np.pi))
                add_curve(placed.shapes[edge], -turn, v, across=False)
        add_curve(wall.first_post, span.first, 0.0, across=True)
        add_curve(wall.last_post, span.last, 0.0, across=True)


class _Wall(NamedTuple):
    """The borders of a wall along one side of two paired rims.

    Attributes:
        lower, upper: the placed faces that the wall joins.
        below, above: numbers of the side's edges on the lower and on the upper rim.
        first_post, last_post: the edges (TopoDS_Edge) from the lower to the upper rim at the ends of the side.
    """

    lower: PlacedFaces
    below: list[int]
    upper: PlacedFaces
    above: list[int]
    first_post: Any
    last_post: Any


class _RoundSpan(NamedTuple):
    """The extent of a round wall: first and last angle in rad, and length from rim to rim."""

    first: float
    last: float
    length_mm: float


class _WallSurface(NamedTuple):
    """A wall's surface (Geom_Surface); ``span`` is None for a flat wall."""

    geometry: Any
    span: _RoundSpan | None


def _wall_surface(wall: _Wall) -> _WallSurface:
    lower, upper = wall.lower, wall.upper
    first_edge = lower.plane.edges[wall.below[0]]
    centre = first_edge.centre
    a = lower.plane.points[first_edge.start]
    b = lower.plane.points[lower.plane.edges[wall.below[-1]].end]
    top = upper.plane.points[upper.plane.edges[wall.above[0]].start]
    if centre is None:
        return _WallSurface(_wall_plane(a, b, top, lower.z, upper.z), None)
    radius = float(np.hypot(a[0] - centre[0], a[1] - centre[1]))
    top_radius = float(np.hypot(top[0] - centre[0], top[1] - centre[1]))
    height = upper.z - lower.z
    first = lower.angles[wall.below[0]]
    sweep = sum(lower.sweeps[edge] for edge in wall.below)
    length = float(np.hypot(top_radius - radius, height))
    geometry = _round_wall_surface(centre, lower.z, radius, top_radius - radius, height)
    return _WallSurface(geometry, _RoundSpan(first, first + sweep, length))


def _wall_plane(a: Point, b: Point, top: Point, z: float, top_z: float) -> Any:
    """The plane through a and b at z and top at top_z, its normal to the right of a -> b."""
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
    """A cylinder, or a cone whose radius grows by ``growth`` over ``height``."""
    from OCP.Geom import Geom_ConicalSurface, Geom_CylindricalSurface
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    axes = gp_Ax3(gp_Pnt(centre[0], centre[1], z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0))
    if abs(growth) < TOLERANCE_MM:
        return Geom_CylindricalSurface(axes, radius)
    return Geom_ConicalSurface(axes, float(np.arctan2(growth, height)), radius)


class PlacedFaces:
    """The vertices, edges and faces (TopoDS) of a plane at height z."""

    def __init__(self, make: Any, shell: Any, plane: PlanarFaces, z: float, up: bool) -> None:
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        self.plane, self.z = plane, z
        self.vertices = []
        for x, y in plane.points:
            vertex = TopoDS_Vertex()
            make.MakeVertex(vertex, gp_Pnt(x, y, z), TOLERANCE_MM)
            self.vertices.append(vertex)
        # Edge number -> first angle and sweep of the arc, rad.
        self.angles: dict[int, float] = {}
        self.sweeps: dict[int, float] = {}
        self.shapes = [self._make_plane_edge(make, number) for number in range(len(plane.edges))]
        self._add_faces(make, shell, up)

    def xyz(self, point: int) -> tuple[float, float, float]:
        """The place of a point, mm."""
        return (*self.plane.points[point], self.z)

    def _make_plane_edge(self, make: Any, number: int) -> Any:
        start, end, centre = self.plane.edges[number]
        first, last = self.vertices[start], self.vertices[end]
        if centre is None:
            return make_straight_edge(make, first, self.xyz(start), last, self.xyz(end))
        from OCP.Geom import Geom_Circle
        from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

        (x0, y0), (x1, y1) = self.plane.points[start], self.plane.points[end]
        angle = float(np.arctan2(y0 - centre[1], x0 - centre[0])) % (2 * np.pi)
        sweep = (float(np.arctan2(y1 - centre[1], x1 - centre[0])) - angle) % (2 * np.pi)
        self.angles[number], self.sweeps[number] = angle, sweep
        axes = gp_Ax2(gp_Pnt(*centre, self.z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0))
        curve = Geom_Circle(axes, float(np.hypot(x0 - centre[0], y0 - centre[1])))
        return _make_edge(make, curve, first, last, angle, angle + sweep)

    def _add_faces(self, make: Any, shell: Any, up: bool) -> None:
        from OCP.Geom import Geom_Plane
        from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Face

        orientation = TopAbs_Orientation.TopAbs_FORWARD if up else TopAbs_Orientation.TopAbs_REVERSED
        surface = Geom_Plane(gp_Ax3(gp_Pnt(0.0, 0.0, self.z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0)))
        for wires in self.plane.faces:
            face = TopoDS_Face()
            make.MakeFace(face, surface, TOLERANCE_MM)
            for wire in wires:
                make.Add(face, self._make_wire(make, wire))
            make.Add(shell, face.Oriented(orientation))

    def _make_wire(self, make: Any, directed_edges: Wire) -> Any:
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Wire

        wire = TopoDS_Wire()
        make.MakeWire(wire)
        for edge, forward in directed_edges:
            orientation = TopAbs_Orientation.TopAbs_FORWARD if forward else TopAbs_Orientation.TopAbs_REVERSED
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
