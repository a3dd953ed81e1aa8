"""A flat face with many holes, divided into small faces (tiles).

The kernel's time to check, write and read a face grows with the square of the number of holes; tiles make the time
linear. Horizontal lines cut the face into strips, and short vertical cuts (uprights) cut every strip into tiles of a
few holes. A horizontal line that meets a hole ends at the hole's rim. An upright keeps clear of every hole.

    +---------------------------+        the outer face: the area around the box of the tiles
    |  +--------+-------+----+  |
    |  | /\\  /\\ |/\\   /\\|/\\  |  |        strips of tiles, their holes inside
    |  +---+----++------+----+  |
    |  |/\\ | /\\  | /\\  /\\ |/\\ |  |
    |  +---+-----+-------+---+  |
    +---------------------------+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mold.solids.loops import Loop, Points, bounding_boxes, rounded_rectangle
from cmpdesign.products.mold.solids.planar_faces import (
    DirectedEdge,
    PlanarFaces,
    Point,
    RimCut,
    Wire,
    backward_wire,
    forward_wire,
    reversed_wire,
    untiled_faces,
)

HOLES_PER_TILE = 4
# Distance of lines from every corner of a hole, so that no edge is shorter.
CORNER_CLEARANCE_MM = 1e-4


def tile_faces(outer: Loop, holes: Sequence[Loop], features: Sequence[Loop], margin_mm: float) -> PlanarFaces:
    """Divide a face with few holes and many features into tiles.

    Args:
        outer: outline of the face; without holes the outline must be a convex polygon.
        holes: holes outside the bounding box of the features.
        features: small convex outlines that keep clear of each other.
        margin_mm: with holes: distance from the features' bounding box to the border of the tiles; the margin must be
            free of holes.

    Returns:
        The plane; its rims are those of the outer loop, the holes and the features, in this order.
    """
    if not features:
        return untiled_faces(outer, holes)
    boxes = bounding_boxes(features)
    plane = PlanarFaces()
    if not holes:
        Tiler(plane, outer, features, boxes).add_tiles()
        return plane
    for loop in (outer, *holes):
        plane.add_rim(loop)
    low, high = boxes[:, 0].min(axis=0) - margin_mm, boxes[:, 1].max(axis=0) + margin_mm
    ring = Tiler(plane, rounded_rectangle(low, high, 0.0), features, boxes).add_tiles()
    # The box is not an outline of the solid and has no walls.
    box_rim = plane.rims.pop(1 + len(holes))
    assert [edge for side in box_rim for edge in side] == ring
    wires = [
        forward_wire(plane.rim_edges(0)),
        *(backward_wire(plane.rim_edges(i + 1)) for i in range(len(holes))),
    ]
    plane.faces.append([*wires, backward_wire(ring)])
    return plane


def choose_strip_lines(frame: Loop, features: Sequence[Loop], boxes: Points) -> list[float]:
    """Heights of the lines from below; each line lies where it cuts the fewest features."""
    tallest = float((boxes[:, 1, 1] - boxes[:, 0, 1]).max())
    bottom, top = float(boxes[:, 0, 1].min()), float(boxes[:, 1, 1].max())
    corners = [frame.points[:, 1], boxes[:, :, 1].ravel(), *(loop.points[:, 1] for loop in features)]
    events = np.unique(np.round(np.concatenate(corners), 9))
    gaps = np.diff(events)
    wide = gaps > 2 * CORNER_CLEARANCE_MM
    candidates, width = (events[:-1] + gaps / 2)[wide], gaps[wide]
    straight = ~_crosses_one_arc(candidates, features, boxes)
    candidates, width = candidates[straight], width[straight]
    starts, ends = np.sort(boxes[:, 0, 1]), np.sort(boxes[:, 1, 1])
    cut = np.searchsorted(starts, candidates) - np.searchsorted(ends, candidates)
    lines: list[float] = []
    last = bottom
    while True:
        # The distance exceeds the height of every feature, so that no feature is cut twice.
        eligible = (candidates > last + 1.05 * tallest) & (candidates < last + 2.6 * tallest)
        eligible &= candidates < top - 0.5 * tallest
        if not eligible.any():
            return lines
        last = float(candidates[eligible][np.lexsort((-width[eligible], cut[eligible]))[0]])
        lines.append(last)


def _crosses_one_arc(heights: Points, features: Sequence[Loop], boxes: Points) -> NDArray[np.bool_]:
    """(N,) which heights lie between the highest (lowest) corner of a feature and the top of the arc beyond it.

    A line there would cross one arc twice.
    """
    top = np.array([loop.points[:, 1].max() for loop in features])
    bottom = np.array([loop.points[:, 1].min() for loop in features])
    inside = np.zeros(len(heights), dtype=np.int64)
    for start, end in ((top, boxes[:, 1, 1]), (boxes[:, 0, 1], bottom)):
        inside += np.searchsorted(np.sort(start), heights) - np.searchsorted(np.sort(end), heights)
    return inside > 0


@dataclass
class _FeatureCut:
    """A feature cut by a line.

    Attributes:
        left, right: x of the two crossings, mm.
        left_point, right_point: numbers of the points of the crossings.
        below, above: edges of the feature's rim below and above the line.
    """

    left: float
    right: float
    left_point: int
    right_point: int
    below: list[int]
    above: list[int]


class _FramePoints(NamedTuple):
    """Numbers of the points that split the frame.

    Attributes:
        line_ends: left and right end of each line.
        feet, heads: lower ends of the first strip's uprights, and upper ends of the last strip's uprights.
    """

    line_ends: list[tuple[int, int]]
    feet: list[int]
    heads: list[int]


class Tiler:
    """Builds the tiles of one plane inside a frame, a convex polygon.

    Strip s lies between line s - 1 and line s; the first and the last strip end at the frame.
    """

    def __init__(self, plane: PlanarFaces, frame: Loop, features: Sequence[Loop], boxes: Points) -> None:
        self.plane, self.frame, self.features, self.boxes = plane, frame, features, boxes
        self.lines = choose_strip_lines(frame, features, boxes)
        # Per feature: the strip that holds its lower end, and the line that cuts it or -1.
        self.strip = np.searchsorted(self.lines, boxes[:, 0, 1])
        self.cut_by = np.where(np.searchsorted(self.lines, boxes[:, 1, 1]) > self.strip, self.strip, -1)
        self.uprights = [self._upright_places(strip) for strip in range(len(self.lines) + 1)]

    def add_tiles(self) -> list[int]:
        """Add the frame's rim, the features' rims and all tiles; the frame's edges, counter-clockwise."""
        frame_points = self._add_frame_rim()
        self._frame_edges = self.plane.rim_edges(len(self.plane.rims) - 1)
        self._at_frame = {
            self.plane.edges[edge].start: number for number, edge in enumerate(self._frame_edges)
        }
        self._first_rim = len(self.plane.rims)
        cuts = self._add_feature_rims()
        self._strip_lines = [
            _StripLine(
                self.plane, y, ends, [*self.uprights[line], *self.uprights[line + 1]], cuts.get(line, [])
            )
            for line, (y, ends) in enumerate(zip(self.lines, frame_points.line_ends, strict=True))
        ]
        for strip in range(len(self.lines) + 1):
            self._add_strip_tiles(strip, frame_points)
        return self._frame_edges

    def _add_frame_rim(self) -> _FramePoints:
        """Add the frame, split at the ends of lines and of the uprights in the first and the last strip."""
        cuts: list[RimCut] = []
        for y in self.lines:
            right, left = line_crossings(self.frame, y)
            cuts += [left, right]
        transposed = Loop(self.frame.points[:, ::-1], self.frame.centres)
        for strip, at_foot in ((0, True), (len(self.lines), False)):
            for x in self.uprights[strip]:
                # With x and y exchanged, the side along which x grows is the lower side.
                lower, upper = line_crossings(transposed, x)
                crossing = lower if at_foot else upper
                cuts.append(RimCut(crossing.side, (x, crossing.place[0])))
        numbers = self.plane.add_rim(self.frame, cuts)
        feet_from = 2 * len(self.lines)
        heads_from = feet_from + len(self.uprights[0])
        ends = list(zip(numbers[0:feet_from:2], numbers[1:feet_from:2], strict=True))
        return _FramePoints(ends, numbers[feet_from:heads_from], numbers[heads_from:])

    def _add_feature_rims(self) -> dict[int, list[_FeatureCut]]:
        """Add the rims of all features; the cut features by line."""
        cuts: dict[int, list[_FeatureCut]] = {}
        for number, loop in enumerate(self.features):
            line = int(self.cut_by[number])
            if line < 0:
                self.plane.add_rim(loop)
                continue
            right, left = line_crossings(loop, self.lines[line])
            right_point, left_point = self.plane.add_rim(loop, [right, left])
            edges = self.plane.rim_edges(self._first_rim + number)
            starts = [self.plane.edges[edge].start for edge in edges]
            at_right, at_left = starts.index(right_point), starts.index(left_point)
            from_right = edges[at_right:] + edges[:at_right]
            count = (at_left - at_right) % len(edges)
            cut = _FeatureCut(
                left=left.place[0],
                right=right.place[0],
                left_point=left_point,
                right_point=right_point,
                below=from_right[count:],
                above=from_right[:count],
            )
            cuts.setdefault(line, []).append(cut)
        return cuts

    def _upright_places(self, strip: int) -> list[float]:
        """x of the uprights of a strip: after every few features, in gaps between features."""
        members = np.flatnonzero((self.strip == strip) | (self.cut_by == strip - 1) & (strip > 0))
        reach = self.boxes[members][:, :, 0]
        reach = reach[np.argsort(reach[:, 0], kind="stable")]
        low, high = self._line_reach(strip)
        places, count, end = [], 0, -np.inf
        for left, right in reach.tolist():
            if count >= HOLES_PER_TILE and left - end > 4 * CORNER_CLEARANCE_MM:
                place = self._clear_of_corners(end, left)
                if low < place < high:
                    places.append(place)
                    count = 0
            count += 1
            end = max(end, right)
        return places

    def _line_reach(self, strip: int) -> tuple[float, float]:
        """x between which an upright meets the lines of a strip; a slanted frame makes them shorter than the strip."""
        low, high = -np.inf, np.inf
        for y in self.lines[max(strip - 1, 0) : strip + 1]:
            right, left = line_crossings(self.frame, y)
            low = max(low, left.place[0] + CORNER_CLEARANCE_MM)
            high = min(high, right.place[0] - CORNER_CLEARANCE_MM)
        return low, high

    def _clear_of_corners(self, left: float, right: float) -> float:
        """The middle of an interval in x, or its first third if the middle is at a corner of the frame."""
        middle = (left + right) / 2
        at_corner = np.abs(self.frame.points[:, 0] - middle).min() < CORNER_CLEARANCE_MM / 2
        return left + (right - left) / 3 if at_corner else middle

    def _add_strip_tiles(self, strip: int, frame_points: _FramePoints) -> None:
        lower = self._strip_lines[strip - 1] if strip > 0 else None
        upper = self._strip_lines[strip] if strip < len(self.lines) else None
        uprights = self.uprights[strip]
        upright_edges = []
        for number, x in enumerate(uprights):
            foot = frame_points.feet[number] if lower is None else lower.point_at(x)
            head = frame_points.heads[number] if upper is None else upper.point_at(x)
            upright_edges.append(self.plane.add_edge(foot, head))
        inside = np.flatnonzero((self.strip == strip) & (self.cut_by < 0))
        tile_of = np.searchsorted(uprights, self.boxes[inside][:, 0, 0])
        holes: list[list[Wire]] = [[] for _ in range(len(upright_edges) + 1)]
        for number, tile in zip(inside.tolist(), tile_of.tolist(), strict=True):
            holes[tile].append(backward_wire(self.plane.rim_edges(self._first_rim + number)))
        places = [-np.inf, *uprights, np.inf]
        for tile, (left, right) in enumerate(pairwise(places)):
            legs = [
                lower.path(left, right, above=True) if lower else [],
                forward_wire(upright_edges[tile : tile + 1]),
                reversed_wire(upper.path(left, right, above=False)) if upper else [],
                backward_wire(upright_edges[max(tile - 1, 0) : tile]),
            ]
            self.plane.faces.append([self._closed_wire([leg for leg in legs if leg]), *holes[tile]])

    def _closed_wire(self, legs: list[Wire]) -> Wire:
        """The legs in order, joined along the frame where a leg does not start at the end of the leg before."""
        if not legs:
            return forward_wire(self._frame_edges)
        wire: Wire = []
        for leg, after in zip(legs, [*legs[1:], legs[0]], strict=True):
            wire += leg
            end, start = self._end_point(leg[-1]), self._start_point(after[0])
            if end != start:
                wire += self._along_frame(end, start)
        return wire

    def _start_point(self, directed: DirectedEdge) -> int:
        edge = self.plane.edges[directed.edge]
        return edge.start if directed.forward else edge.end

    def _end_point(self, directed: DirectedEdge) -> int:
        edge = self.plane.edges[directed.edge]
        return edge.end if directed.forward else edge.start

    def _along_frame(self, start: int, end: int) -> Wire:
        """The edges from one point of the frame to another, counter-clockwise."""
        first, last = self._at_frame[start], self._at_frame[end]
        if last <= first:
            return forward_wire(self._frame_edges[first:] + self._frame_edges[:last])
        return forward_wire(self._frame_edges[first:last])


