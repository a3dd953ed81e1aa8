"""A laser job: the passes of a layout in burning order, in the bed's frame (mm, x right, y up, origin lower left).

The front of the pattern faces the beam. The cavities are filled from the front.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import Cavities, make_cavities
from cmpdesign.products.laser.paths.fill import hatch_strokes, ring_strokes
from cmpdesign.products.laser.paths.kerf import outset_outline
from cmpdesign.products.laser.paths.order import order_cells
from cmpdesign.products.laser.paths.strokes import Strokes, join_strokes, loop_strokes, ragged_strokes
from cmpdesign.products.laser.setup import LaserSetup

# Points of a circular path.
CIRCLE_POINTS = 96
Face = Literal["front", "middle", "back"]
PassKind = Literal["holes", "cells", "outline", "coupon"]


@dataclass(frozen=True, eq=False)
class LaserPass:
    """The paths that are burnt before the pad is taken off the bed.

    Attributes:
        name: name of the pass and of its files: "1-red".
        kind: fiducial holes, cells of one color, the pad's outline, or a coupon's openings.
        color: index into ``COLORS``; None if the pass carves no cells.
        cavities: the cells in burning order; None if the pass carves no cells.
        walls: closed paths in burning order, entered at their first points; inner rings precede their cavity's wall.
        fills: a pocket's hatch lines for every repeat; empty without a hatch.
        power_percent, speed_mm_s, repeats: settings.
    """

    name: str
    kind: PassKind
    color: int | None
    cavities: Cavities | None
    walls: Strokes
    fills: tuple[Strokes, ...]
    power_percent: float
    speed_mm_s: float
    repeats: int

    def burn_strokes(self, repeat: int) -> Strokes:
        """The open strokes of one repeat in burning order."""
        walls = self.walls.opened()
        return join_strokes([self.fills[repeat], walls]) if self.fills else walls


class Extent(NamedTuple):
    """A bounding box on the bed, mm."""

    left: float
    bottom: float
    right: float
    top: float


class CellGroup(NamedTuple):
    """Cells that are carved in one pass.

    Attributes:
        color: index into ``COLORS``.
        part: number of the group among those of its color.
        cells: (N,) int64, numbers of the layout's cells.
    """

    color: int
    part: int
    cells: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LaserJob:
    """All passes of a layout on a bed.

    Attributes:
        name: name of the design.
        layout: layout of the design.
        setup: machine, material, settings.
        origin_mm: (2,) place of the layout's origin on the bed.
        passes: passes in burning order.
        fiducials_mm: (F, 2) centres of the fiducials on the bed.
        outline_mm: (K, 2) outline of the pad on the bed.
    """

    name: str
    layout: Layout
    setup: LaserSetup
    origin_mm: Points
    passes: tuple[LaserPass, ...]
    fiducials_mm: Points
    outline_mm: Points

    @cached_property
    def front(self) -> BeamFootprint:
        """The beam's footprint at the front of the sheet."""
        return BeamFootprint.of_kerf(self.setup.kerf_x_mm, self.setup.kerf_y_mm)

    @cached_property
    def back(self) -> BeamFootprint:
        """The beam's footprint at the bottom of the cavities."""
        return self.front.at_depth(self.setup.depth_mm, self.setup.taper_deg)

    @property
    def nominal_face(self) -> Face:
        """The face at which cells have their nominal size: the design's face, else the side that the camera sees."""
        return nominal_face(self.layout, self.setup)

    @property
    def seen(self) -> BeamFootprint:
        """The beam's footprint at the side that the camera sees."""
        return self.back if seen_side(self.layout.mirrored) == "back" else self.front

    @property
    def cell_passes(self) -> tuple[LaserPass, ...]:
        return tuple(laser_pass for laser_pass in self.passes if laser_pass.kind == "cells")

    @cached_property
    def extent_mm(self) -> Extent:
        """The bounding box of the paths, the fiducials and the pad's outline."""
        radius = self.layout.fiducial_diameter_mm / 2
        marks = [self.fiducials_mm - radius, self.fiducials_mm + radius]
        points = np.concatenate(
            [laser_pass.walls.xy_mm for laser_pass in self.passes] + marks + [self.outline_mm]
        )
        left, bottom = points.min(axis=0).tolist()
        right, top = points.max(axis=0).tolist()
        return Extent(left, bottom, right, top)


def nominal_face(layout: Layout, setup: LaserSetup) -> Face:
    """The face at which cells have their nominal size, see ``LaserJob.nominal_face``."""
    return setup.options.face or seen_side(layout.mirrored)


def make_job(name: str, layout: Layout, setup: LaserSetup) -> LaserJob:
    """Make the passes of a layout: holes, cells color by color, outline. The job is not checked here."""
    origin_mm = _job_origin_mm(layout, setup)
    front = BeamFootprint.of_kerf(setup.kerf_x_mm, setup.kerf_y_mm)
    share = {"front": 0.0, "middle": 0.5, "back": 1.0}[nominal_face(layout, setup)]
    beam = front.at_depth(share * setup.depth_mm, setup.taper_deg)
    passes: list[LaserPass] = []
    if setup.options.holes and len(layout.fiducials_mm):
        circles = layout.fiducials_mm + origin_mm
        passes.append(
            _cut_pass("0-holes", "holes", _hole_strokes(circles, layout.fiducial_diameter_mm, front), setup)
        )
    for number, group in enumerate(cell_groups(layout), start=1):
        polygons_mm = layout.marker_xy_mm[layout.cell_corners[group.cells]] + origin_mm
        suffix = f"-{group.part + 1}" if group.part else ""
        cavities = make_cavities(group.cells, polygons_mm, beam, setup.options.corner)
        passes.append(_cell_pass(f"{number}-{COLORS[group.color]}{suffix}", group.color, cavities, setup))
    if setup.options.outline:
        paths = outset_outline(layout.outline_mm + origin_mm, front)
        strokes = ragged_strokes(paths, range(len(paths)), closed=True)
        number = len(passes) + 1 - bool(passes[0].kind == "holes")
        passes.append(_cut_pass(f"{number}-outline", "outline", strokes, setup))
    return LaserJob(
        name=name,
        layout=layout,
        setup=setup,
        origin_mm=origin_mm,
        passes=tuple(passes),
        fiducials_mm=layout.fiducials_mm + origin_mm,
        outline_mm=layout.outline_mm + origin_mm,
    )


