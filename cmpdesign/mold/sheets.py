"""A flat face with many holes, divided into small faces: tiles, so that every later step stays linear.

A kernel checks, writes and reads a face in a time that grows with the square of its holes. So the face is cut
by horizontal lines into strips, and every strip by short vertical cuts into tiles of a few holes. A horizontal
line may run through holes: it then ends at their rims. A vertical cut keeps clear of every hole.

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

import numpy as np

from cmpdesign.mold.loops import Loop, Points

HOLES_PER_TILE = 4
# Lines keep this distance from every corner of a hole, so that no edge is shorter.
CLEAR_MM = 1e-4

Point = tuple[float, float]
# An edge and whether it is run along its own direction.
Step = tuple[int, bool]
Wire = list[Step]


@dataclass
class Sheet:
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
        """A loop's edges, split at ``cuts`` (side, place; at most one a side); the cuts' point numbers."""
        at = {side: self.point(*place) for side, place in cuts}
        corners = [self.point(x, y) for x, y in loop.points.tolist()]
        centres = loop.centres.tolist()
        sides = []
        for side, start in enumerate(corners):
            centre = None if centres[side][0] != centres[side][0] else (centres[side][0], centres[side][1])
            ends = [start, *([at[side]] if side in at else []), corners[(side + 1) % len(corners)]]
            sides.append([self.edge(a, b, centre) for a, b in zip(ends, ends[1:], strict=False)])
        self.rims.append(sides)
        return [at[side] for side, _ in cuts]

    def around(self, rim: int) -> list[int]:
        """A rim's edges in order."""
        return [edge for side in self.rims[rim] for edge in side]


def forward(edges: Sequence[int]) -> Wire:
    return [(edge, True) for edge in edges]


def backward(edges: Sequence[int]) -> Wire:
    return [(edge, False) for edge in reversed(edges)]


def plain_sheet(outer: Loop, holes: Sequence[Loop]) -> Sheet:
    """One face with few holes; the rims are the outer loop's, then the holes'."""
    sheet = Sheet()
    for loop in (outer, *holes):
        sheet.add_rim(loop)
    wires = [forward(sheet.around(0)), *(backward(sheet.around(i + 1)) for i in range(len(holes)))]
    sheet.faces.append(wires)
    return sheet


def tiled_sheet(outer: Loop, holes: Sequence[Loop], features: Sequence[Loop], margin_mm: float) -> Sheet:
    """A face with few holes and many features (small convex holes that keep clear of each other).

    Args:
        outer: the sheet's outline.
        holes: holes outside the box of the features.
        features: the many; each lower and narrower than a strip.
        margin_mm: from the features' box to the tiles' outer border; nothing else may lie in it.

    Returns:
        A sheet whose rims are the outer loop's, the holes' and the features', in this order.
    """
    if not features:
        return plain_sheet(outer, holes)
    boxes = np.array([loop.box() for loop in features])
    low, high = boxes[:, 0].min(axis=0) - margin_mm, boxes[:, 1].max(axis=0) + margin_mm
    lines = strip_lines(features, boxes, float(low[1]), float(high[1]))
    sheet = Sheet()
    for loop in (outer, *holes):
        sheet.add_rim(loop)
    tiler = _Tiler(sheet, features, boxes, (float(low[0]), float(high[0])), lines)
    ring = tiler.tile()
    wires = [forward(sheet.around(0)), *(backward(sheet.around(i + 1)) for i in range(len(holes)))]
    sheet.faces.append([*wires, ring])
    return sheet


