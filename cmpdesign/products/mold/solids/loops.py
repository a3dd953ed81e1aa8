"""Closed outlines of straight sides and circular arcs, which bound every face of a mold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


# Angle of a chord in triangle meshes: FINE_DEG for arcs of at least this radius, COARSE_DEG for smaller ones.
FINE_RADIUS_MM, FINE_DEG, COARSE_DEG = 0.25, 7.5, 40.0


class Arc(NamedTuple):
    """A counter-clockwise arc: radius in mm, first angle and positive sweep in rad."""

    radius_mm: float
    first: float
    sweep: float


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed outline, counter-clockwise.

    Attributes:
        points: (m, 2) mm; side i goes from point i to point i + 1.
        centres: (m, 2) mm; side i is the counter-clockwise arc around centre i, or straight if centre i is NaN.
    """

    points: Points
    centres: Points

    def offset(self, offset_mm: float) -> Loop:
        """The outline ``offset_mm`` further out: straight sides shift, arcs grow around the same centres.

        A corner of two straight sides stays sharp (a mitre).
        """
        return Loop(self.points + offset_mm * self._corner_offsets(), self.centres)

    def offset_sides(self, offsets_mm: NDArray[np.float64]) -> Loop:
        """The polygon with side i moved outward by ``offsets_mm[i]``; all sides must be straight."""
        return polygon_loop(inset_corners(self.points[None], -offsets_mm[None])[0])

    def _corner_offsets(self) -> Points:
        """(m, 2) the shift of each point when every side moves outward by one."""
        side = np.roll(self.points, -1, axis=0) - self.points
        normal = np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
        curved = ~np.isnan(self.centres[:, 0])
        start, end = normal.copy(), normal.copy()
        centre = self.centres[curved]
        start[curved] = _unit_vectors(self.points[curved] - centre)
        end[curved] = _unit_vectors(np.roll(self.points, -1, axis=0)[curved] - centre)
        before = np.roll(end, 1, axis=0)
        offsets: Points = (before + start) / (1 + (before * start).sum(axis=1))[:, None]
        return offsets

    def area_mm2(self) -> float:
        """The enclosed area, exact also for arcs."""
        return float(_areas_mm2(self.points[None], self.centres[None])[0])

    def arc(self, side: int) -> Arc:
        """The arc of a curved side."""
        first = self.points[side] - self.centres[side]
        last = self.points[(side + 1) % len(self.points)] - self.centres[side]
        angle = float(np.arctan2(first[1], first[0]))
        sweep = float(np.arctan2(first[0] * last[1] - first[1] * last[0], first @ last)) % (2 * np.pi)
        return Arc(float(np.hypot(*first)), angle, sweep)

    def shifted(self, x_mm: float, y_mm: float) -> Loop:
        """The outline after a translation."""
        shift = np.array([x_mm, y_mm])
        return Loop(self.points + shift, self.centres + shift)

    def with_chords(self, radius_mm: float | None = None, chord_deg: float | None = None) -> Loop:
        """The outline with arcs replaced by chords of at most ``FINE_DEG`` or, for small radii, ``COARSE_DEG``.

        ``radius_mm`` replaces each arc's own radius in this choice, so that paired outlines get paired chords.
        ``chord_deg`` replaces the choice.
        """
        points = []
        for side, point in enumerate(self.points):
            points.append(point)
            if np.isnan(self.centres[side, 0]):
                continue
            arc = self.arc(side)
            fine = (radius_mm or arc.radius_mm) >= FINE_RADIUS_MM
            largest = chord_deg or (FINE_DEG if fine else COARSE_DEG)
            count = max(1, int(np.ceil(np.degrees(arc.sweep) / largest - 1e-6)))
            angles = arc.first + arc.sweep * np.arange(1, count) / count
            directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
            points += list(self.centres[side] + arc.radius_mm * directions)
        return polygon_loop(np.array(points))


