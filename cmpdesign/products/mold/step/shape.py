"""The boundary of a solid as STEP entities: faces, edges and vertices once each, shared as in the solid.

Every face, edge and vertex is visited once. The kernel's own translator is not used, because its time per entity grows
with the number of entities (with the power 0.12 to 0.19, from 100 to 3,600 bosses).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cmpdesign.libraries import extra
from cmpdesign.products.mold.step.entities import StepEntities, Triple, format_real, format_references


def add_solid(solid: Any, entities: StepEntities) -> int:
    """Add a solid.

    Args:
        solid: TopoDS_Solid of one shell, mm; its faces are planes, cylinders, cones and spheres, its edges lines,
            circles and ellipses.
        entities: entities of the file.

    Returns:
        The number of the MANIFOLD_SOLID_BREP.

    Raises:
        RuntimeError: any other solid.
    """
    with extra("cad"):
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.TopoDS import TopoDS

    shells = list(_explore(solid, TopAbs_ShapeEnum.TopAbs_SHELL))
    if len(shells) != 1:
        raise RuntimeError(f"STEP: a solid has {len(shells)} shells, not one")
    boundary = _BoundaryWriter(entities)
    faces = [boundary.add_face(TopoDS.Face(face)) for face in _explore(solid, TopAbs_ShapeEnum.TopAbs_FACE)]
    shell = entities.add(f"CLOSED_SHELL('',({format_references(faces)}))")
    return entities.add(f"MANIFOLD_SOLID_BREP('',#{shell})")


def _explore(shape: Any, kind: Any) -> Iterator[Any]:
    with extra("cad"):
        from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


class _BoundaryWriter:
    """Adds faces, edges and vertices; keeps the numbers of the edges and vertices that were added."""

    def __init__(self, entities: StepEntities) -> None:
        with extra("cad"):
            from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
            from OCP.TopAbs import TopAbs_Orientation

        self.entities = entities
        self.forward = TopAbs_Orientation.TopAbs_FORWARD
        # The index of a shape in its map, counted from 1, is the index of its number in the list.
        self.edge_map, self.edge_numbers = ShapeMap(), [0]
        self.vertex_map, self.vertex_numbers = ShapeMap(), [0]

    def add_face(self, face: Any) -> int:
        with extra("cad"):
            from OCP.BRep import BRep_Tool
            from OCP.TopoDS import TopoDS, TopoDS_Iterator

        surface, same_normal = _add_surface(BRep_Tool.Surface_s(face), self.entities)
        outward = face.Orientation() == self.forward
        forward_face = TopoDS.Face(face.Oriented(self.forward))
        bounds = []
        wires = TopoDS_Iterator(face)
        while wires.More():
            wire = TopoDS.Wire(wires.Value())
            loop = self.add_loop(TopoDS.Wire(wire.Oriented(self.forward)), forward_face)
            is_forward = _step_logical(wire.Orientation() == self.forward)
            bounds.append(self.entities.add(f"FACE_BOUND('',#{loop},{is_forward})"))
            wires.Next()
        sense = _step_logical(outward == same_normal)
        return self.entities.add(f"ADVANCED_FACE('',({format_references(bounds)}),#{surface},{sense})")

    def add_loop(self, wire: Any, face: Any) -> int:
        """Add the edges of a wire in order; the number of the EDGE_LOOP."""
        with extra("cad"):
            from OCP.BRepTools import BRepTools_WireExplorer

        oriented_edges = []
        explorer = BRepTools_WireExplorer(wire, face)
        while explorer.More():
            edge = explorer.Current()
            number = self.add_edge(edge)
            if number:
                is_forward = _step_logical(edge.Orientation() == self.forward)
                oriented_edges.append(self.entities.add(f"ORIENTED_EDGE('',*,*,#{number},{is_forward})"))
            explorer.Next()
        return self.entities.add(f"EDGE_LOOP('',({format_references(oriented_edges)}))")

    def add_edge(self, edge: Any) -> int:
        """Add an edge once; its number, or 0 for an edge without length (a sphere's pole), which is not written."""
        index: int = self.edge_map.Add(edge)
        if index == len(self.edge_numbers):
            self.edge_numbers.append(self._add_new_edge(edge))
        return self.edge_numbers[index]

    def _add_new_edge(self, edge: Any) -> int:
        with extra("cad"):
            from OCP.BRep import BRep_Tool
            from OCP.TopExp import TopExp

        curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
        if curve is None:
            return 0
        # The edge runs from the lower to the higher parameter of the curve, whatever its orientation.
        start, end = self.add_vertex(TopExp.FirstVertex_s(edge)), self.add_vertex(TopExp.LastVertex_s(edge))
        return self.entities.add(f"EDGE_CURVE('',#{start},#{end},#{_add_curve(curve, self.entities)},.T.)")

    def add_vertex(self, vertex: Any) -> int:
        with extra("cad"):
            from OCP.BRep import BRep_Tool

        index: int = self.vertex_map.Add(vertex)
        if index == len(self.vertex_numbers):
            point = self.entities.add_point(*_xyz(BRep_Tool.Pnt_s(vertex)))
            self.vertex_numbers.append(self.entities.add(f"VERTEX_POINT('',#{point})"))
        return self.vertex_numbers[index]


def _add_curve(curve: Any, entities: StepEntities) -> int:
    kind = type(curve).__name__
    if kind == "Geom_Line":
        line = curve.Position()
        direction = entities.add_direction(*_xyz(line.Direction()))
        vector = entities.add_shared(f"VECTOR('',#{direction},1.)")
        return entities.add(f"LINE('',#{entities.add_point(*_xyz(line.Location()))},#{vector})")
    if kind == "Geom_Circle":
        return entities.add(
            f"CIRCLE('',#{_add_axes(curve.Position(), entities)},{format_real(curve.Radius())})"
        )
    if kind == "Geom_Ellipse":
        radii = f"{format_real(curve.MajorRadius())},{format_real(curve.MinorRadius())}"
        return entities.add(f"ELLIPSE('',#{_add_axes(curve.Position(), entities)},{radii})")
    raise RuntimeError(f"STEP: an edge is a {kind}, no line, circle or ellipse")


def _add_surface(surface: Any, entities: StepEntities) -> tuple[int, bool]:
    """Add a surface; its number, and True if its normal in the file is the kernel's normal."""
    kind = type(surface).__name__
    if kind not in ("Geom_Plane", "Geom_CylindricalSurface", "Geom_ConicalSurface", "Geom_SphericalSurface"):
        raise RuntimeError(f"STEP: a face is a {kind}, no plane, cylinder, cone or sphere")
    position = surface.Position()
    # Axes in a file are right-handed; left-handed axes of the kernel reverse the normal.
    direct = bool(position.Direct())
    if kind == "Geom_ConicalSurface":
        # Cones in a file widen along their axis.
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
    return entities.add_axes(_xyz(position.Location()), z, _xyz(position.XDirection()))


def _xyz(vector: Any) -> Triple:
    """The coordinates of a gp_Pnt or gp_Dir."""
    return vector.X(), vector.Y(), vector.Z()


def _step_logical(value: bool) -> str:
    return ".T." if value else ".F."
