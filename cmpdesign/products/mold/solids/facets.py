"""Flat faces with shared edges, added to a shell; the faces may start from rims of the shell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from cmpdesign.libraries import extra
from cmpdesign.products.mold.solids.loops import Points
from cmpdesign.products.mold.solids.shells import (
    TOLERANCE_MM,
    PlacedFaces,
    ShellBuilder,
    make_straight_edge,
)


class FacetBuilder:
    """Adds polygons over numbered points to a shell; neighbouring polygons share their edges.

    Args:
        builder: the shell.
        points: (P, 3) mm.
    """

    def __init__(self, builder: ShellBuilder, points: Points) -> None:
        self._builder, self._points = builder, points
        self._vertices: dict[int, Any] = {}
        # (start, end) -> the edge from start to end.
        self._edges: dict[tuple[int, int], Any] = {}

    def share_rim(self, placed: PlacedFaces, rim: int, points: Sequence[int]) -> None:
        """Use the vertices and edges of a placed rim for ``points``, the numbers of the rim's corners in order."""
        for side, edges in enumerate(placed.plane.rims[rim]):
            edge = placed.plane.edges[edges[0]]
            a, b = points[side], points[(side + 1) % len(points)]
            self._vertices[a], self._vertices[b] = placed.vertices[edge.start], placed.vertices[edge.end]
            self._edges[a, b] = placed.shapes[edges[0]]

    def add_face(self, wires: Iterable[Sequence[int]]) -> None:
        """Add a face: the outer wire counter-clockwise as seen from outside, then the holes clockwise."""
        with extra("cad"):
            from OCP.Geom import Geom_Plane
            from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
            from OCP.TopoDS import TopoDS_Face

        wires = list(wires)
        corners = self._points[list(wires[0])]
        normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        along = corners[1] - corners[0]
        axes = gp_Ax3(gp_Pnt(*corners[0]), gp_Dir(*normal), gp_Dir(*along))
        make, face = self._builder.make, TopoDS_Face()
        make.MakeFace(face, Geom_Plane(axes), TOLERANCE_MM)
        for wire in wires:
            make.Add(face, self._make_wire(wire))
        make.Add(self._builder.shell, face)

    def _make_wire(self, corners: Sequence[int]) -> Any:
        with extra("cad"):
            from OCP.TopoDS import TopoDS_Wire

        wire = TopoDS_Wire()
        self._builder.make.MakeWire(wire)
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            self._builder.make.Add(wire, self._get_edge(a, b))
        wire.Closed(True)
        return wire

    def _get_edge(self, a: int, b: int) -> Any:
        with extra("cad"):
            from OCP.TopAbs import TopAbs_Orientation

        if (b, a) in self._edges:
            return self._edges[b, a].Oriented(TopAbs_Orientation.TopAbs_REVERSED)
        if (a, b) not in self._edges:
            start, end = tuple(self._points[a].tolist()), tuple(self._points[b].tolist())
            self._edges[a, b] = make_straight_edge(
                self._builder.make, self._get_vertex(a), start, self._get_vertex(b), end
            )
        return self._edges[a, b].Oriented(TopAbs_Orientation.TopAbs_FORWARD)

    def _get_vertex(self, number: int) -> Any:
        with extra("cad"):
            from OCP.gp import gp_Pnt
            from OCP.TopoDS import TopoDS_Vertex

        if number not in self._vertices:
            vertex = TopoDS_Vertex()
            self._builder.make.MakeVertex(vertex, gp_Pnt(*self._points[number].tolist()), TOLERANCE_MM)
            self._vertices[number] = vertex
        return self._vertices[number]
