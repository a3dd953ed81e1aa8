"""Flat faces with shared edges, added to a shell whose rims they may start from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from cmpdesign.products.mold.solids.loops import Points
from cmpdesign.products.mold.solids.slab_shells import (
    TOLERANCE_MM,
    PlacedFaces,
    ShellBuilder,
    make_straight_edge,
)


class FacetBuilder:
    """Polygons in space over numbered points; neighbouring polygons share their edges."""

    def __init__(self, builder: ShellBuilder, points: Points) -> None:
        self._builder, self._points = builder, points
        self._vertices: dict[int, Any] = {}
        # (from, to) -> the edge, which runs from -> to.
        self._edges: dict[tuple[int, int], Any] = {}

    def share(self, placed: PlacedFaces, rim: int, points: Sequence[int]) -> None:
        """Take a placed rim's vertices and edges for ``points``, which lie at its corners in its order."""
        for side, edges in enumerate(placed.sheet.rims[rim]):
            start, end, _ = placed.sheet.edges[edges[0]]
            a, b = points[side], points[(side + 1) % len(points)]
            self._vertices[a], self._vertices[b] = placed.vertices[start], placed.vertices[end]
            self._edges[a, b] = placed.shapes[edges[0]]

    def add(self, wires: Iterable[Sequence[int]]) -> None:
        """A face; the outer wire first, counter-clockwise from outside, holes clockwise."""
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
            make.Add(face, self._wire(wire))
        make.Add(self._builder.shell, face)

    def _wire(self, corners: Sequence[int]) -> Any:
        from OCP.TopoDS import TopoDS_Wire

        wire = TopoDS_Wire()
        self._builder.make.MakeWire(wire)
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            self._builder.make.Add(wire, self._edge(a, b))
        wire.Closed(True)
        return wire

    def _edge(self, a: int, b: int) -> Any:
        from OCP.TopAbs import TopAbs_Orientation

        if (b, a) in self._edges:
            return self._edges[b, a].Oriented(TopAbs_Orientation.TopAbs_REVERSED)
        if (a, b) not in self._edges:
            start, end = tuple(self._points[a].tolist()), tuple(self._points[b].tolist())
            self._edges[a, b] = make_straight_edge(
                self._builder.make, self._vertex(a), start, self._vertex(b), end
            )
        return self._edges[a, b].Oriented(TopAbs_Orientation.TopAbs_FORWARD)

    def _vertex(self, number: int) -> Any:
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        if number not in self._vertices:
            vertex = TopoDS_Vertex()
            self._builder.make.MakeVertex(vertex, gp_Pnt(*self._points[number].tolist()), TOLERANCE_MM)
            self._vertices[number] = vertex
        return self._vertices[number]