def chorded_pair(first: Loop, second: Loop) -> tuple[Loop, Loop]:
    """Two paired outlines with the same number of chords."""
    curved = np.flatnonzero(~np.isnan(first.centres[:, 0]))
    radius = max((first.arc(int(side)).radius_mm for side in curved), default=1.0)
    return first.with_chords(radius), second.with_chords(radius)


def _unit_vectors(vectors: Points) -> Points:
    unit: Points = vectors / np.hypot(*vectors.T)[:, None]
    return unit


def polygon_loop(points: Points) -> Loop:
    """A loop of straight sides through (m, 2) points."""
    return Loop(np.asarray(points, dtype=np.float64), np.full((len(points), 2), np.nan))


def circle_loop(centre: Points, diameter_mm: float) -> Loop:
    """A circle of two half arcs; centre: (2,) mm."""
    centre = np.asarray(centre, dtype=np.float64)
    reach = np.array([diameter_mm / 2, 0.0])
    return Loop(np.stack([centre + reach, centre - reach]), np.stack([centre, centre]))


def rounded_polygon(corners: Points, radius_mm: float) -> Loop:
    """A convex polygon (counter-clockwise) whose corners are arcs of the given radius; sharp at radius 0.

    The arcs touch the polygon's sides from inside, as after a cutter of this radius.
    """
    if radius_mm == 0:
        return polygon_loop(corners)
    core = polygon_loop(corners).offset(-radius_mm).points
    side = np.roll(corners, -1, axis=0) - corners
    normal = radius_mm * np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
    points = np.stack([core + np.roll(normal, 1, axis=0), core + normal], axis=1).reshape(-1, 2)
    centres = np.stack([core, np.full_like(core, np.nan)], axis=1).reshape(-1, 2)
    return Loop(points, centres)


def rounded_offset(corners: Points, offset_mm: float) -> Loop:
    """The points within ``offset_mm`` of a convex polygon: its corners become arcs around themselves."""
    side = np.roll(corners, -1, axis=0) - corners
    normal = offset_mm * np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
    points = np.stack([corners + np.roll(normal, 1, axis=0), corners + normal], axis=1).reshape(-1, 2)
    centres = np.stack([corners, np.full_like(corners, np.nan)], axis=1).reshape(-1, 2)
    return Loop(points, centres)


def rounded_rectangle(low: Points, high: Points, radius_mm: float) -> Loop:
    """An upright rectangle with rounded corners; low, high: (2,) lower left and upper right corner, mm."""
    corners = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
    return rounded_polygon(corners, radius_mm)


def inset_cells(
    cells: NDArray[np.float64], inset_mm: float | NDArray[np.float64], radius_mm: float
) -> list[Loop]:
    """Move the sides of convex cells inward and round their corners.

    Args:
        cells: (N, k, 2) corners, counter-clockwise, mm.
        inset_mm: distance by which the sides move inward: one, or (N, k), where side i starts at corner i.
        radius_mm: radius of the arcs at the corners; 0: sharp corners.

    Returns:
        One loop per cell.
    """
    normal = _outward_normals(cells)
    before = np.roll(normal, 1, axis=1)
    core = inset_corners(cells, np.broadcast_to(inset_mm, cells.shape[:2]) + radius_mm)
    straight = np.full_like(core, np.nan)
    if radius_mm == 0:
        return [Loop(points, centres) for points, centres in zip(core, straight, strict=True)]
    n, k, _ = cells.shape
    points = np.stack([core + radius_mm * before, core + radius_mm * normal], axis=2).reshape(n, 2 * k, 2)
    centres = np.stack([core, straight], axis=2).reshape(n, 2 * k, 2)
    return [Loop(*pair) for pair in zip(points, centres, strict=True)]


