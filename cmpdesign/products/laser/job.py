"""A laser job: the passes of a layout, in burning order, in the bed's frame (mm, x right, y up, origin
lower left).

The pattern lies on the bed as it is seen from the front: the beam comes from where it will be filled from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import Cavities, make_cavities
from cmpdesign.products.laser.paths.fill import hatch_strokes, ring_strokes
from cmpdesign.products.laser.paths.kerf import outset_outline
from cmpdesign.products.laser.paths.order import order_cells
from cmpdesign.products.laser.paths.strokes import Strokes, join_strokes, loop_strokes, ragged_strokes
from cmpdesign.products.laser.setup import LaserSetup

CIRCLE_POINTS = 96
PassKind = Literal["holes", "cells", "outline", "coupon"]


@dataclass(frozen=True, eq=False)
class LaserPass:
    """What is burnt before the pad is taken out.

    Attributes:
        name: of its files: "1-red".
        kind: fiducial holes, cells of one color, the pad's outline, or a coupon's openings.
        color: index into ``COLORS``, for cells.
        cavities: the cells in burning order; None for holes and outline.
        walls: closed paths in burning order, each entered at its first point; a cavity's inner rings
        precede it.
        fills: one set of a pocket's lines for every repeat; empty without a hatch.
        power_percent, speed_mm_s, repeats: how it is burnt.
        entry_mm: (N, 2) where each closed path's owner is entered.
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

    def burnt(self, repeat: int) -> Strokes:
        """Open strokes of one repeat, exactly as the beam runs them."""
        walls = self.walls.opened()
        return join_strokes([self.fills[repeat], walls]) if self.fills else walls


@dataclass(frozen=True, eq=False)
class LaserJob:
    """All passes of a layout on a bed.

    Attributes:
        name: the design's.
        layout: where it comes from.
        setup: machine, material, settings.
        origin_mm: (2,) where the layout's origin lies on the bed.
        passes: in order.
        fiducials_mm: (F, 2) on the bed.
        outline_mm: (K, 2), the pad's, on the bed.
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
        """The footprint where the beam enters."""
        return BeamFootprint.of_kerf(self.setup.kerf_x_mm, self.setup.kerf_y_mm)

    @cached_property
    def back(self) -> BeamFootprint:
        """The footprint at the cavities' bottom."""
        return self.front.at_depth(self.setup.depth_mm, self.setup.taper_deg)

    @property
    def cell_passes(self) -> tuple[LaserPass, ...]:
        return tuple(one for one in self.passes if one.kind == "cells")

    @cached_property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top of everything that the beam's centre runs along, and of the fiducials."""
        radius = self.layout.fiducial_diameter_mm / 2
        marks = [self.fiducials_mm - radius, self.fiducials_mm + radius]
        points = np.concatenate([one.walls.xy_mm for one in self.passes] + marks + [self.outline_mm])
        left, bottom = points.min(axis=0).tolist()
        right, top = points.max(axis=0).tolist()
        return left, bottom, right, top


def make_job(name: str, layout: Layout, setup: LaserSetup) -> LaserJob:
    """The passes of a layout: holes, each color's cells, the outline. Nothing is checked yet."""
    origin_mm = _job_origin_mm(layout, setup)
    front = BeamFootprint.of_kerf(setup.kerf_x_mm, setup.kerf_y_mm)
    share = {"front": 0.0, "middle": 0.5, "back": 1.0}[setup.options.face]
    beam = front.at_depth(share * setup.depth_mm, setup.taper_deg)
    passes: list[LaserPass] = []
    if setup.options.holes and len(layout.fiducials_mm):
        circles = layout.fiducials_mm + origin_mm
        passes.append(
            _cut_pass("0-holes", "holes", _hole_strokes(circles, layout.fiducial_diameter_mm, front), setup)
        )
    for number, (color, part, cells) in enumerate(cell_groups(layout), start=1):
        polygons_mm = layout.marker_xy_mm[layout.cell_corners[cells]] + origin_mm
        suffix = f"-{part + 1}" if part else ""
        made = make_cavities(cells, polygons_mm, beam, setup.options.corner)
        passes.append(_cell_pass(f"{number}-{COLORS[color]}{suffix}", color, made, setup))
    if setup.options.outline:
        paths = outset_outline(layout.outline_mm + origin_mm, front)
        strokes = ragged_strokes(paths, range(len(paths)), closed=True)
        passes.append(
            _cut_pass(
                f"{len(passes) + 1 - bool(passes[0].kind == 'holes')}-outline", "outline", strokes, setup
            )
        )
    return LaserJob(
        name=name,
        layout=layout,
        setup=setup,
        origin_mm=origin_mm,
        passes=tuple(passes),
        fiducials_mm=layout.fiducials_mm + origin_mm,
        outline_mm=layout.outline_mm + origin_mm,
    )


