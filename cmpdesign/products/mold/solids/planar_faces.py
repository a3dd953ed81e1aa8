"""Points, edges and faces in a plane: outlines as rims, wires of directed edges, faces with few holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cmpdesign.products.mold.solids.loops import Loop

Point = tuple[float, float]


class PlaneEdge(NamedTuple):
    """An edge from one point to another; ``centre``: of the counter-clockwise arc, None for a straight edge."""

    start: int
    end: int
    centre: Point | None


class DirectedEdge(NamedTuple):
    """An edge of a wire; ``forward`` is False if the wire runs against the edge's own direction."""

    edge: int
    forward: bool


class RimCut(NamedTuple):
    """A point that splits a side of a loop."""

    side: int
    place: Point


Wire = list[DirectedEdge]


@dataclass
class PlanarFaces:
    """The points, edges and faces of a plane.

    Attributes:
        points: (x, y) of the points, mm.
        edges: edges between points.
        rims: per loop and per side of the loop, the edges of the side in the loop's direction.
        faces: each a list of wires, the outer wire first (counter-clockwise), then the holes (clockwise).
    """

    points: list[Point] = field(default_factory=list)
    edges: list[PlaneEdge] = field(default_factory=list)
    rims: list[list[list[int]]] = field(default_factory=list)
    faces: list[list[Wire]] = field(default_factory=list)

    def add_point(self, x: float, y: float) -> int:
        """Add a point; its number."""
        self.points.append((x, y))
        return len(self.points) - 1

    def add_edge(self, start: int, end: int, centre: Point | None = None) -> int:
        """Add an edge; its number."""
        self.edges.append(PlaneEdge(start, end, centre))
        return len(self.edges) - 1

    def add_rim(self, loop: Loop, cuts: Sequence[RimCut] = ()) -> list[int]:
        """Add the edges of a loop, split at ``cuts`` (several on one side only if the side is straight).

        Returns:
            The numbers of the cuts' points.
        """
        numbers = [self.add_point(*cut.place) for cut in cuts]
        corners = [self.add_point(x, y) for x, y in loop.points.tolist()]
        centres = loop.centres.tolist()
        on_side: dict[int, list[int]] = {}
        for cut, number in zip(cuts, numbers, strict=True):
            on_side.setdefault(cut.side, []).append(number)
        sides = []
        for side, start in enumerate(corners):
            centre = None if centres[side][0] != centres[side][0] else (centres[side][0], centres[side][1])
            origin = np.array(self.points[start])
            between = on_side.get(side, [])
            between.sort(key=lambda number: float(np.hypot(*(np.array(self.points[number]) - origin))))
            ends = [start, *between, corners[(side + 1) % len(corners)]]
            sides.append([self.add_edge(a, b, centre) for a, b in pairwise(ends)])
        self.rims.append(sides)
        return numbers

    def rim_edges(self, rim: int) -> list[int]:
        """The edges of a rim in order."""
        return [edge for side in self.rims[rim] for edge in side]


def forward_wire(edges: Sequence[int]) -> Wire:
    """A wire along the edges."""
    return [DirectedEdge(edge, True) for edge in edges]


def backward_wire(edges: Sequence[int]) -> Wire:
    """A wire from the last edge's end back to the first edge's start."""
    return [DirectedEdge(edge, False) for edge in reversed(edges)]


def untiled_faces(outer: Loop, holes: Sequence[Loop]) -> PlanarFaces:
    """One face with few holes; the rims are those of the outer loop, then of the holes."""
    plane = PlanarFaces()
    for loop in (outer, *holes):
        plane.add_rim(loop)
    wires = [
        forward_wire(plane.rim_edges(0)),
        *(backward_wire(plane.rim_edges(i + 1)) for i in range(len(holes))),
    ]
    plane.faces.append(wires)
    return plane


def reversed_wire(wire: Wire) -> Wire:
    """The same edges in the opposite direction."""
    return [DirectedEdge(directed.edge, not directed.forward) for directed in reversed(wire)]