def strip_lines(features: Sequence[Loop], boxes: Points, bottom: float, top: float) -> list[float]:
    """Heights of the strips' borders, from bottom to top, each where the fewest features are cut."""
    tallest = float((boxes[:, 1, 1] - boxes[:, 0, 1]).max())
    heights = np.unique(np.round(np.concatenate([loop.points[:, 1] for loop in features]), 9))
    extremes = np.unique(np.round(boxes[:, :, 1], 9))
    events = np.unique(np.concatenate([heights, extremes]))
    gaps = np.diff(events)
    candidates = (events[:-1] + gaps / 2)[gaps > 2 * CLEAR_MM]
    starts, ends = np.sort(boxes[:, 0, 1]), np.sort(boxes[:, 1, 1])
    cut = np.searchsorted(starts, candidates) - np.searchsorted(ends, candidates)
    width = gaps[gaps > 2 * CLEAR_MM]
    lines = [bottom]
    while True:
        # Taller than any feature, so that none is cut twice.
        near = (candidates > lines[-1] + 1.05 * tallest) & (candidates < lines[-1] + 2.6 * tallest)
        near &= candidates < top - 1.05 * tallest
        if not near.any():
            return [*lines, top]
        choice = np.lexsort((-width[near], cut[near]))[0]
        lines.append(float(candidates[near][choice]))


@dataclass
class _Cut:
    """A feature cut by a line: its number, the two points on its rim, and its edges below and above."""

    left: float
    right: float
    left_point: int
    right_point: int
    below: list[int]
    above: list[int]


