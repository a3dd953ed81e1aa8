"""Closed outlines of straight sides and circular arcs: what every face of a mold is bounded by."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


# Chords of meshes: corners of bosses take a few, pin holes many.
FINE_RADIUS_MM, FINE_DEG, COARSE_DEG = 0.25, 7.5, 40.0


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed outline, counter-clockwise.

    Attributes:
        points: (m, 2) mm; side i goes from point i to point i + 1.
        centres: (m, 2) mm, NaN for a straight side; else side i is the counter-clockwise arc around it.
    """

    points: Points
    centres: Points

    def moved(self, offset_mm: float) -> Loop:
        """The outline ``offset_mm`` further out: straight sides shift, arcs grow around the same centres.

        Where two straight sides meet, their corner stays sharp (a mitre).
        """
        return Loop(self.points + offset_mm * self._moves(), self.centres)

    def _moves(self) -> Points:
        """(m, 2): how far each point moves when every side moves outward by one."""
        side = np.roll(self.points, -1, axis=0) - self.points
        normal = np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
        curved = ~np.isnan(self.centres[:, 0])
        start, end = normal.copy(), normal.copy()
        centre = self.centres[curved]
        start[curved] = _unit(self.points[curved] - centre)
        end[curved] = _unit(np.roll(self.points, -1, axis=0)[curved] - centre)
        before = np.roll(end, 1, axis=0)
        moves: Points = (before + start) / (1 + (before * start).sum(axis=1))[:, None]
        return moves

    def area_mm2(self) -> float:
        """The enclosed area, exact for arcs, too."""
        return float(_areas_mm2(self.points[None], self.centres[None])[0])

    def arc(self, side: int) -> tuple[float, float, float]:
        """Radius (mm), first angle and sweep (radians, positive) of a curved side."""
        first = self.points[side] - self.centres[side]
        last = self.points[(side + 1) % len(self.points)] - self.centres[side]
        angle = float(np.arctan2(first[1], first[0]))
        sweep = float(np.arctan2(first[0] * last[1] - first[1] * last[0], first @ last)) % (2 * np.pi)
        return float(np.hypot(*first)), angle, sweep

    def shifted(self, x_mm: float, y_mm: float) -> Loop:
        """The outline at another place."""
        move = np.array([x_mm, y_mm])
        return Loop(self.points + move, self.centres + move)

    def chorded(self, radius_mm: float | None = None) -> Loop:
        """The outline with its arcs as chords: a few for small radii, one for 7.5 degrees of large ones.

        ``radius_mm`` decides in place of each arc's own radius, so that paired outlines get paired chords.
        """
        points = []
        for side, point in enumerate(self.points):
            points.append(point)
            if np.isnan(self.centres[side, 0]):
                continue
            radius, first, sweep = self.arc(side)
            fine = (radius_mm or radius) >= FINE_RADIUS_MM
            count = max(1, int(np.ceil(np.degrees(sweep) / (FINE_DEG if fine else COARSE_DEG) - 1e-6)))
            angles = first + sweep * np.arange(1, count) / count
            points += list(self.centres[side] + radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1))
        return polygon_loop(np.array(points))


def chorded_pair(first: Loop, second: Loop) -> tuple[Loop, Loop]:
    """Two outlines that belong together, with the same number of chords."""
    curved = np.flatnonzero(~np.isnan(first.centres[:, 0]))
    radius = max((first.arc(int(side))[0] for side in curved), default=1.0)
    return first.chorded(radius), second.chorded(radius)


def _unit(vectors: Points) -> Points:
    unit: Points = vectors / np.hypot(*vectors.T)[:, None]
    return unit


def polygon_loop(points: Points) -> Loop:
    """A loop of straight sides."""
    return Loop(np.asarray(points, dtype=np.float64), np.full((len(points), 2), np.nan))


def circle_loop(centre: Points, diameter_mm: float) -> Loop:
    """A circle of two half arcs."""
    centre = np.asarray(centre, dtype=np.float64)
    reach = np.array([diameter_mm / 2, 0.0])
    return Loop(np.stack([centre + reach, centre - reach]), np.stack([centre, centre]))


def rounded_polygon(corners: Points, radius_mm: float) -> Loop:
    """A convex polygon (counter-clockwise) whose corners are arcs of the given radius; sharp at radius 0.

    The arcs touch the polygon's sides from inside, as a cutter or a beam of that radius leaves them.
    """
    if radius_mm == 0:
        return polygon_loop(corners)
    core = polygon_loop(corners).moved(-radius_mm).points
    side = np.roll(corners, -1, axis=0) - corners
    normal = radius_mm * np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
    points = np.stack([core + np.roll(normal, 1, axis=0), core + normal], axis=1).reshape(-1, 2)
    centres = np.stack([core, np.full_like(core, np.nan)], axis=1).reshape(-1, 2)
    return Loop(points, centres)


