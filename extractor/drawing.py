"""A step by synthesis: the pattern is drawn, and read against the image; again only around markers that still move.

One step is nearly all that can be had. Where a marker stepped far, its gridlines were not where they were read, and
what they said holds no longer: these cells are taken out of the drawing, drawn anew, and their gridlines are read once
more. All other votes stay valid, for where they were read.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .bending import hidden_misfit
from .engine import compiled
from .fit import Fit
from .gridlines import KNOWN, LENGTH
from .levels import Levels, black_at, cell_means, level_change, rebled, smooth_levels
from .offsets import Reading, foot_of
from .painting import draw_cells
from .presets import Steps
from .settling import SLOW, bent_share, effort, still_moving, touching, unsettled, usual_deviation
from .sight import Frame, Sight
from .step import Judged, heard, lines_of, loose_ones, placed, roughened, solved
from .stepping import box_of, middles, trust, votes, widening
from .synthesis import clear, edge_contrasts, read_gridlines
from .topology import Topology

MIN_SIGMA_PX = 0.4  # blur and pixel; the bare pixel has 0.29
MARGIN_SIGMA = 4.0
MAX_WIDEN = 0.3  # of the blur, in one step
SAME_BLUR = 0.02  # of the blur, by which it may be wrong in a drawing that is kept
SAME_LEVELS = 0.006  # likewise, of the levels. Both may be wrong by more where markers are by that:
NOISY_BLUR, NOISY_LEVELS = 0.5, 0.12  # of how far noise moves these, in units of the blur
NEAR_BLUR = 0.06  # of an edge; what is more blurred answers less simply to a shift
SMALL_BLUR = 0.12  # of a short edge; beyond that, blur, levels and places settle together;
BENT = 0.02  # of an edge, and where gridlines are bent by more,
MANY_BENT = 0.25  # of them, each step bends others. Then
HARD_EFFORT = 3.0  # times the effort is allowed
WIDE_BLUR = 0.1  # of a usual edge: where neighbours' errors look like bending
# Wide blur and low levels look alike: what a step sees of a change of blur is less than that by as much as it exceeds
# UNMIXED of an edge, times MIXED (rendered patterns), and at most by
MIXED, UNMIXED, MOST_MIXED = 7.2, 0.065, 0.8
# Gridlines overlap where blur is wide: a step falls short by the square of blur over edge, times OVERLAP (rendered
# patterns, shifted), and at most by
OVERLAP, MOST_OVERLAP = 6.75, 0.4
# Where no fewer markers move after so many more steps, what moves them is nothing that a drawing could explain.
PATIENCE = 1
MAX_STEPS = 10
MAX_AGAIN = 0.4  # of the markers may be drawn anew; for more, everything is
JUDGED_BY_PIXELS = Judged(3, 8, 0.0)
NO_ROOM = np.empty((0, 4))


class Drawing(NamedTuple):
    """The pattern as it is drawn, and what was read along its gridlines.

    Attributes:
        xy, lines, bend: where: the markers (M, 2), gridlines (E, 8) and their bending (E, 2).
        contrasts, black: (E, 3) across the gridlines, and under their middles.
        levels, bettered: as drawn, and as the cells' middles then said.
        sums: (E, 24), as ``read_gridlines`` gives them.
        box: of the image that is drawn. sigma: the blur. edge_px: a usual edge's length in it.
    """

    xy: NDArray[np.float64]
    lines: NDArray[np.float64]
    bend: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    black: NDArray[np.float64]
    levels: Levels
    bettered: Levels
    sums: NDArray[np.float64]
    box: NDArray[np.int64]
    sigma: float
    edge_px: float


class Draughtsman:
    """Takes steps by synthesis; the picture it draws is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology) -> None:
        self._mesh = mesh
        self._kept = threading.local()

    def picture(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """The pattern over black as it was last drawn in an image of this shape."""
        kept: Any = getattr(self._kept, "picture", None)
        if kept is None or kept.shape != shape:
            kept = self._kept.picture = np.zeros(shape, np.float32)
        return kept  # type: ignore[no-any-return]

    def steps(self, view: Sight, fit: Fit, steps: Steps, edge_px: float) -> Fit:
        """The fit after as many steps as it takes, or as a preset allows; ``edge_px`` is a short edge in the view."""
        wide = self._wide(fit, edge_px)
        fit, drawing = self._first(view, self._free(fit, wide))
        size, least, tries = drawing.edge_px, len(fit.xy), 0
        spent = effort(size)
        for step in range(MAX_STEPS - 1):
            fit = _farther(fit, drawing) if wide else fit
            near = steps.near * min(drawing.sigma, (NEAR_BLUR * edge_px) ** 2 / drawing.sigma)
            about = fit.measured, drawing.xy, fit.strides
            hard = not wide and _settles_slowly(fit, edge_px)
            anew, moving = still_moving(
                *about, near, steps.enough, 0.0 if hard else steps.few, self._mesh.edges
            )
            other = _looks_other(fit, drawing, steps.enough)
            everything = other or moving > MAX_AGAIN * len(anew)
            spent += effort(size, None if everything else moving / len(anew))
            allowed = steps.effort * (HARD_EFFORT if hard else 1.0)
            tries = tries + 1 if moving >= least and not other else 0
            if not (everything or moving) or tries > PATIENCE or (step > 0 and spent > allowed):
                break
            least = min(least, len(fit.xy) if other else moving)
            fit = self._free(placed(self._mesh, fit), wide)
            fit, drawing = self._first(view, fit) if everything else self._again(view, fit, drawing, anew)
        else:
            fit = _farther(fit, drawing) if wide else fit
        slow = SLOW * (drawing.sigma / size) ** 2 if wide else 0.0
        return fit._replace(unsettled=unsettled(fit.measured - drawing.xy, drawing.sigma, slow))

    def _wide(self, fit: Fit, edge_px: float) -> bool:
        """Whether a usual edge is blurred into the next; ``edge_px`` is a short one."""
        if fit.sigma < WIDE_BLUR * edge_px:
            return False
        return bool(fit.sigma > WIDE_BLUR * usual_length(lines_of(self._mesh, fit)))

    def _free(self, fit: Fit, wide: bool) -> Fit:
        """The fit with how freely its gridlines may bend: not at all where the blur is ``wide``. There they would
        follow what the markers beside them still lack, and these would hardly move."""
        if wide:
            return fit._replace(rough=np.zeros_like(fit.rough), bend=np.zeros_like(fit.bend))
        return roughened(self._mesh, fit)

    def _first(self, view: Sight, fit: Fit) -> tuple[Fit, Drawing]:
        """A step from everything."""
        image, mesh, levels, sigma = view.image, self._mesh, fit.levels, fit.sigma
        box = box_of(fit.xy, MARGIN_SIGMA * sigma + 2, image.shape[1], image.shape[0])
        lines, picture = lines_of(mesh, fit), self.picture(image.shape)
        contrasts = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        clear(picture, box)
        sides = mesh.cells, mesh.cell_edges, mesh.edges, lines
        draw_cells(fit.xy, *sides, levels.cell, levels.slope, sigma, box, picture)
        black = black_at(levels.black, middles(lines), *view.frame)
        sums = read_gridlines(image, picture, lines, contrasts, black, sigma, box, loose_ones(mesh, fit))
        bettered = self._bettered(view, picture, fit)
        about = levels, bettered, sums, box, sigma, usual_length(lines)
        drawing = Drawing(fit.xy, lines, fit.bend, contrasts, black, *about)
        return self._stepped(view.frame, fit._replace(levels=bettered), drawing), drawing

    def _again(self, view: Sight, fit: Fit, drawing: Drawing, anew: NDArray[np.bool_]) -> tuple[Fit, Drawing]:
        """A step from what was read, once more where gridlines end at markers that are ``anew`` (M,) bool."""
        image, mesh, levels, sigma = view.image, self._mesh, drawing.levels, drawing.sigma
        picture, box = self.picture(image.shape), drawing.box
        again, which = touching(anew, mesh.edges), touching(anew, mesh.cells)
        xy, bend = chosen(anew, fit.xy, drawing.xy), chosen(again, fit.bend, drawing.bend)
        fit = fit._replace(xy=xy, bend=bend)
        lines = chosen(again, lines_of(mesh, fit), drawing.lines)
        contrasts = edge_contrasts(lines, xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        cells = mesh.cells[which], mesh.cell_edges[which], mesh.edges
        cell, slope = levels.cell[which], levels.slope[which]
        draw_cells(drawing.xy, *cells, drawing.lines, -cell, -slope, sigma, box, picture)
        draw_cells(xy, *cells, lines, cell, slope, sigma, box, picture)
        black = black_at(levels.black, middles(lines), *view.frame)
        some = lines.copy()
        some[~again, KNOWN] = 0.0
        sums = read_gridlines(image, picture, some, contrasts, black, sigma, box, loose_ones(mesh, fit))
        drawing = drawing._replace(
            xy=xy,
            lines=lines,
            bend=bend,
            contrasts=chosen(again, contrasts, drawing.contrasts),
            black=chosen(again, black, drawing.black),
            sums=chosen(again, sums, drawing.sums),
        )
        return self._stepped(view.frame, fit, drawing), drawing

    def _stepped(self, frame: Frame, fit: Fit, drawing: Drawing) -> Fit:
        """The fit after the step that what was read asks for."""
        mesh, levels, bettered = self._mesh, drawing.levels, drawing.bettered
        lines, contrasts, sigma = drawing.lines, drawing.contrasts, drawing.sigma
        sums = drawing.sums.copy()
        changes = bettered.cell - levels.cell, bettered.black - levels.black
        said = votes(sums, contrasts, mesh.edge_cells, *changes, middles(lines), *frame)
        fit, told = heard(mesh, fit._replace(sigma=sigma), lines, sums, said, JUDGED_BY_PIXELS)
        pardon = hidden_misfit(fit.loose, contrasts, sigma)
        use, noise = trust(sums, told.to_a, told.to_b, pardon, *JUDGED_BY_PIXELS)
        fit = fit._replace(noise=float(noise) if np.isfinite(noise) else fit.noise)
        foot = foot_of(contrasts, drawing.black, said[2])
        fit = solved(mesh, fit, told, use, lines, contrasts, True)
        reading = Reading(lines, contrasts, foot, NO_ROOM, use, sigma, fit.noise, True)
        wider = self._widened(fit.xy, drawing, sums, use)
        if max(wider, sigma) > UNMIXED * drawing.edge_px:
            bettered = rebled(bettered, fit.xy, mesh, sigma, wider)
        return fit._replace(sigma=wider, levels=bettered, reading=reading)

    def _widened(
        self, xy: NDArray[np.float64], drawing: Drawing, sums: NDArray[np.float64], use: NDArray[np.float64]
    ) -> float:
        """The blur that the gridlines say, px."""
        mesh, lines, bettered, sigma = self._mesh, drawing.lines, drawing.bettered, drawing.sigma
        now = edge_contrasts(lines, xy, mesh.cells, mesh.edge_cells, bettered.cell, bettered.slope)
        wider = widening(sums, use, drawing.contrasts, now, sigma)
        wider /= 1.0 - min(max(MIXED * (sigma / drawing.edge_px - UNMIXED), 0.0), MOST_MIXED)
        return max(sigma + float(np.clip(wider, -MAX_WIDEN * sigma, MAX_WIDEN * sigma)), MIN_SIGMA_PX)

    def _bettered(self, view: Sight, picture: NDArray[np.float32], fit: Fit) -> Levels:
        """Levels corrected by what the drawing does not explain in the middle of the cells."""
        mesh = self._mesh
        drawn = cell_means(view.image, picture, fit.xy, mesh.cells, 0.0)
        black = cell_means(view.image, picture, fit.xy, mesh.black, 0.0)
        drawn[:, :3] += fit.levels.cell
        return smooth_levels(drawn, black, fit.xy, mesh, fit.noise, view.frame)


def _farther(fit: Fit, drawing: Drawing) -> Fit:
    """The fit after a step that goes as far as it would have gone, did gridlines not overlap."""
    hidden = min(OVERLAP * (drawing.sigma / drawing.edge_px) ** 2, MOST_OVERLAP)
    more = hidden / (1.0 - hidden) * (fit.measured - drawing.xy)
    return fit._replace(measured=fit.measured + more, guiding=fit.guiding + more)


def _settles_slowly(fit: Fit, edge_px: float) -> bool:
    """Whether some gridlines are much blurred for their length, or many are bent; ``edge_px`` is a short edge."""
    return fit.sigma > SMALL_BLUR * edge_px or bool(bent_share(fit.bend, BENT * edge_px) > MANY_BENT)


def _looks_other(fit: Fit, drawing: Drawing, enough: float) -> bool:
    """Whether the blur or the levels were found to be others than those drawn, by more than what noise of ``enough``
    standard deviations of a marker makes of them."""
    blur = abs(fit.sigma - drawing.sigma) / drawing.sigma
    levels = level_change(drawing.levels.cell, fit.levels.cell)
    if blur < SAME_BLUR and levels < SAME_LEVELS:
        return False
    noise = enough * usual_deviation(fit.information.diagonal) / drawing.sigma
    return bool(blur > max(SAME_BLUR, NOISY_BLUR * noise) or levels > max(SAME_LEVELS, NOISY_LEVELS * noise))


@compiled
def usual_length(lines):  # type: ignore[no-untyped-def]
    """The median length of the known gridlines (E, 8), px; 1 without any."""
    known = lines[lines[:, KNOWN] > 0.0, LENGTH]
    return np.median(known) if known.shape[0] > 0 else 1.0


@compiled
def chosen(which, ones, others):  # type: ignore[no-untyped-def]
    """Rows of ``ones`` where ``which``, of ``others`` elsewhere."""
    out = others.copy()
    for i in range(which.shape[0]):
        if which[i]:
            out[i] = ones[i]
    return out
