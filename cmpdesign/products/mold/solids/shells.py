"""Shells built face by face with shared edges: placed planes, and walls between paired rims."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cmpdesign.libraries import extra
from cmpdesign.products.mold.solids.planar_faces import PlanarFaces, Point, Wire

# Tolerance of the kernel's vertices, edges and faces.
TOLERANCE_MM = 1e-7


class ShellBuilder:
    """Collects the faces of one solid."""

    def __init__(self) -> None:
        with extra("cad"):
            from OCP.BRep import BRep_Builder
            from OCP.TopoDS import TopoDS_Shell

        self.make = BRep_Builder()
        self.shell = TopoDS_Shell()
        self.make.MakeShell(self.shell)

    def solid(self) -> Any:
        """The closed solid (TopoDS_Solid)."""
        with extra("cad"):
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
        with extra("cad"):
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
        with extra("cad"):
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
    with extra("cad"):
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
    with extra("cad"):
        from OCP.Geom import Geom_ConicalSurface, Geom_CylindricalSurface
        from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    axes = gp_Ax3(gp_Pnt(centre[0], centre[1], z), gp_Dir(0.0, 0.0, 1.0), gp_Dir(1.0, 0.0, 0.0))
    if abs(growth) < TOLERANCE_MM:
        return Geom_CylindricalSurface(axes, radius)
    return Geom_ConicalSurface(axes, float(np.arctan2(growth, height)), radius)


class PlacedFaces:
    """The vertices, edges and faces (TopoDS) of a plane at height z."""

    def __init__(self, make: Any, shell: Any, plane: PlanarFaces, z: float, up: bool) -> None:
        with extra("cad"):
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
        with extra("cad"):
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
        with extra("cad"):
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
        with extra("cad"):
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
    with extra("cad"):
        from OCP.Geom import Geom_Line
        from OCP.gp import gp_Dir, gp_Pnt

    dx, dy, dz = (b - a for a, b in zip(start_xyz, end_xyz, strict=True))
    line = Geom_Line(gp_Pnt(*start_xyz), gp_Dir(dx, dy, dz))
    return _make_edge(make, line, start, end, 0.0, float((dx * dx + dy * dy + dz * dz) ** 0.5))


def _make_edge(make: Any, curve: Any, start: Any, end: Any, first: float, last: float) -> Any:
    with extra("cad"):
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopoDS import TopoDS_Edge

    edge = TopoDS_Edge()
    make.MakeEdge(edge, curve, TOLERANCE_MM)
    make.Add(edge, start.Oriented(TopAbs_Orientation.TopAbs_FORWARD))
    make.Add(edge, end.Oriented(TopAbs_Orientation.TopAbs_REVERSED))
    make.Range(edge, first, last)
    return edge
