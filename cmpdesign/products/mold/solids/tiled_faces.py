"""A flat face with many holes, divided into small faces: tiles, so that every later step stays linear.

A kernel checks, writes and reads a face in a time that grows with the square of its holes. So the face is cut
by horizontal lines into strips, and every strip by short vertical cuts (uprights) into tiles of a few holes.
A horizontal line may run through holes: it then ends at their rims. An upright keeps clear of every hole.

    +---------------------------+        the outer face: what lies around the box of the tiles
    |  +--------+-------+----+  |
    |  | /\\  /\\ |/\\   /\\|/\\  |  |        strips of tiles, their holes inside
    |  +---+----++------+----+  |
    |  |/\\ | /\\  | /\\  /\\ |/\\ |  |
    |  +---+-----+-------+---+  |
    +---------------------------+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from cmpdesign.products.mold.solids.loops import Loop, Points, bounding_boxes, rounded_rectangle

HOLES_PER_TILE = 4
# Lines keep this distance from every corner of a hole, so that no edge is shorter.
CORNER_CLEARANCE_MM = 1e-4

Point = tuple[float, float]
# An edge and whether it is run along its own direction.
DirectedEdge = tuple[int, bool]
Wire = list[DirectedEdge]


@dataclass
class PlanarFaces:
    """A plane's points, edges and faces.

    Attributes:
        points: places in the plane, mm.
        edges: (from point, to point, centre of the counter-clockwise arc or None).
        rims: for each loop given, for each of its sides, the edges that it came to, in its direction.
        faces: each a list of wires, the outer one first (counter-clockwise), then the holes (clockwise).
    """

    points: list[Point] = field(default_factory=list)
    edges: list[tuple[int, int, Point | None]] = field(default_factory=list)
    rims: list[list[list[int]]] = field(default_factory=list)
    faces: list[list[Wire]] = field(default_factory=list)

    def point(self, x: float, y: float) -> int:
        self.points.append((x, y))
        return len(self.points) - 1

    def edge(self, start: int, end: int, centre: Point | None = None) -> int:
        self.edges.append((start, end, centre))
        return len(self.edges) - 1

    def add_rim(self, loop: Loop, cuts: Sequence[tuple[int, Point]] = ()) -> list[int]:
        """A loop's edges, split at ``cuts`` (side, place; several on one side only if it is straight).

        Returns:
            The cuts' point numbers.
        """
        numbers = [self.point(*place) for _, place in cuts]
        corners = [self.point(x, y) for x, y in loop.points.tolist()]
        centres = loop.centres.tolist()
        on_side: dict[int, list[int]] = {}
        for (side, _), number in zip(cuts, numbers, strict=True):
            on_side.setdefault(side, []).append(number)
        sides = []
        for side, start in enumerate(corners):
            centre = None if centres[side][0] != centres[side][0] else (centres[side][0], centres[side][1])
            origin = np.array(self.points[start])
            between = on_side.get(side, [])
            between.sort(key=lambda number: float(np.hypot(*(np.array(self.points[number]) - origin))))
            ends = [start, *between, corners[(side + 1) % len(corners)]]
            sides.append([self.edge(a, b, centre) for a, b in pairwise(ends)])
        self.rims.append(sides)
        return numbers

    def around(self, rim: int) -> list[int]:
        """A rim's edges in order."""
        return [edge for side in self.rims[rim] for edge in side]


def forward_wire(edges: Sequence[int]) -> Wire:
    return [(edge, True) for edge in edges]


def backward_wire(edges: Sequence[int]) -> Wire:
    return [(edge, False) for edge in reversed(edges)]


def untiled_faces(outer: Loop, holes: Sequence[Loop]) -> PlanarFaces:
    """One face with few holes; the rims are the outer loop's, then the holes'."""
    sheet = PlanarFaces()
    for loop in (outer, *holes):
        sheet.add_rim(loop)
    wires = [forward_wire(sheet.around(0)), *(backward_wire(sheet.around(i + 1)) for i in range(len(holes)))]
    sheet.faces.append(wires)
    return sheet