def rounded_offset(corners: Points, offset_mm: float) -> Loop:
    """Everything within ``offset_mm`` of a convex polygon: its corners become arcs around themselves."""
    side = np.roll(corners, -1, axis=0) - corners
    normal = offset_mm * np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
    points = np.stack([corners + np.roll(normal, 1, axis=0), corners + normal], axis=1).reshape(-1, 2)
    centres = np.stack([corners, np.full_like(corners, np.nan)], axis=1).reshape(-1, 2)
    return Loop(points, centres)


def rounded_rectangle(low: Points, high: Points, radius_mm: float) -> Loop:
    """An upright rectangle from its lower left to its upper right corner."""
    (left, bottom), (right, top) = low, high
    return rounded_polygon(np.array([(left, bottom), (right, bottom), (right, top), (left, top)]), radius_mm)


def inset_cells(cells: NDArray[np.float64], inset_mm: float, radius_mm: float) -> list[Loop]:
    """For each of many convex polygons: its sides moved inward, its corners rounded by arcs inside them.

    Args:
        cells: (N, k, 2) corners, counter-clockwise.
    """
    side = np.roll(cells, -1, axis=1) - cells
    normal = (
        np.stack([side[..., 1], -side[..., 0]], axis=-1) / np.hypot(side[..., 0], side[..., 1])[..., None]
    )
    before = np.roll(normal, 1, axis=1)
    mitre = (before + normal) / (1 + (before * normal).sum(axis=-1))[..., None]
    core = cells - (inset_mm + radius_mm) * mitre
    straight = np.full_like(core, np.nan)
    if radius_mm == 0:
        return [Loop(points, centres) for points, centres in zip(core, straight, strict=True)]
    n, k, _ = cells.shape
    points = np.stack([core + radius_mm * before, core + radius_mm * normal], axis=2).reshape(n, 2 * k, 2)
    centres = np.stack([core, straight], axis=2).reshape(n, 2 * k, 2)
    return [Loop(*pair) for pair in zip(points, centres, strict=True)]


def bounding_boxes(loops: Sequence[Loop]) -> NDArray[np.float64]:
    """(N, 2, 2) lower left and upper right corner of each; arcs must sweep less than 180 degrees."""
    result = np.empty((len(loops), 2, 2))
    for numbers, points, centres in _group_by_sides(loops):
        low, high = points.min(axis=1), points.max(axis=1)
        start, end = points - centres, np.roll(points, -1, axis=1) - centres
        radius = np.hypot(start[..., 0], start[..., 1])
        for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
            way = np.zeros(2)
            way[axis] = sign
            # NaN, on straight sides, compares as false.
            within = (_cross(start, way) >= 0) & (_cross(way, end) >= 0)
            reach = np.where(within, centres[..., axis] + sign * radius, np.nan)
            if sign > 0:
                high[:, axis] = np.fmax(high[:, axis], np.fmax.reduce(reach, axis=1))
            else:
                low[:, axis] = np.fmin(low[:, axis], np.fmin.reduce(reach, axis=1))
        result[numbers] = np.stack([low, high], axis=1)
    return result


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result


def _group_by_sides(
    loops: Sequence[Loop],
) -> Iterator[tuple[list[int], NDArray[np.float64], NDArray[np.float64]]]:
    """The loops' numbers, (N, m, 2) points and centres, for each number of sides m."""
    groups: dict[int, list[int]] = {}
    for number, loop in enumerate(loops):
        groups.setdefault(len(loop.points), []).append(number)
    for numbers in groups.values():
        points = np.stack([loops[number].points for number in numbers])
        yield numbers, points, np.stack([loops[number].centres for number in numbers])


def _areas_mm2(points: NDArray[np.float64], centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) the shoelace formula and a segment for each arc, both exact."""
    x, y = points[..., 0], points[..., 1]
    polygons = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2
    start, end = points - centres, np.roll(points, -1, axis=1) - centres
    sweep = np.arctan2(_cross(start, end), (start * end).sum(axis=-1)) % (2 * np.pi)
    segments = (start**2).sum(axis=-1) * (sweep - np.sin(sweep)) / 2
    areas: NDArray[np.float64] = polygons + np.nansum(segments, axis=1)
    return areas


def frusta_volume_mm3(pairs: Sequence[tuple[Loop, Loop]], height_mm: float) -> float:
    """Volume of all frusta of one height between parallel outlines that belong together side by side.

    A drafted wall's section grows with the square of the height, so Simpson's rule is exact: it needs the
    section half way, whose points lie half way between the outlines' points.
    """
    lower, upper = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    total = 0.0
    for numbers, points, centres in _group_by_sides(lower):
        other = np.stack([upper[number].points for number in numbers])
        sections = [_areas_mm2(p, centres) for p in (points, (points + other) / 2, other)]
        total += float((sections[0] + 4 * sections[1] + sections[2]).sum())
    return height_mm * total / 6


def frustum_volume_mm3(lower: Loop, upper: Loop, height_mm: float) -> float:
    """Of one."""
    return frusta_volume_mm3([(lower, upper)], height_mm)