def cell_groups(layout: Layout) -> list[CellGroup]:
    """Group the colored cells into passes, in burning order; black cells are the ground.

    Cells of one color that touch at a corner (square pattern) get different parts, so that every pass leaves complete
    walls between its cavities.
    """
    groups: list[CellGroup] = []
    for color in range(len(COLORS)):
        cells = np.flatnonzero(layout.cell_color == color)
        if color == BLACK or not len(cells):
            continue
        part = _contact_free_groups(layout.cell_corners[cells])
        groups += [CellGroup(color, p, cells[part == p]) for p in range(int(part.max()) + 1)]
    return groups


def _contact_free_groups(corners: NDArray[np.int32]) -> NDArray[np.int64]:
    """(N,) for each cell the smallest part number that no earlier cell with a common corner has."""
    parts_at: dict[int, set[int]] = {}
    part = np.zeros(len(corners), dtype=np.int64)
    if len(np.unique(corners)) == corners.size:
        return part
    for cell, markers in enumerate(corners.tolist()):
        used = set().union(*(parts_at.get(marker, set()) for marker in markers))
        part[cell] = next(p for p in range(len(corners)) if p not in used)
        for marker in markers:
            parts_at.setdefault(marker, set()).add(int(part[cell]))
    return part


def _job_origin_mm(layout: Layout, setup: LaserSetup) -> Points:
    """(2,) place of the layout's origin: the job's box is centred on the bed unless options place its corner."""
    radius = layout.fiducial_diameter_mm / 2
    marks = [layout.fiducials_mm - radius, layout.fiducials_mm + radius]
    box = np.concatenate([layout.outline_mm, *marks])
    low, high = box.min(axis=0), box.max(axis=0)
    bed = np.array([setup.machine.bed_width_mm.value, setup.machine.bed_height_mm.value])
    corner = (bed - (high - low)) / 2
    for axis, wanted in enumerate((setup.options.x_mm, setup.options.y_mm)):
        if wanted is not None:
            corner[axis] = wanted
    return np.asarray(np.round(corner - low, 3))


def _cell_pass(name: str, color: int, cavities: Cavities, setup: LaserSetup) -> LaserPass:
    order, entry = order_cells(cavities.entries_mm, setup.options.order)
    cavities = cavities.selected(order)
    paths = cavities.loops_mm
    points = paths.shape[1]
    from_entry = (cavities.entry_stride * entry[:, None] + np.arange(points)) % points
    walls = loop_strokes(np.take_along_axis(paths, from_entry[..., None], axis=1), np.arange(len(paths)))
    fills: tuple[Strokes, ...] = ()
    if setup.options.mode == "pocket" and setup.options.fill == "hatch":
        turn = setup.options.hatch_turn_deg
        angles = [setup.options.hatch_deg + turn * repeat for repeat in range(setup.repeats)]
        fills = tuple(hatch_strokes(cavities.path_mm, setup.hatch_mm, angle) for angle in angles)
    elif setup.options.mode == "pocket":
        walls = _walls_with_rings(cavities, walls, setup.hatch_mm)
    return LaserPass(
        name=name,
        kind="cells",
        color=color,
        cavities=cavities,
        walls=walls,
        fills=fills,
        power_percent=setup.power_percent,
        speed_mm_s=setup.speed_mm_s,
        repeats=setup.repeats,
    )


def _walls_with_rings(cavities: Cavities, walls: Strokes, spacing_mm: float) -> Strokes:
    """The walls, each preceded by the rings inside it, the innermost ring first."""
    inner = ring_strokes(cavities.path_mm, spacing_mm)
    first = np.concatenate([inner.first, walls.first[1:] + inner.first[-1]])
    joined = Strokes(
        np.concatenate([inner.xy_mm, walls.xy_mm]), first, np.concatenate([inner.owner, walls.owner]), True
    )
    return joined.selected(np.argsort(joined.owner, kind="stable"))


def _cut_pass(name: str, kind: PassKind, strokes: Strokes, setup: LaserSetup) -> LaserPass:
    """A pass that cuts through the sheet along the strokes."""
    return LaserPass(
        name=name,
        kind=kind,
        color=None,
        cavities=None,
        walls=strokes,
        fills=(),
        power_percent=setup.cut_power_percent,
        speed_mm_s=setup.cut_speed_mm_s,
        repeats=setup.cut_repeats,
    )


def _hole_strokes(centres_mm: Points, diameter_mm: float, beam: BeamFootprint) -> Strokes:
    """Paths along which an elliptic beam burns round holes: the circle less the footprint's extent, exact."""
    angle = np.linspace(0, 2 * np.pi, CIRCLE_POINTS, endpoint=False)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    if beam.is_point:
        return loop_strokes(centres_mm[:, None] + diameter_mm / 2 * normal, np.arange(len(centres_mm)))
    squares = np.array([beam.x_mm**2, beam.y_mm**2])
    contact = normal * squares / np.sqrt((normal**2 * squares).sum(axis=1))[:, None]
    circle = diameter_mm / 2 * normal - contact
    return loop_strokes(centres_mm[:, None] + circle, np.arange(len(centres_mm)))