def tile_faces(outer: Loop, holes: Sequence[Loop], features: Sequence[Loop], margin_mm: float) -> PlanarFaces:
    """A face with few holes and many features (small convex outlines that keep clear of each other).

    Args:
        outer: the sheet's outline; without holes it must be a convex polygon.
        holes: holes outside the box of the features.
        features: the many.
        margin_mm: with holes, from the features' box to the tiles' border; nothing else may lie in it.

    Returns:
        A sheet whose rims are the outer loop's, the holes' and the features', in this order.
    """
    if not features:
        return untiled_faces(outer, holes)
    boxes = bounding_boxes(features)
    sheet = PlanarFaces()
    if not holes:
        Tiler(sheet, outer, features, boxes).add_tiles()
        return sheet
    for loop in (outer, *holes):
        sheet.add_rim(loop)
    low, high = boxes[:, 0].min(axis=0) - margin_mm, boxes[:, 1].max(axis=0) + margin_mm
    ring = Tiler(sheet, rounded_rectangle(low, high, 0.0), features, boxes).add_tiles()
    # The box is no outline of the solid: nothing stands on it.
    box_rim = sheet.rims.pop(1 + len(holes))
    assert [edge for side in box_rim for edge in side] == ring
    wires = [forward_wire(sheet.around(0)), *(backward_wire(sheet.around(i + 1)) for i in range(len(holes)))]
    sheet.faces.append([*wires, backward_wire(ring)])
    return sheet


def choose_strip_lines(frame: Loop, features: Sequence[Loop], boxes: Points) -> list[float]:
    """Heights of the lines, from below, each where it cuts the fewest features near it."""
    tallest = float((boxes[:, 1, 1] - boxes[:, 0, 1]).max())
    bottom, top = float(boxes[:, 0, 1].min()), float(boxes[:, 1, 1].max())
    corners = [frame.points[:, 1], boxes[:, :, 1].ravel(), *(loop.points[:, 1] for loop in features)]
    events = np.unique(np.round(np.concatenate(corners), 9))
    gaps = np.diff(events)
    wide = gaps > 2 * CORNER_CLEARANCE_MM
    candidates, width = (events[:-1] + gaps / 2)[wide], gaps[wide]
    starts, ends = np.sort(boxes[:, 0, 1]), np.sort(boxes[:, 1, 1])
    cut = np.searchsorted(starts, candidates) - np.searchsorted(ends, candidates)
    lines: list[float] = []
    last = bottom
    while True:
        # Further apart than any feature is tall, so that none is cut twice.
        near = (candidates > last + 1.05 * tallest) & (candidates < last + 2.6 * tallest)
        near &= candidates < top - 0.5 * tallest
        if not near.any():
            return lines
        last = float(candidates[near][np.lexsort((-width[near], cut[near]))[0]])
        lines.append(last)


@dataclass
class _FeatureCut:
    """A feature cut by a line: where, the two points on its rim, and its edges below and above."""

    left: float
    right: float
    left_point: int
    right_point: int
    below: list[int]
    above: list[int]


