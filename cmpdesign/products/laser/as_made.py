"""The geometry after a job at both faces: areas, corners and webs, from the beam swept over the paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.as_made.made_pad import CORNER_SHARE, Cause, MadePad, cut_by_later, make_pad
from cmpdesign.products.laser.job import LaserJob, LaserPass
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import ARC_POINTS, Cavities, burnt_areas_mm2, burnt_outlines_mm
from cmpdesign.products.laser.paths.kerf import polygon_areas
from cmpdesign.products.laser.paths.webs import burn_depth_mm, smallest_web_mm

# Cavities further apart than this many pitches are not compared.
WEB_REACH_PITCHES = 1.5
# Every third point of an arc is kept: chords stay within a micrometre of a curve of 0.1 mm radius.
ARC_STRIDE = 3


@dataclass(frozen=True)
class FaceFigures:
    """The figures of a pass at one face.

    Attributes:
        area_error_percent: error of the total area, in percent of the nominal area.
        area_error_worst_percent: signed error of the cell with the largest absolute error.
        corner_loss_mm: largest distance from a nominal corner to the nearest burnt point.
        burnt_beside_mm: largest distance by which the burn exceeds a cell's sides; 0 if nowhere.
        web_mm: smallest wall between two cavities of this pass; None without neighbouring cavities.
        web_to_filled_mm: smallest wall to a cavity filled before; None for the first pass. 0 where cavities meet,
            negative where the burn runs into the filled cavity.
    """

    area_error_percent: float
    area_error_worst_percent: float
    corner_loss_mm: float
    burnt_beside_mm: float
    web_mm: float | None
    web_to_filled_mm: float | None


@dataclass(frozen=True)
class PassFigures:
    """The figures of a pass at both faces; ``back`` is None if the beam closes before the back."""

    name: str
    front: FaceFigures
    back: FaceFigures | None


def measure_as_made(job: LaserJob) -> tuple[PassFigures, ...]:
    """Measure every pass of cells, in burning order."""
    back = job.back if min(job.back.x_mm, job.back.y_mm) > 0 else None
    front_figures = _measure_face(job, job.front)
    back_figures = _measure_face(job, back) if back else [None] * len(front_figures)
    return tuple(
        PassFigures(laser_pass.name, front, rear)
        for laser_pass, front, rear in zip(job.cell_passes, front_figures, back_figures, strict=True)
    )


def burnt_cell_outlines_mm(laser_pass: LaserPass, beam: BeamFootprint) -> Points:
    """(N, P, 2) outlines of a pass' cavities in the bed's frame, in burning order, mm."""
    assert laser_pass.cavities is not None
    return burnt_outlines_mm(laser_pass.cavities, beam)


def made_pad(job: LaserJob) -> MadePad:
    """The pad with its cells as burnt at the side that the camera sees."""
    share = {"front": 0.0, "middle": 0.5, "back": 1.0}[job.nominal_face]
    nominal_beam = job.front.at_depth(share * job.setup.depth_mm, job.setup.taper_deg)
    cells: list[int] = []
    rings: list[Points] = []
    loss_mm = nominal_loss_mm = 0.0
    for laser_pass in job.cell_passes:
        cavities = laser_pass.cavities
        assert cavities is not None
        burnt = burnt_outlines_mm(cavities, job.seen)
        loss_mm = max(loss_mm, float(corner_losses_mm(cavities, burnt).max()))
        at_nominal = corner_losses_mm(cavities, burnt_outlines_mm(cavities, nominal_beam))
        nominal_loss_mm = max(nominal_loss_mm, float(at_nominal.max()))
        cells += cavities.cell.tolist()
        rings += list(drawn_outlines_mm(laser_pass, job) - job.origin_mm)
    outlines = dict(zip(cells, cut_by_later(rings), strict=True))
    causes = (
        Cause("the kerf (laser.kerf_mm)", CORNER_SHARE * nominal_loss_mm),
        Cause("laser.face", abs(loss_mm - nominal_loss_mm)),
    )
    in_order = [outlines[cell] for cell in job.layout.colored_cells.tolist()]
    return make_pad(job.layout, "laser", in_order, causes)


def drawn_outlines_mm(laser_pass: LaserPass, job: LaserJob) -> Points:
    """(N, P, 2) outlines of a pass' cavities at the side that the camera sees, in the bed's frame, with fewer points.

    Paths that are not compensated have no arcs: the shop compensates the kerf.
    """
    burnt = burnt_cell_outlines_mm(laser_pass, job.seen)
    return _fewer_points(burnt) if job.setup.compensated else burnt


def _fewer_points(outlines: Points) -> Points:
    """(N, P, 2) outlines with fewer points on their arcs; the ends of the arcs and of the sides are kept."""
    kept = np.array([0, *range(1, ARC_POINTS + 1, ARC_STRIDE), ARC_POINTS + 1])
    corners = outlines.shape[1] // (ARC_POINTS + 2)
    every: Points = outlines[:, (np.arange(corners)[:, None] * (ARC_POINTS + 2) + kept).ravel()]
    return every


def _measure_face(job: LaserJob, beam: BeamFootprint) -> list[FaceFigures]:
    figures: list[FaceFigures] = []
    filled: list[Points] = []
    filled_cavities: list[Cavities] = []
    reach_mm = WEB_REACH_PITCHES * float(job.layout.parameters["pitch_mm"])
    for laser_pass in job.cell_passes:
        cavities = laser_pass.cavities
        assert cavities is not None
        outlines = burnt_outlines_mm(cavities, beam)
        web = smallest_web_mm([cavities], [outlines], beam, reach_mm)
        to_filled = None
        if filled:
            to_filled = smallest_web_mm(
                [cavities, *filled_cavities], [outlines, *filled], beam, reach_mm, across=True
            )
            if to_filled is not None and to_filled <= 0:
                to_filled = -burn_depth_mm(outlines, np.concatenate(filled))
        figures.append(_face_figures(cavities, outlines, beam, web, to_filled))
        filled.append(outlines)
        filled_cavities.append(cavities)
    return figures


def _face_figures(
    cavities: Cavities, outlines: Points, beam: BeamFootprint, web: float | None, to_filled: float | None
) -> FaceFigures:
    nominal = polygon_areas(cavities.nominal_mm)
    burnt = burnt_areas_mm2(cavities, beam)
    errors = 100 * (burnt / nominal - 1)
    return FaceFigures(
        area_error_percent=_round_figure(100 * (float(burnt.sum()) / float(nominal.sum()) - 1)),
        area_error_worst_percent=_round_figure(float(errors[np.abs(errors).argmax()])),
        corner_loss_mm=_round_figure(float(corner_losses_mm(cavities, outlines).max())),
        burnt_beside_mm=_round_figure(float(np.maximum(burnt_reach_beside_mm(cavities, outlines), 0).max())),
        web_mm=None if web is None else _round_figure(web),
        web_to_filled_mm=None if to_filled is None else _round_figure(to_filled),
    )


def corner_losses_mm(cavities: Cavities, outlines: Points) -> NDArray[np.float64]:
    """(N, K) distance from each nominal corner to the nearest point of the burnt outline; 0 for a burnt corner."""
    corners = cavities.nominal_mm.shape[1]
    arcs = outlines.reshape(len(outlines), corners, -1, 2)
    gap = np.linalg.norm(arcs - cavities.nominal_mm[:, :, None], axis=-1).min(axis=2)
    # A burn that passes the corner along the spur has no loss.
    outward = cavities.nominal_mm - cavities.path_mm
    past = ((arcs - cavities.nominal_mm[:, :, None]) * outward[:, :, None]).sum(axis=-1).max(axis=2) > 0
    return np.where(past, 0.0, gap)


def burnt_reach_beside_mm(cavities: Cavities, outlines: Points) -> NDArray[np.float64]:
    """(N,) largest distance by which each burnt outline exceeds its cell's sides; negative inside the cell."""
    start = cavities.nominal_mm
    side = np.roll(start, -1, axis=1) - start
    outward = np.stack([side[..., 1], -side[..., 0]], axis=-1) / np.linalg.norm(side, axis=-1, keepdims=True)
    offset = (start * outward).sum(axis=-1)
    reach = (outlines[:, :, None] * outward[:, None]).sum(axis=-1) - offset[:, None]
    return np.asarray(reach.max(axis=(1, 2)))


def _round_figure(value: float) -> float:
    """Round to 6 decimals, so that every computer writes the same figure."""
    return round(value, 6) + 0.0