def inset_corners(cells: NDArray[np.float64], insets_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, k, 2) corners of convex cells (N, k, 2) whose side i, from corner i on, moved inward by insets (N, k)."""
    normal = _outward_normals(cells)
    before, inset_before = np.roll(normal, 1, axis=1), np.roll(insets_mm, 1, axis=1)
    cosine = (before * normal).sum(axis=-1)
    # The corner moves by a before + b normal, so that it moves by each side's inset along the side's normal.
    scale = 1 / (1 - cosine**2)
    a = (inset_before - insets_mm * cosine) * scale
    b = (insets_mm - inset_before * cosine) * scale
    corners: NDArray[np.float64] = cells - a[..., None] * before - b[..., None] * normal
    return corners


def _outward_normals(cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, k, 2) unit normals of the sides of (N, k, 2) cells."""
    side = np.roll(cells, -1, axis=1) - cells
    normals: NDArray[np.float64] = (
        np.stack([side[..., 1], -side[..., 0]], axis=-1) / np.hypot(side[..., 0], side[..., 1])[..., None]
    )
    return normals


def bounding_boxes(loops: Sequence[Loop]) -> NDArray[np.float64]:
    """(N, 2, 2) lower left and upper right corner of each loop; arcs must sweep less than 180 degrees."""
    result = np.empty((len(loops), 2, 2))
    for group in _group_by_sides(loops):
        points, centres = group.points, group.centres
        low, high = points.min(axis=1), points.max(axis=1)
        start, end = points - centres, np.roll(points, -1, axis=1) - centres
        radius = np.hypot(start[..., 0], start[..., 1])
        for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
            direction = np.zeros(2)
            direction[axis] = sign
            # Comparisons with NaN (straight sides) are false.
            within = (_cross(start, direction) >= 0) & (_cross(direction, end) >= 0)
            reach = np.where(within, centres[..., axis] + sign * radius, np.nan)
            if sign > 0:
                high[:, axis] = np.fmax(high[:, axis], np.fmax.reduce(reach, axis=1))
            else:
                low[:, axis] = np.fmin(low[:, axis], np.fmin.reduce(reach, axis=1))
        result[group.numbers] = np.stack([low, high], axis=1)
    return result


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result


class _LoopGroup(NamedTuple):
    """Loops with the same number of sides m.

    Attributes:
        numbers: indices of the N loops.
        points, centres: (N, m, 2) mm.
    """

    numbers: list[int]
    points: NDArray[np.float64]
    centres: NDArray[np.float64]


def _group_by_sides(loops: Sequence[Loop]) -> Iterator[_LoopGroup]:
    """The loops in groups of the same number of sides."""
    groups: dict[int, list[int]] = {}
    for number, loop in enumerate(loops):
        groups.setdefault(len(loop.points), []).append(number)
    for numbers in groups.values():
        points = np.stack([loops[number].points for number in numbers])
        yield _LoopGroup(numbers, points, np.stack([loops[number].centres for number in numbers]))


def _areas_mm2(points: NDArray[np.float64], centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) enclosed areas: the shoelace formula and a circular segment per arc, both exact."""
    x, y = points[..., 0], points[..., 1]
    polygons = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2
    start, end = points - centres, np.roll(points, -1, axis=1) - centres
    sweep = np.arctan2(_cross(start, end), (start * end).sum(axis=-1)) % (2 * np.pi)
    segments = (start**2).sum(axis=-1) * (sweep - np.sin(sweep)) / 2
    areas: NDArray[np.float64] = polygons + np.nansum(segments, axis=1)
    return areas


def frusta_volume_mm3(pairs: Sequence[tuple[Loop, Loop]], height_mm: float) -> float:
    """Total volume of frusta of one height between parallel (lower, upper) outlines paired side by side.

    The section of drafted walls is quadratic in the height, so Simpson's rule is exact. The points of the section
    half way lie half way between the points of the outlines.
    """
    lower, upper = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    total = 0.0
    for group in _group_by_sides(lower):
        points = group.points
        upper_points = np.stack([upper[number].points for number in group.numbers])
        middle_points = (points + upper_points) / 2
        sections = [_areas_mm2(p, group.centres) for p in (points, middle_points, upper_points)]
        total += float((sections[0] + 4 * sections[1] + sections[2]).sum())
    return height_mm * total / 6


def frustum_volume_mm3(lower: Loop, upper: Loop, height_mm: float) -> float:
    """Volume of one frustum, see ``frusta_volume_mm3``."""
    return frusta_volume_mm3([(lower, upper)], height_mm)