class Tiler:
    """Builds the tiles of one sheet inside a frame, a convex polygon.

    Strip s lies between line s - 1 and line s; below the first line and above the last, it ends at the frame.
    """

    def __init__(self, sheet: PlanarFaces, frame: Loop, features: Sequence[Loop], boxes: Points) -> None:
        self.sheet, self.frame, self.features, self.boxes = sheet, frame, features, boxes
        self.lines = choose_strip_lines(frame, features, boxes)
        # The strip that holds a feature's lower end; the line that cuts it, or -1.
        self.strip = np.searchsorted(self.lines, boxes[:, 0, 1])
        self.cut_by = np.where(np.searchsorted(self.lines, boxes[:, 1, 1]) > self.strip, self.strip, -1)
        self.uprights = [self._uprights(strip) for strip in range(len(self.lines) + 1)]

    def add_tiles(self) -> list[int]:
        """Add the frame's rim, the features' rims and all tiles; the frame's edges, counter-clockwise."""
        line_ends, feet, heads = self._add_frame_rim()
        around = self.sheet.around(len(self.sheet.rims) - 1)
        self._frame_edges = around
        self._at_frame = {self.sheet.edges[edge][0]: number for number, edge in enumerate(around)}
        self._first_rim = len(self.sheet.rims)
        cuts = self._add_feature_rims()
        self._rails = [
            _StripLine(
                self.sheet, y, ends, [*self.uprights[line], *self.uprights[line + 1]], cuts.get(line, [])
            )
            for line, (y, ends) in enumerate(zip(self.lines, line_ends, strict=True))
        ]
        for strip in range(len(self.lines) + 1):
            self._add_strip_tiles(strip, feet, heads)
        return around

    def _add_frame_rim(self) -> tuple[list[tuple[int, int]], list[int], list[int]]:
        """The frame, split where lines and outer uprights end: (left, right) of lines, feet, heads."""
        cuts: list[tuple[int, Point]] = []
        for y in self.lines:
            right, left = line_crossings(self.frame, y)
            cuts += [left, right]
        turned = Loop(self.frame.points[:, ::-1], self.frame.centres)
        for strip, down in ((0, True), (len(self.lines), False)):
            for x in self.uprights[strip]:
                # With x and y exchanged, the side along which x grows is the lower one.
                lower, upper = line_crossings(turned, x)
                side, (y, _) = lower if down else upper
                cuts.append((side, (x, y)))
        numbers = self.sheet.add_rim(self.frame, cuts)
        ends = list(
            zip(numbers[0 : 2 * len(self.lines) : 2], numbers[1 : 2 * len(self.lines) : 2], strict=True)
        )
        feet_from = 2 * len(self.lines)
        heads_from = feet_from + len(self.uprights[0])
        return ends, numbers[feet_from:heads_from], numbers[heads_from:]

    def _add_feature_rims(self) -> dict[int, list[_FeatureCut]]:
        """Every feature's rim; the features that lines cut, by line."""
        cuts: dict[int, list[_FeatureCut]] = {}
        for number, loop in enumerate(self.features):
            line = int(self.cut_by[number])
            if line < 0:
                self.sheet.add_rim(loop)
                continue
            right, left = line_crossings(loop, self.lines[line])
            right_point, left_point = self.sheet.add_rim(loop, [right, left])
            edges = self.sheet.around(self._first_rim + number)
            starts = [self.sheet.edges[edge][0] for edge in edges]
            at_right, at_left = starts.index(right_point), starts.index(left_point)
            turned = edges[at_right:] + edges[:at_right]
            count = (at_left - at_right) % len(edges)
            cut = _FeatureCut(
                left[1][0], right[1][0], left_point, right_point, turned[count:], turned[:count]
            )
            cuts.setdefault(line, []).append(cut)
        return cuts

    def _uprights(self, strip: int) -> list[float]:
        """Where the strip is cut: after every few features, where none is in the way."""
        members = np.flatnonzero((self.strip == strip) | (self.cut_by == strip - 1) & (strip > 0))
        reach = self.boxes[members][:, :, 0]
        reach = reach[np.argsort(reach[:, 0], kind="stable")]
        places, count, end = [], 0, -np.inf
        for left, right in reach.tolist():
            if count >= HOLES_PER_TILE and left - end > 4 * CORNER_CLEARANCE_MM:
                places.append(self._clear_of_corners(end, left))
                count = 0
            count += 1
            end = max(end, right)
        return places

    def _clear_of_corners(self, left: float, right: float) -> float:
        """The middle, or a third where a corner of the frame lies above or below the middle."""
        middle = (left + right) / 2
        taken = np.abs(self.frame.points[:, 0] - middle).min() < CORNER_CLEARANCE_MM / 2
        return left + (right - left) / 3 if taken else middle

    def _add_strip_tiles(self, strip: int, feet: list[int], heads: list[int]) -> None:
        lower = self._rails[strip - 1] if strip > 0 else None
        upper = self._rails[strip] if strip < len(self.lines) else None
        uprights = self.uprights[strip]
        columns = []
        for number, x in enumerate(uprights):
            foot = feet[number] if lower is None else lower.point_at(x)
            head = heads[number] if upper is None else upper.point_at(x)
            columns.append(self.sheet.edge(foot, head))
        inside = np.flatnonzero((self.strip == strip) & (self.cut_by < 0))
        tile_of = np.searchsorted(uprights, self.boxes[inside][:, 0, 0])
        holes: list[list[Wire]] = [[] for _ in range(len(columns) + 1)]
        for number, tile in zip(inside.tolist(), tile_of.tolist(), strict=True):
            holes[tile].append(backward_wire(self.sheet.around(self._first_rim + number)))
        places = [-np.inf, *uprights, np.inf]
        for tile, (left, right) in enumerate(pairwise(places)):
            legs = [
                lower.path(left, right, above=True) if lower else [],
                forward_wire(columns[tile : tile + 1]),
                reversed_wire(upper.path(left, right, above=False)) if upper else [],
                backward_wire(columns[max(tile - 1, 0) : tile]),
            ]
            self.sheet.faces.append([self._closed([leg for leg in legs if leg]), *holes[tile]])

    def _closed(self, legs: list[Wire]) -> Wire:
        """The legs in order, joined along the frame where one does not start at the other's end."""
        if not legs:
            return forward_wire(self._frame_edges)
        wire: Wire = []
        for leg, after in zip(legs, [*legs[1:], legs[0]], strict=True):
            wire += leg
            end, start = self._end(leg[-1]), self._end(after[0], first=True)
            if end != start:
                wire += self._along_frame(end, start)
        return wire

    def _end(self, step: DirectedEdge, first: bool = False) -> int:
        edge, along = step
        start, end, _ = self.sheet.edges[edge]
        return start if along == first else end

    def _along_frame(self, start: int, end: int) -> Wire:
        """The frame's edges from one of its points to another, counter-clockwise."""
        first, last = self._at_frame[start], self._at_frame[end]
        if last <= first:
            return forward_wire(self._frame_edges[first:] + self._frame_edges[:last])
        return forward_wire(self._frame_edges[first:last])