def cell_groups(layout: Layout) -> list[tuple[int, int, NDArray[np.int64]]]:
    """Cells that are carved together: (color, part, cells), in the order of the passes; black is the ground.

    Cells of one color that touch at a corner (the square pattern's) come apart into parts, so that every pass
    leaves whole walls between its cavities.
    """
    groups: list[tuple[int, int, NDArray[np.int64]]] = []
    for color in range(len(COLORS)):
        cells = np.flatnonzero(layout.cell_color == color)
        if color == BLACK or not len(cells):
            continue
        part = _contact_free_groups(layout.cell_corners[cells])
        groups += [(color, p, cells[part == p]) for p in range(int(part.max()) + 1)]
    return groups


def _contact_free_groups(corners: NDArray[np.int32]) -> NDArray[np.int64]:
    """(N,) the smallest part for each cell that none of its corners' earlier cells has."""
    taken: dict[int, set[int]] = {}
    part = np.zeros(len(corners), dtype=np.int64)
    if len(np.unique(corners)) == corners.size:
        return part
    for cell, markers in enumerate(corners.tolist()):
        used = set().union(*(taken.get(marker, set()) for marker in markers))
        part[cell] = next(p for p in range(len(corners)) if p not in used)
        for marker in markers:
            taken.setdefault(marker, set()).add(int(part[cell]))
    return part


def _job_origin_mm(layout: Layout, setup: LaserSetup) -> Points:
    """Where the layout's origin comes to lie: the job's box is centred on the bed, or put where the
    options say."""
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


def _cell_pass(name: str, color: int, made: Cavities, setup: LaserSetup) -> LaserPass:
    order, entry = order_cells(made.entries_mm, setup.options.order)
    made = made.selected(order)
    paths = made.loops_mm
    points = paths.shape[1]
    turned = (made.entry_step * entry[:, None] + np.arange(points)) % points
    walls = loop_strokes(np.take_along_axis(paths, turned[..., None], axis=1), np.arange(len(paths)))
    fills: tuple[Strokes, ...] = ()
    if setup.options.mode == "pocket" and setup.options.fill == "hatch":
        turn = setup.options.hatch_turn_deg
        angles = [setup.options.hatch_deg + turn * repeat for repeat in range(setup.repeats)]
        fills = tuple(hatch_strokes(made.path_mm, setup.hatch_mm, angle) for angle in angles)
    elif setup.options.mode == "pocket":
        walls = _walls_with_rings(made, walls, setup.hatch_mm)
    return LaserPass(
        name, "cells", color, made, walls, fills, setup.power_percent, setup.speed_mm_s, setup.repeats
    )


def _walls_with_rings(made: Cavities, walls: Strokes, spacing_mm: float) -> Strokes:
    inner = ring_strokes(made.path_mm, spacing_mm)
    first = np.concatenate([inner.first, walls.first[1:] + inner.first[-1]])
    together = Strokes(
        np.concatenate([inner.xy_mm, walls.xy_mm]), first, np.concatenate([inner.owner, walls.owner]), True
    )
    return together.taken(np.argsort(together.owner, kind="stable"))


def _cut_pass(name: str, kind: PassKind, strokes: Strokes, setup: LaserSetup) -> LaserPass:
    return LaserPass(
        name,
        kind,
        None,
        None,
        strokes,
        (),
        setup.cut_power_percent,
        setup.cut_speed_mm_s,
        setup.cut_repeats,
    )


def _hole_strokes(centres_mm: Points, diameter_mm: float, beam: BeamFootprint) -> Strokes:
    """Paths along which an elliptic beam burns round holes: the circle less the footprint's extent,
    exactly."""
    angle = np.linspace(0, 2 * np.pi, CIRCLE_POINTS, endpoint=False)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    squares = np.array([beam.x_mm**2, beam.y_mm**2])
    touching = normal * squares / np.sqrt((normal**2 * squares).sum(axis=1))[:, None]
    circle = diameter_mm / 2 * normal - touching
    return loop_strokes(centres_mm[:, None] + circle, np.arange(len(centres_mm)))
