"""What a job leaves: areas, corners and webs of the cavities, from the beam swept over the paths, at both
faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.job import LaserJob, LaserPass
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import Cavities, burnt_areas_mm2, burnt_outlines_mm
from cmpdesign.products.laser.paths.kerf import polygon_areas
from cmpdesign.products.laser.paths.webs import burn_depth_mm, smallest_web_mm

SheetFace = Literal["front", "back"]
# Webs wider than this are no concern of anybody's; only cavities nearer than this are compared.
WEB_REACH_PITCHES = 1.5


@dataclass(frozen=True)
class FaceFigures:
    """A pass at one face. Lengths in mm, areas in percent of the nominal cell.

    Attributes:
        area_error_percent: of all cells together.
        area_error_worst_percent: of the worst cell, with its sign.
        corner_loss_mm: from a nominal corner to the nearest point burnt, the worst one.
        burnt_beside_mm: how far the burn reaches past a cell's sides, at most.
        web_mm: the smallest wall left between two cavities of this pass; None for a lone cavity.
        web_to_filled_mm: the smallest wall to a cavity filled before; None for the first pass. Where
        cavities meet,
            this is 0, and negative where the burn runs into the filled one.
    """

    area_error_percent: float
    area_error_worst_percent: float
    corner_loss_mm: float
    burnt_beside_mm: float
    web_mm: float | None
    web_to_filled_mm: float | None


@dataclass(frozen=True)
class PassFigures:
    """A pass at both faces; None where the beam has closed before the back."""

    name: str
    front: FaceFigures
    back: FaceFigures | None


def measure_as_made(job: LaserJob) -> tuple[PassFigures, ...]:
    """The figures of every pass of cells."""
    back = job.back if min(job.back.x_mm, job.back.y_mm) > 0 else None
    front_figures = _measure_face(job, job.front)
    back_figures = _measure_face(job, back) if back else [None] * len(front_figures)
    return tuple(
        PassFigures(one.name, front, rear)
        for one, front, rear in zip(job.cell_passes, front_figures, back_figures, strict=True)
    )


def burnt_cell_outlines_mm(one: LaserPass, beam: BeamFootprint) -> Points:
    """(N, P, 2) outlines of a pass' cavities on the bed, in burning order."""
    assert one.cavities is not None
    return burnt_outlines_mm(one.cavities, beam)


def _measure_face(job: LaserJob, beam: BeamFootprint) -> list[FaceFigures]:
    figures: list[FaceFigures] = []
    filled: list[Points] = []
    paths: list[Cavities] = []
    reach_mm = WEB_REACH_PITCHES * float(job.layout.parameters["pitch_mm"])
    for one in job.cell_passes:
        made = one.cavities
        assert made is not None
        outlines = burnt_outlines_mm(made, beam)
        web = smallest_web_mm([made], [outlines], beam, reach_mm)
        to_filled = None
        if filled:
            to_filled = smallest_web_mm([made, *paths], [outlines, *filled], beam, reach_mm, across=True)
            if to_filled is not None and to_filled <= 0:
                to_filled = -burn_depth_mm(outlines, np.concatenate(filled))
        figures.append(_face_figures(made, outlines, beam, web, to_filled))
        filled.append(outlines)
        paths.append(made)
    return figures


def _face_figures(
    made: Cavities, outlines: Points, beam: BeamFootprint, web: float | None, to_filled: float | None
) -> FaceFigures:
    nominal = polygon_areas(made.nominal_mm)
    burnt = burnt_areas_mm2(made, beam)
    errors = 100 * (burnt / nominal - 1)
    return FaceFigures(
        area_error_percent=_round_figure(100 * (float(burnt.sum()) / float(nominal.sum()) - 1)),
        area_error_worst_percent=_round_figure(float(errors[np.abs(errors).argmax()])),
        corner_loss_mm=_round_figure(float(corner_losses_mm(made, outlines).max())),
        burnt_beside_mm=_round_figure(float(np.maximum(burnt_reach_beside_mm(made, outlines), 0).max())),
        web_mm=None if web is None else _round_figure(web),
        web_to_filled_mm=None if to_filled is None else _round_figure(to_filled),
    )


def corner_losses_mm(made: Cavities, outlines: Points) -> NDArray[np.float64]:
    """(N, K) from each nominal corner to the nearest point of the burnt outline; 0 where it is burnt."""
    corners = made.nominal_mm.shape[1]
    arcs = outlines.reshape(len(outlines), corners, -1, 2)
    gap = np.linalg.norm(arcs - made.nominal_mm[:, :, None], axis=-1).min(axis=2)
    # Past the corner along the spur there is nothing left to lose.
    outward = made.nominal_mm - made.path_mm
    past = ((arcs - made.nominal_mm[:, :, None]) * outward[:, :, None]).sum(axis=-1).max(axis=2) > 0
    return np.where(past, 0.0, gap)


def burnt_reach_beside_mm(made: Cavities, outlines: Points) -> NDArray[np.float64]:
    """(N,) how far each burnt outline reaches past its cell's sides; negative where it stays inside."""
    start = made.nominal_mm
    side = np.roll(start, -1, axis=1) - start
    outward = np.stack([side[..., 1], -side[..., 0]], axis=-1) / np.linalg.norm(side, axis=-1, keepdims=True)
    offset = (start * outward).sum(axis=-1)
    reach = (outlines[:, :, None] * outward[:, None]).sum(axis=-1) - offset[:, None]
    return np.asarray(reach.max(axis=(1, 2)))


def _round_figure(value: float) -> float:
    """Rounded to what the geometry holds, so that every machine writes the same figure."""
    return round(value, 6) + 0.0
