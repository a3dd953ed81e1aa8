"""Measures of a built solid, computed by the kernel, independently of the numbers that describe the solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cmpdesign.libraries import extra

# Walls are faces that lean against z by less than this.
LEVEL_DEG = 45.0 - 1e-6

Point = tuple[float, float, float]


@dataclass(frozen=True)
class SolidMeasures:
    """The measures of one solid.

    Attributes:
        valid: BRepCheck reports no error.
        closed: every edge is shared by two faces.
        faces: number of faces.
        volume_mm3: volume by integration over the faces.
    """

    valid: bool
    closed: bool
    faces: int
    volume_mm3: float


def measure_solid(shape: Any) -> SolidMeasures:
    """Measure validity, closure, faces and volume of a solid (TopoDS_Shape)."""
    with extra("cad"):
        from OCP.BRepCheck import BRepCheck_Analyzer
        from OCP.TopAbs import TopAbs_ShapeEnum

    valid = bool(BRepCheck_Analyzer(shape, True, True).IsValid())
    faces = len(subshapes(shape, TopAbs_ShapeEnum.TopAbs_FACE))
    return SolidMeasures(valid, is_closed(shape), faces, volume_mm3(shape))


def volume_mm3(shape: Any) -> float:
    """Volume by integration over the faces; exact for flat faces, to 1e-12 for round faces."""
    with extra("cad"):
        from OCP.BRepGProp import BRepGProp
        from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def is_closed(shape: Any) -> bool:
    """True when every edge of every shell is used twice, once in each direction."""
    with extra("cad"):
        from OCP.BRep import BRep_Tool
        from OCP.TopAbs import TopAbs_ShapeEnum

    shells = subshapes(shape, TopAbs_ShapeEnum.TopAbs_SHELL)
    return bool(shells) and all(BRep_Tool.IsClosed_s(shell) for shell in shells)


def subshapes(shape: Any, kind: Any) -> list[Any]:
    """Sub-shapes of a kind (TopAbs_ShapeEnum) in order; a shared sub-shape once for every use."""
    with extra("cad"):
        from OCP.TopExp import TopExp_Explorer

    found = []
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def drafts_deg(shape: Any, low_mm: Point, high_mm: Point) -> tuple[float, float]:
    """Least and largest lean against z of the walls that lie wholly within a box; NaN without walls.

    A wall is a plane, cone or cylinder that leans by less than ``LEVEL_DEG``.

    Args:
        shape: the solid.
        low_mm, high_mm: opposite corners of the box.
    """
    with extra("cad"):
        from OCP.BRepAdaptor import BRepAdaptor_Surface
        from OCP.GeomAbs import GeomAbs_SurfaceType
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.TopoDS import TopoDS

    least, largest = float("inf"), float("-inf")
    for face in subshapes(shape, TopAbs_ShapeEnum.TopAbs_FACE):
        surface = BRepAdaptor_Surface(TopoDS.Face(face), False)
        kind, lean = surface.GetType(), LEVEL_DEG
        if kind == GeomAbs_SurfaceType.GeomAbs_Plane:
            lean = float(np.degrees(np.arcsin(min(1.0, abs(surface.Plane().Axis().Direction().Z())))))
        elif kind == GeomAbs_SurfaceType.GeomAbs_Cone:
            lean = float(np.degrees(abs(surface.Cone().SemiAngle())))
        elif kind == GeomAbs_SurfaceType.GeomAbs_Cylinder:
            lean = 90.0 - float(
                np.degrees(np.arcsin(min(1.0, abs(surface.Cylinder().Axis().Direction().Z()))))
            )
        # The place of a face is tested only if its lean extends the range: most faces have the same lean.
        in_range = least <= lean <= largest
        if lean < LEVEL_DEG and not in_range and _is_within(face, low_mm, high_mm):
            least, largest = min(least, lean), max(largest, lean)
    return (least, largest) if least <= largest else (float("nan"), float("nan"))


def _is_within(face: Any, low_mm: Point, high_mm: Point) -> bool:
    """True when every corner of the face lies in the box, with a tolerance of a micrometre."""
    with extra("cad"):
        from OCP.BRep import BRep_Tool
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.TopoDS import TopoDS

    for vertex in subshapes(face, TopAbs_ShapeEnum.TopAbs_VERTEX):
        point = BRep_Tool.Pnt_s(TopoDS.Vertex(vertex))
        place = (point.X(), point.Y(), point.Z())
        if any(c < a - 1e-3 or c > b + 1e-3 for a, c, b in zip(low_mm, place, high_mm, strict=True)):
            return False
    return True


def distance_mm(first: Any, second: Any) -> float:
    """The least distance between two solids; 0 where they touch or overlap."""
    with extra("cad"):
        from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    return float(BRepExtrema_DistShapeShape(first, second).Value())


def overlap_mm3(first: Any, second: Any) -> float:
    """The volume that two solids share."""
    with extra("cad"):
        from OCP.BRepAlgoAPI import BRepAlgoAPI_Common

    return volume_mm3(BRepAlgoAPI_Common(first, second).Shape())