class _Tiler:
    """Builds the tiles of one sheet, strip by strip, from the bottom."""

    def __init__(
        self,
        sheet: Sheet,
        features: Sequence[Loop],
        boxes: Points,
        sides: tuple[float, float],
        lines: list[float],
    ) -> None:
        self.sheet, self.features, self.boxes, self.sides, self.lines = sheet, features, boxes, sides, lines
        # The number of the line that a feature is cut by, or -1, and the strip that holds its lower end.
        inner = np.array(lines[1:-1])
        self.strip = np.searchsorted(inner, boxes[:, 0, 1])
        self.cut_by = np.where(np.searchsorted(inner, boxes[:, 1, 1]) > self.strip, self.strip + 1, -1)
        self.first_rim = len(sheet.rims)

    def tile(self) -> Wire:
        """Add all tiles; the wire around them, clockwise, as the outer face's hole."""
        cuts = self._rims()
        strips = range(len(self.lines) - 1)
        uprights = [self._uprights(strip) for strip in strips]
        rails = []
        for line in range(len(self.lines)):
            ends = [x for strip in (line - 1, line) if strip in strips for x in uprights[strip]]
            rails.append(_Rail(self.sheet, self.lines[line], [*self.sides, *ends], cuts.get(line, [])))
        left, right = [], []
        for strip in strips:
            borders = self._strip(strip, uprights[strip], rails[strip], rails[strip + 1])
            left.append(borders[0])
            right.append(borders[1])
        outline = [*forward(rails[0].edges_all()), *forward(right)]
        outline += [*backward(rails[-1].edges_all()), *backward(left)]
        return [(edge, not along) for edge, along in reversed(outline)]

    def _rims(self) -> dict[int, list[_Cut]]:
        """Every feature's rim; the features that lines cut, by line."""
        cuts: dict[int, list[_Cut]] = {}
        for number, loop in enumerate(self.features):
            line = int(self.cut_by[number])
            if line < 0:
                self.sheet.add_rim(loop)
                continue
            (right_side, right), (left_side, left) = crossings(loop, self.lines[line])
            points = self.sheet.add_rim(loop, [(right_side, right), (left_side, left)])
            edges = self.sheet.around(self.first_rim + number)
            starts = [self.sheet.edges[edge][0] for edge in edges]
            at_right, at_left = starts.index(points[0]), starts.index(points[1])
            turned = edges[at_right:] + edges[:at_right]
            count = (at_left - at_right) % len(edges)
            above, below = turned[:count], turned[count:]
            cuts.setdefault(line, []).append(_Cut(left[0], right[0], points[1], points[0], below, above))
        return cuts

    def _uprights(self, strip: int) -> list[float]:
        """Where the strip is cut: between features, after every few of them, where none is in the way."""
        members = self._members(strip)
        reach = self.boxes[members][:, :, 0]
        reach = reach[np.argsort(reach[:, 0], kind="stable")]
        places, count, end = [], 0, self.sides[0]
        for left, right in reach.tolist():
            if count >= HOLES_PER_TILE and left - end > 2 * CLEAR_MM:
                places.append((left + end) / 2)
                count = 0
            count += 1
            end = max(end, right)
        return places

    def _members(self, strip: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Features that reach into a strip."""
        return np.flatnonzero((self.strip == strip) | (self.cut_by == strip))

    def _strip(self, strip: int, uprights: list[float], lower: _Rail, upper: _Rail) -> tuple[int, int]:
        places = [self.sides[0], *uprights, self.sides[1]]
        columns = [self.sheet.edge(lower.point_at(x), upper.point_at(x)) for x in places]
        inside = np.flatnonzero((self.strip == strip) & (self.cut_by < 0))
        tile_of = np.searchsorted(uprights, self.boxes[inside][:, 0, 0])
        holes: list[list[Wire]] = [[] for _ in columns[1:]]
        for number, tile in zip(inside.tolist(), tile_of.tolist(), strict=True):
            holes[tile].append(backward(self.sheet.around(self.first_rim + number)))
        for tile, (left, right) in enumerate(zip(places, places[1:], strict=False)):
            wire = [*lower.path(left, right, above=True), (columns[tile + 1], True)]
            back = upper.path(left, right, above=False)
            wire += [(edge, not along) for edge, along in reversed(back)]
            self.sheet.faces.append([[*wire, (columns[tile], False)], *holes[tile]])
        return columns[0], columns[-1]


class _Rail:
    """A horizontal line: edges between the features that it cuts, with points where uprights end."""

    def __init__(self, sheet: Sheet, y: float, ends: list[float], cuts: list[_Cut]) -> None:
        self.sheet = sheet
        nodes: list[tuple[float, int, _Cut | None]] = [(x, sheet.point(x, y), None) for x in sorted(set(ends))]
        nodes += [(cut.left, cut.left_point, cut) for cut in cuts]
        nodes.sort(key=lambda node: node[0])
        self._point = {x: point for x, point, _ in nodes}
        # (from x, straight edge or the cut feature), in order.
        self.spans: list[tuple[float, int | _Cut]] = []
        at_x, at = nodes[0][:2]
        for x, point, cut in nodes[1:]:
            self.spans.append((at_x, sheet.edge(at, point)))
            at_x, at = x, point
            if cut is not None:
                self.spans.append((x, cut))
                at_x, at = cut.right, cut.right_point

    def point_at(self, x: float) -> int:
        return self._point[x]

    def path(self, left: float, right: float, above: bool) -> Wire:
        """From left to right, along the line and around features on their upper or lower side."""
        wire: Wire = []
        for x, span in self.spans:
            if not left <= x < right:
                continue
            if isinstance(span, int):
                wire.append((span, True))
            else:
                wire += backward(span.above) if above else forward(span.below)
        return wire

    def edges_all(self) -> list[int]:
        """The edges of a line that cuts no feature."""
        return [span for _, span in self.spans if isinstance(span, int)]


def crossings(loop: Loop, y: float) -> tuple[tuple[int, Point], tuple[int, Point]]:
    """Where a convex loop crosses a horizontal line: (side, place) going up (its right), then going down."""
    heights = loop.points[:, 1]
    after = np.roll(heights, -1)
    up = int(np.flatnonzero((heights < y) & (after > y))[0])
    down = int(np.flatnonzero((heights > y) & (after < y))[0])
    return (up, _crossing(loop, up, y)), (down, _crossing(loop, down, y))


def _crossing(loop: Loop, side: int, y: float) -> Point:
    start, end = loop.points[side], loop.points[(side + 1) % len(loop.points)]
    centre = loop.centres[side]
    if np.isnan(centre[0]):
        share = (y - start[1]) / (end[1] - start[1])
        return float(start[0] + share * (end[0] - start[0])), y
    radius, rise = np.hypot(*(start - centre)), y - centre[1]
    reach = np.sqrt(radius**2 - rise**2)
    return float(centre[0] + (reach if end[1] > start[1] else -reach)), y