class _StripLine:
    """A horizontal line: edges between the features that it cuts, with points at the ends of uprights."""

    def __init__(
        self,
        plane: PlanarFaces,
        y: float,
        ends: tuple[int, int],
        uprights: list[float],
        cuts: list[_FeatureCut],
    ) -> None:
        nodes: list[tuple[float, int, _FeatureCut | None]] = [
            (x, plane.add_point(x, y), None) for x in sorted(set(uprights))
        ]
        self._point = {x: point for x, point, _ in nodes}
        nodes += [(cut.left, cut.left_point, cut) for cut in cuts]
        nodes.append((plane.points[ends[1]][0], ends[1], None))
        nodes.sort(key=lambda node: node[0])
        # From the left: x of the start, and a straight edge or a cut feature.
        self._spans: list[tuple[float, int | _FeatureCut]] = []
        last_x, last = plane.points[ends[0]][0], ends[0]
        for x, point, cut in nodes:
            self._spans.append((last_x, plane.add_edge(last, point)))
            last_x, last = x, point
            if cut is not None:
                self._spans.append((x, cut))
                last_x, last = cut.right, cut.right_point

    def point_at(self, x: float) -> int:
        """The number of the point at the end of the upright at x."""
        return self._point[x]

    def path(self, left: float, right: float, above: bool) -> Wire:
        """The wire from left to right along the line, and above or below the cut features."""
        wire: Wire = []
        for x, span in self._spans:
            if not left <= x < right:
                continue
            if isinstance(span, int):
                wire.append(DirectedEdge(span, True))
            else:
                wire += backward_wire(span.above) if above else forward_wire(span.below)
        return wire


def line_crossings(loop: Loop, y: float) -> tuple[RimCut, RimCut]:
    """The crossings of a convex loop with a horizontal line: of the side that goes up (right), then down (left)."""
    heights = loop.points[:, 1]
    after = np.roll(heights, -1)
    up = int(np.flatnonzero((heights < y) & (after > y))[0])
    down = int(np.flatnonzero((heights > y) & (after < y))[0])
    return RimCut(up, _side_crossing(loop, up, y)), RimCut(down, _side_crossing(loop, down, y))


def _side_crossing(loop: Loop, side: int, y: float) -> Point:
    """The point of a side at height y."""
    start, end = loop.points[side], loop.points[(side + 1) % len(loop.points)]
    centre = loop.centres[side]
    if np.isnan(centre[0]):
        share = (y - start[1]) / (end[1] - start[1])
        return float(start[0] + share * (end[0] - start[0])), y
    radius, rise = np.hypot(*(start - centre)), y - centre[1]
    reach = np.sqrt(radius**2 - rise**2)
    return float(centre[0] + (reach if end[1] > start[1] else -reach)), y