class _StripLine:
    """A horizontal line: edges between the features that it cuts, with points where uprights end."""

    def __init__(
        self,
        sheet: PlanarFaces,
        y: float,
        ends: tuple[int, int],
        uprights: list[float],
        cuts: list[_FeatureCut],
    ) -> None:
        nodes: list[tuple[float, int, _FeatureCut | None]] = [
            (x, sheet.point(x, y), None) for x in sorted(set(uprights))
        ]
        self._point = {x: point for x, point, _ in nodes}
        nodes += [(cut.left, cut.left_point, cut) for cut in cuts]
        nodes.append((sheet.points[ends[1]][0], ends[1], None))
        nodes.sort(key=lambda node: node[0])
        # (where it starts, a straight edge or the feature in the way), from the left.
        self._spans: list[tuple[float, int | _FeatureCut]] = []
        at_x, at = sheet.points[ends[0]][0], ends[0]
        for x, point, cut in nodes:
            self._spans.append((at_x, sheet.edge(at, point)))
            at_x, at = x, point
            if cut is not None:
                self._spans.append((x, cut))
                at_x, at = cut.right, cut.right_point

    def point_at(self, x: float) -> int:
        return self._point[x]

    def path(self, left: float, right: float, above: bool) -> Wire:
        """From left to right, along the line and around features on their upper or lower side."""
        wire: Wire = []
        for x, span in self._spans:
            if not left <= x < right:
                continue
            if isinstance(span, int):
                wire.append((span, True))
            else:
                wire += backward_wire(span.above) if above else forward_wire(span.below)
        return wire


def reversed_wire(wire: Wire) -> Wire:
    """The same edges from the other end."""
    return [(edge, not along) for edge, along in reversed(wire)]


def line_crossings(loop: Loop, y: float) -> tuple[tuple[int, Point], tuple[int, Point]]:
    """Where a convex loop crosses a horizontal line: (side, place) going up (its right), then going down."""
    heights = loop.points[:, 1]
    after = np.roll(heights, -1)
    up = int(np.flatnonzero((heights < y) & (after > y))[0])
    down = int(np.flatnonzero((heights > y) & (after < y))[0])
    return (up, _side_crossing(loop, up, y)), (down, _side_crossing(loop, down, y))


def _side_crossing(loop: Loop, side: int, y: float) -> Point:
    start, end = loop.points[side], loop.points[(side + 1) % len(loop.points)]
    centre = loop.centres[side]
    if np.isnan(centre[0]):
        share = (y - start[1]) / (end[1] - start[1])
        return float(start[0] + share * (end[0] - start[0])), y
    radius, rise = np.hypot(*(start - centre)), y - centre[1]
    reach = np.sqrt(radius**2 - rise**2)
    return float(centre[0] + (reach if end[1] > start[1] else -reach)), y
