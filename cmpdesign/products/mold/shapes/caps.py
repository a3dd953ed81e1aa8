"""The smooth crown of base and lid: the one place where solids are united or cut."""

from __future__ import annotations

from typing import Any

from cmpdesign.products.mold.stack.crown import END_SLOPE, Crown


def solid_with_cap(solid: Any, crown: Crown, raised: bool) -> Any:
    """The solid with the crown's cap standing on z = 0 (raised), or with its shape cut out from z = 0 up."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    operation = BRepAlgoAPI_Fuse if raised else BRepAlgoAPI_Cut
    shape = operation(solid, cap_solid(crown)).Shape()
    return TopoDS.Solid(TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID).Current())


def cap_solid(crown: Crown) -> Any:
    """The cap over its foot at z = 0."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeRevol
    from OCP.GC import GC_MakeArcOfCircle
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Vec

    sphere = crown.shape == "sphere"
    y = 0.0 if sphere else -crown.length_mm
    foot, apex = gp_Pnt(crown.reach_mm, y, 0.0), gp_Pnt(0.0, y, crown.height_mm)
    on_the_way = gp_Pnt(*_arc_midpoint(crown, y))
    if sphere:
        origin = gp_Pnt(0.0, 0.0, 0.0)
        arc = GC_MakeArcOfCircle(foot, on_the_way, apex).Value()
        edges = [BRepBuilderAPI_MakeEdge(origin, foot), BRepBuilderAPI_MakeEdge(arc)]
        edges.append(BRepBuilderAPI_MakeEdge(apex, origin))
    else:
        other = gp_Pnt(-crown.reach_mm, y, 0.0)
        edges = [BRepBuilderAPI_MakeEdge(other, foot)]
        edges.append(BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(foot, apex, other).Value()))
    wire = BRepBuilderAPI_MakeWire()
    for edge in edges:
        wire.Add(edge.Edge())
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    if sphere:
        return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0.0, 0.0, 0.0), gp_Dir(0.0, 0.0, 1.0))).Shape()
    return _cut_cylinder_ends(
        BRepPrimAPI_MakePrism(face, gp_Vec(0.0, 2 * crown.length_mm, 0.0)).Shape(), crown
    )


def _cut_cylinder_ends(bar: Any, crown: Crown) -> Any:
    """A cylinder's cap, cut off by its leaning ends."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.gp import gp_Pnt, gp_Vec

    # A trapezium across the bar, a little wider and higher than it.
    aside, top, end = crown.reach_mm + 1.0, crown.height_mm + 1.0, crown.length_mm
    narrower = end - top / END_SLOPE
    outline = BRepBuilderAPI_MakePolygon()
    for y, z in ((-end, 0.0), (end, 0.0), (narrower, top), (-narrower, top)):
        outline.Add(gp_Pnt(-aside, y, z))
    outline.Close()
    face = BRepBuilderAPI_MakeFace(outline.Wire()).Face()
    return BRepAlgoAPI_Common(bar, BRepPrimAPI_MakePrism(face, gp_Vec(2 * aside, 0.0, 0.0)).Shape()).Shape()


def _arc_midpoint(crown: Crown, y: float) -> tuple[float, float, float]:
    """A point of the arc between foot and apex."""
    x = crown.reach_mm / 2
    z = (crown.radius_mm**2 - x**2) ** 0.5 - (crown.radius_mm - crown.height_mm)
    return x, y, z
