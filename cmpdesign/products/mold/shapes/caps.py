"""The smooth crown of base and lid. Only this module uses boolean operations of solids."""

from __future__ import annotations

from typing import Any

from cmpdesign.libraries import extra
from cmpdesign.products.mold.stack.crown import END_SLOPE, Crown


def solid_with_cap(solid: Any, crown: Crown, raised: bool) -> Any:
    """Unite a solid with the crown's cap over z = 0 (``raised``), or cut the cap out of the solid."""
    with extra("cad"):
        from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.TopExp import TopExp_Explorer
        from OCP.TopoDS import TopoDS

    operation = BRepAlgoAPI_Fuse if raised else BRepAlgoAPI_Cut
    shape = operation(solid, cap_solid(crown)).Shape()
    return TopoDS.Solid(TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID).Current())


def cap_solid(crown: Crown) -> Any:
    """The cap as a solid, its foot at z = 0."""
    with extra("cad"):
        from OCP.BRepBuilderAPI import (
            BRepBuilderAPI_MakeEdge,
            BRepBuilderAPI_MakeFace,
            BRepBuilderAPI_MakeWire,
        )
        from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeRevol
        from OCP.GC import GC_MakeArcOfCircle
        from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Vec

    sphere = crown.shape == "sphere"
    y = 0.0 if sphere else -crown.length_mm
    foot, apex = gp_Pnt(crown.reach_mm, y, 0.0), gp_Pnt(0.0, y, crown.height_mm)
    middle = gp_Pnt(*_arc_middle(crown, y))
    if sphere:
        origin = gp_Pnt(0.0, 0.0, 0.0)
        arc = GC_MakeArcOfCircle(foot, middle, apex).Value()
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
    """A cylindrical cap, cut off by the leaning planes of its ends."""
    with extra("cad"):
        from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
        from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
        from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
        from OCP.gp import gp_Pnt, gp_Vec

    # A prism of trapezoidal section along x, 1 mm wider and higher than the cap.
    half_width, top, end = crown.reach_mm + 1.0, crown.height_mm + 1.0, crown.length_mm
    end_at_top = end - top / END_SLOPE
    outline = BRepBuilderAPI_MakePolygon()
    for y, z in ((-end, 0.0), (end, 0.0), (end_at_top, top), (-end_at_top, top)):
        outline.Add(gp_Pnt(-half_width, y, z))
    outline.Close()
    face = BRepBuilderAPI_MakeFace(outline.Wire()).Face()
    prism = BRepPrimAPI_MakePrism(face, gp_Vec(2 * half_width, 0.0, 0.0)).Shape()
    return BRepAlgoAPI_Common(bar, prism).Shape()


def _arc_middle(crown: Crown, y: float) -> tuple[float, float, float]:
    """(x, y, z) of a point on the arc between foot and apex, mm."""
    x = crown.reach_mm / 2
    z = (crown.radius_mm**2 - x**2) ** 0.5 - (crown.radius_mm - crown.height_mm)
    return x, y, z
