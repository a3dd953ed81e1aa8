"""Cavities: the paths that carve convex cells, and the holes that the beam leaves along these paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.corners import (
    balanced_spur_length,
    half_angles,
    spur_area,
    spur_start,
    with_spurs,
)
from cmpdesign.products.laser.paths.kerf import inset_polygons, polygon_areas

CornerMode = Literal["plain", "overcut"]
# Points of the arc around a corner or a spur's tip.
ARC_POINTS = 25
# On shorter sides of a path, in beam units, the burns of two spurs may overlap.
SHORT_SIDE = 1.0


@dataclass(frozen=True, eq=False)
class Cavities:
    """Cells with the paths that carve them.

    Attributes:
        cell: (N,) int64, numbers of the layout's cells.
        nominal_mm: (N, K, 2) corners of the cells, counter-clockwise.
        path_mm: (N, K, 2) corners of the path of the beam's centre.
        tip_mm: (N, K, 2) tips of the corners' spurs; corners of the path without spurs.
        corner: "plain" or "overcut" (with spurs).
        exists: (N,) True where the beam fits into the cell.
    """

    cell: NDArray[np.int64]
    nominal_mm: Points
    path_mm: Points
    tip_mm: Points
    corner: CornerMode
    exists: NDArray[np.bool_]

    @property
    def loops_mm(self) -> Points:
        """(N, K or 3K, 2) closed paths of the beam's centre; every ``entry_stride``-th point is an entry point."""
        return with_spurs(self.path_mm, self.tip_mm) if self.corner == "overcut" else self.path_mm

    @property
    def entry_stride(self) -> int:
        """Points of ``loops_mm`` from one entry point to the next."""
        return 3 if self.corner == "overcut" else 1

    @property
    def entries_mm(self) -> Points:
        """(N, K, 2) entry points of the loops."""
        return self.tip_mm

    def selected(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Cavities:
        """The cavities of an index or a mask, in that order."""
        return Cavities(
            self.cell[which],
            self.nominal_mm[which],
            self.path_mm[which],
            self.tip_mm[which],
            self.corner,
            self.exists[which],
        )


def make_cavities(
    cell: NDArray[np.int64], polygons_mm: Points, beam: BeamFootprint, corner: CornerMode
) -> Cavities:
    """Compute paths whose burn meets the cells' sides, plain or with balanced spurs.

    Args:
        cell: (N,) numbers of the cells.
        polygons_mm: (N, K, 2) convex cells, counter-clockwise.
        beam: the footprint at the face where the cells get their nominal size.
        corner: "plain", or "overcut" for balanced spurs; a beam without width has none.
    """
    path_mm, exists = inset_polygons(polygons_mm, beam)
    tip_mm = path_mm
    if beam.is_point:
        corner = "plain"
    if corner == "overcut":
        outward = beam.to_beam_units(polygons_mm - path_mm)
        with np.errstate(divide="ignore", invalid="ignore"):
            outward = outward / np.linalg.norm(outward, axis=-1, keepdims=True)
        half, _ = half_angles(beam.to_beam_units(path_mm), outward)
        half = np.where(exists[:, None], half, np.pi / 6)
        tip_mm = path_mm + beam.to_millimetres(outward * balanced_spur_length(half)[..., None])
    return Cavities(cell, polygons_mm, path_mm, tip_mm, corner, exists)


def burnt_areas_mm2(cavities: Cavities, beam: BeamFootprint) -> NDArray[np.float64]:
    """(N,) areas of the holes: in beam units area + perimeter + pi (Steiner's formula) + the spurs' gain.

    The formula is exact. Where the burns of two spurs overlap, the area is that of ``burnt_shapes``.
    """
    if beam.is_point:
        return polygon_areas(cavities.path_mm)
    spurs = _spur_geometry(cavities, beam)
    path = spurs.path
    next_corner = np.roll(path, -1, axis=1)
    area = (path[..., 0] * next_corner[..., 1] - next_corner[..., 0] * path[..., 1]).sum(axis=1) / 2
    side = next_corner - path
    length = np.hypot(side[..., 0], side[..., 1])
    perimeter = length.sum(axis=1)
    after, before = half_angles(path, spurs.direction)
    gain = (spur_area(after, spurs.length) + spur_area(before, spurs.length)).sum(axis=1)
    areas = np.asarray(beam.area_factor * (area + perimeter + np.pi + gain))
    short = np.flatnonzero(length.min(axis=1) < SHORT_SIDE)
    if len(short):
        _update_overlapped_areas(areas, cavities, beam, short)
    return areas


def _update_overlapped_areas(
    areas: NDArray[np.float64], cavities: Cavities, beam: BeamFootprint, short: NDArray[np.int64]
) -> None:
    """Replace the areas of those cavities among ``short`` whose outlines cross themselves."""
    import shapely

    outlines = burnt_outlines_mm(cavities.selected(short), beam)
    overlaps = ~shapely.is_valid(shapely.polygons(outlines))
    areas[short[overlaps]] = shapely.area(burnt_shapes(outlines[overlaps]))


def burnt_outlines_mm(cavities: Cavities, beam: BeamFootprint) -> Points:
    """(N, K * (2 + ARC_POINTS), 2) outlines of the holes, counter-clockwise, with points on the true curve.

    For a beam without width (N, K, 2), the paths. Where the burns of two spurs overlap, which needs a side of the path
    that is shorter than half the kerf, an outline crosses itself; ``burnt_shapes`` gives the hole.
    """
    if beam.is_point:
        return cavities.path_mm
    path, direction, length = _spur_geometry(cavities, beam)
    left = np.stack([-direction[..., 1], direction[..., 0]], axis=-1)
    after, before = half_angles(path, direction)
    # Counter-clockwise, the incoming side lies right of the spur, the outgoing side left of it.
    along_in, across_in = spur_start(before, length)
    along_out, across_out = spur_start(after, length)
    from_angle = -np.minimum(np.arctan2(across_in, along_in - length), np.pi / 2)
    to_angle = np.minimum(np.arctan2(across_out, along_out - length), np.pi / 2)
    share = np.linspace(0, 1, ARC_POINTS)
    angle = from_angle[..., None] + share * (to_angle - from_angle)[..., None]
    arc_along, arc_across = length[..., None] + np.cos(angle), np.sin(angle)
    # A burn that leaves the corner on the disc itself ends at the arc's own end, to the last bit.
    first, last = along_in < length, along_out < length
    along = np.concatenate(
        [
            np.where(first, along_in, arc_along[..., 0])[..., None],
            arc_along,
            np.where(last, along_out, arc_along[..., -1])[..., None],
        ],
        axis=-1,
    )
    across = np.concatenate(
        [
            np.where(first, -across_in, arc_across[..., 0])[..., None],
            arc_across,
            np.where(last, across_out, arc_across[..., -1])[..., None],
        ],
        axis=-1,
    )
    points = (
        path[:, :, None] + along[..., None] * direction[:, :, None] + across[..., None] * left[:, :, None]
    )
    return beam.to_millimetres(points.reshape(len(path), -1, 2))


def burnt_shapes(outlines: Points) -> NDArray[np.object_]:
    """(N,) holes as valid shapes of (N, P, 2) outlines: an area that an outline encloses once or twice is burnt."""
    import shapely

    shapes = np.asarray(shapely.polygons(outlines), dtype=np.object_)
    crossing = ~shapely.is_valid(shapes)
    shapes[crossing] = shapely.make_valid(shapes[crossing], method="structure", keep_collapsed=False)
    return shapes


class _SpurGeometry(NamedTuple):
    """Corners of the paths and their spurs, in beam units.

    Attributes:
        path: (N, K, 2) corners of the paths.
        direction: (N, K, 2) unit vectors along the spurs, outward.
        length: (N, K) lengths of the spurs; 0 without a spur.
    """

    path: Points
    direction: Points
    length: NDArray[np.float64]


def _spur_geometry(cavities: Cavities, beam: BeamFootprint) -> _SpurGeometry:
    path = beam.to_beam_units(cavities.path_mm)
    spur = beam.to_beam_units(cavities.tip_mm) - path
    length = np.hypot(spur[..., 0], spur[..., 1])
    outward = beam.to_beam_units(cavities.nominal_mm) - path
    direction = np.where(length[..., None] > 0, spur, outward)
    return _SpurGeometry(path, direction / np.linalg.norm(direction, axis=-1, keepdims=True), length)
