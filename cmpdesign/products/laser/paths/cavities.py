"""Cavities: the paths that carve convex cells, and the holes that the beam leaves when it has run along
them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
from cmpdesign.products.laser.paths.kerf import inset_polygons

CornerMode = Literal["plain", "overcut"]
ARC_POINTS = 25


@dataclass(frozen=True, eq=False)
class Cavities:
    """Cells with their paths.

    Attributes:
        cell: (N,) int64, numbers of the layout's cells.
        nominal_mm: (N, K, 2), the cells, counter-clockwise.
        path_mm: (N, K, 2), where the beam's centre turns.
        tip_mm: (N, K, 2), ends of the corners' spurs; the path's corners themselves where there are none.
        corner: "plain" or "overcut".
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
        """(N, K or 3K, 2) closed paths as the beam runs; they can be entered at every ``entry_step``-th
        point."""
        return with_spurs(self.path_mm, self.tip_mm) if self.corner == "overcut" else self.path_mm

    @property
    def entry_step(self) -> int:
        return 3 if self.corner == "overcut" else 1

    @property
    def entries_mm(self) -> Points:
        """(N, K, 2) points where a loop can be entered."""
        return self.tip_mm

    def selected(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Cavities:
        """Some of them, or all of them in another order."""
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
    """Paths whose burn meets the cells' sides, plain or with balanced spurs.

    Args:
        cell: (N,) their numbers.
        polygons_mm: (N, K, 2) convex cells, counter-clockwise.
        beam: the footprint at the face where the cells are to have their nominal size.
        corner: how corners are treated.
    """
    path_mm, exists = inset_polygons(polygons_mm, beam)
    tip_mm = path_mm
    if corner == "overcut":
        outward = beam.units(polygons_mm - path_mm)
        with np.errstate(divide="ignore", invalid="ignore"):
            outward = outward / np.linalg.norm(outward, axis=-1, keepdims=True)
        half, _ = half_angles(beam.units(path_mm), outward)
        half = np.where(exists[:, None], half, np.pi / 6)
        tip_mm = path_mm + beam.millimetres(outward * balanced_spur_length(half)[..., None])
    return Cavities(cell, polygons_mm, path_mm, tip_mm, corner, exists)


def burnt_areas_mm2(made: Cavities, beam: BeamFootprint) -> NDArray[np.float64]:
    """(N,) areas of the holes, exact: area + perimeter + pi (Steiner's formula) + the spurs' gain, in beam
    units."""
    path, toward, length = _spur_geometry(made, beam)
    after = np.roll(path, -1, axis=1)
    area = (path[..., 0] * after[..., 1] - after[..., 0] * path[..., 1]).sum(axis=1) / 2
    side = after - path
    perimeter = np.hypot(side[..., 0], side[..., 1]).sum(axis=1)
    first, second = half_angles(path, toward)
    gain = (spur_area(first, length) + spur_area(second, length)).sum(axis=1)
    return np.asarray(beam.area_factor * (area + perimeter + np.pi + gain))


def burnt_outlines_mm(made: Cavities, beam: BeamFootprint) -> Points:
    """(N, K * (2 + ARC_POINTS), 2) outlines of the holes, counter-clockwise, with points on the true
    curve."""
    path, toward, length = _spur_geometry(made, beam)
    left = np.stack([-toward[..., 1], toward[..., 0]], axis=-1)
    after, before = half_angles(path, toward)
    # Counter-clockwise, the side that arrives lies on the spur's right, the one that leaves on its left.
    along_in, beside_in = spur_start(before, length)
    along_out, beside_out = spur_start(after, length)
    from_angle = -np.minimum(np.arctan2(beside_in, along_in - length), np.pi / 2)
    to_angle = np.minimum(np.arctan2(beside_out, along_out - length), np.pi / 2)
    share = np.linspace(0, 1, ARC_POINTS)
    angle = from_angle[..., None] + share * (to_angle - from_angle)[..., None]
    arc_along, arc_beside = length[..., None] + np.cos(angle), np.sin(angle)
    # Where the burn leaves the corner on the disc itself, that point is the arc's own end, to the last bit.
    first, last = along_in < length, along_out < length
    along = np.concatenate(
        [
            np.where(first, along_in, arc_along[..., 0])[..., None],
            arc_along,
            np.where(last, along_out, arc_along[..., -1])[..., None],
        ],
        axis=-1,
    )
    beside = np.concatenate(
        [
            np.where(first, -beside_in, arc_beside[..., 0])[..., None],
            arc_beside,
            np.where(last, beside_out, arc_beside[..., -1])[..., None],
        ],
        axis=-1,
    )
    points = path[:, :, None] + along[..., None] * toward[:, :, None] + beside[..., None] * left[:, :, None]
    return beam.millimetres(points.reshape(len(path), -1, 2))


def _spur_geometry(made: Cavities, beam: BeamFootprint) -> tuple[Points, Points, NDArray[np.float64]]:
    """Path corners, spur directions (unit) and spur lengths, in beam units."""
    path = beam.units(made.path_mm)
    spur = beam.units(made.tip_mm) - path
    length = np.hypot(spur[..., 0], spur[..., 1])
    outward = beam.units(made.nominal_mm) - path
    direction = np.where(length[..., None] > 0, spur, outward)
    return path, direction / np.linalg.norm(direction, axis=-1, keepdims=True), length
