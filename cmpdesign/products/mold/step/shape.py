"""A solid's boundary as STEP entities: faces, edges and vertices once each, shared as in the solid.

Written here and not by the kernel's translator, whose time for an entity grows with their number (as the power
0.12 to 0.19, from 100 to 3,600 bosses). Here every face, edge and vertex is visited once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cmpdesign.products.mold.step.entities import Direction, StepEntities, format_real, format_references


def add_solid(solid: Any, entities: StepEntities) -> int:
    """The number of a solid's MANIFOLD_SOLID_BREP.

    Args:
        solid: TopoDS_Solid of one shell, mm; its faces are planes, cylinders, cones and spheres, its edges
            lines, circles and ellipses.

    Raises:
        RuntimeError: any other solid.
    """
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    shells = list(_explore(solid, TopAbs_ShapeEnum.TopAbs_SHELL))
    if len(shells) != 1:
        raise RuntimeError(f"STEP: a solid has {len(shells)} shells, not one")
    boundary = _BoundaryWriter(entities)
    faces = [boundary.face(TopoDS.Face(face)) for face in _explore(solid, TopAbs_ShapeEnum.TopAbs_FACE)]
    shell = entities.add(f"CLOSED_SHELL('',({format_references(faces)}))")
    return entities.add(f"MANIFOLD_SOLID_BREP('',#{shell})")


def _explore(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


class _BoundaryWriter:
    """Knows the numbers of the edges and vertices met so far."""

    def __init__(self, entities: StepEntities) -> None:
        from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
        from OCP.TopAbs import TopAbs_Orientation

        self.entities = entities
        self.forward = TopAbs_Orientation.TopAbs_FORWARD
        # A shape's place in its map, counted from 1, is that of its number in the list.
        self.edge_map, self.edge_numbers = ShapeMap(), [0]
        self.vertex_map, self.vertex_numbers = ShapeMap(), [0]

    def face(self, face: Any) -> int:
        from OCP.BRep import BRep_Tool
        from OCP.TopoDS import TopoDS, TopoDS_Iterator

        surface, as_written = _add_surface(BRep_Tool.Surface_s(face), self.entities)
        outward = face.Orientation() == self.forward
        plain = TopoDS.Face(face.Oriented(self.forward))
        bounds = []
        wires = TopoDS_Iterator(face)
        while wires.More():
            wire = TopoDS.Wire(wires.Value())
            loop = self.loop(TopoDS.Wire(wire.Oriented(self.forward)), plain)
            along = _step_logical(wire.Orientation() == self.forward)
            bounds.append(self.entities.add(f"FACE_BOUND('',#{loop},{along})"))
            wires.Next()
        sense = _step_logical(outward == as_written)
        return self.entities.add(f"ADVANCED_FACE('',({format_references(bounds)}),#{surface},{sense})")

    def loop(self, wire: Any, face: Any) -> int:
        """A wire's edges, each beginning where the last one ends."""
        from OCP.BRepTools import BRepTools_WireExplorer

        steps = []
        explorer = BRepTools_WireExplorer(wire, face)
        while explorer.More():
            edge = explorer.Current()
            number = self.edge(edge)
            if number:
                along = _step_logical(edge.Orientation() == self.forward)
                steps.append(self.entities.add(f"ORIENTED_EDGE('',*,*,#{number},{along})"))
            explorer.Next()
        return self.entities.add(f"EDGE_LOOP('',({format_references(steps)}))")

    def edge(self, edge: Any) -> int:
        """0 for an edge without length, such as a sphere's pole, which a file leaves out."""
        place: int = self.edge_map.Add(edge)
        if place == len(self.edge_numbers):
            self.edge_numbers.append(self._new_edge(edge))
        return self.edge_numbers[place]

    def _new_edge(self, edge: Any) -> int:
        from OCP.BRep import BRep_Tool
        from OCP.TopExp import TopExp

        curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
        if curve is None:
            return 0
        # Orientation aside: from the curve's lower parameter to its higher one.
        start, end = self.vertex(TopExp.FirstVertex_s(edge)), self.vertex(TopExp.LastVertex_s(edge))
        return self.entities.add(f"EDGE_CURVE('',#{start},#{end},#{_add_curve(curve, self.entities)},.T.)")

    def vertex(self, vertex: Any) -> int:
        from OCP.BRep import BRep_Tool

        place: int = self.vertex_map.Add(vertex)
        if place == len(self.vertex_numbers):
            point = self.entities.point(*_xyz(BRep_Tool.Pnt_s(vertex)))
            self.vertex_numbers.append(self.entities.add(f"VERTEX_POINT('',#{point})"))
        return self.vertex_numbers[place]


def _add_curve(curve: Any, entities: StepEntities) -> int:
    kind = type(curve).__name__
    if kind == "Geom_Line":
        line = curve.Position()
        along = entities.direction(*_xyz(line.Direction()))
        vector = entities.share(f"VECTOR('',#{along},1.)")
        return entities.add(f"LINE('',#{entities.point(*_xyz(line.Location()))},#{vector})")
    if kind == "Geom_Circle":
        return entities.add(
            f"CIRCLE('',#{_add_axes(curve.Position(), entities)},{format_real(curve.Radius())})"
        )
    if kind == "Geom_Ellipse":
        radii = f"{format_real(curve.MajorRadius())},{format_real(curve.MinorRadius())}"
        return entities.add(f"ELLIPSE('',#{_add_axes(curve.Position(), entities)},{radii})")
    raise RuntimeError(f"STEP: an edge is a {kind}, no line, circle or ellipse")


def _add_surface(surface: Any, entities: StepEntities) -> tuple[int, bool]:
    """A surface's number, and whether its normal in the file is the kernel's."""
    kind = type(surface).__name__
    if kind not in ("Geom_Plane", "Geom_CylindricalSurface", "Geom_ConicalSurface", "Geom_SphericalSurface"):
        raise RuntimeError(f"STEP: a face is a {kind}, no plane, cylinder, cone or sphere")
    position = surface.Position()
    # A file's axes are right-handed; the kernel's may not be, which turns its normal.
    direct = bool(position.Direct())
    if kind == "Geom_ConicalSurface":
        # A file's cones widen along their axis.
        angle = surface.SemiAngle()
        axes = _add_axes(position, entities, flip=angle < 0)
        text = f"CONICAL_SURFACE('',#{axes},{format_real(surface.RefRadius())},{format_real(abs(angle))})"
    elif kind == "Geom_Plane":
        text = f"PLANE('',#{_add_axes(position, entities)})"
    else:
        name = "CYLINDRICAL_SURFACE" if kind == "Geom_CylindricalSurface" else "SPHERICAL_SURFACE"
        text = f"{name}('',#{_add_axes(position, entities)},{format_real(surface.Radius())})"
    return entities.add(text), direct


def _add_axes(position: Any, entities: StepEntities, flip: bool = False) -> int:
    z = _xyz(position.Direction())
    if flip:
        z = (-z[0], -z[1], -z[2])
    return entities.axes(_xyz(position.Location()), z, _xyz(position.XDirection()))


def _xyz(of: Any) -> Direction:
    return of.X(), of.Y(), of.Z()


def _step_logical(value: bool) -> str:
    return ".T." if value else ".F."
