"""A step by synthesis: the pattern is drawn, and read against the image; again only around markers that still move.

One step is nearly all that can be had. Where a marker stepped far, its gridlines were not where they were read, and
what they said holds no longer: a step is taken around it, between all others, whose votes stay valid for where they
were read.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Frame, Sight
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.presets import Steps
from extractor.refine.drawn_pattern import Board, Drawing, drawn, room_for
from extractor.refine.estimate import Fit
from extractor.refine.measure.gridline_bending import hidden_misfit
from extractor.refine.measure.gridline_offsets import Reading, foot_of
from extractor.refine.measure.gridline_weights import middles, trust, votes, widening
from extractor.refine.partial_step import stepped_around
from extractor.refine.refinement_step import JUDGED_BY_PIXELS, listened, moved_on, placed, roughened, solution
from extractor.refine.solve.convergence import (
    SLOW,
    bent_share,
    effort,
    still_moving,
    unsettled,
    usual_deviation,
)
from extractor.refine.synthesis.blur_bleed import rebled
from extractor.refine.synthesis.dot_gain import swelling_of, unswollen
from extractor.refine.synthesis.ink_levels import level_change
from extractor.refine.synthesis.residual_kernel import edge_contrasts

MIN_SIGMA_PX = 0.4  # blur and pixel; the bare pixel has 0.29
MAX_WIDEN = 0.3  # of the blur, in one step
SAME_BLUR = 0.03  # of the blur, by which it may be wrong in a drawing that is kept
SAME_LEVELS = 0.006  # likewise, of the levels. Both may be wrong by more where markers are by that:
NOISY_BLUR, NOISY_LEVELS = 0.75, 0.18  # of how far noise moves these, in units of the blur
MOST_BLUR = 0.2  # of the blur, which no noise explains
SMALL_BLUR = 0.12  # of a short edge; beyond that, blur, levels and places settle together;
BENT = 0.02  # of an edge, and where gridlines are bent by more,
MANY_BENT = 0.25  # of them, each step bends others. Then
HARD_EFFORT = 1.5  # times the effort is allowed
WIDE_BLUR = 0.1  # of a usual edge: where neighbours' errors look like bending
# Wide blur and low levels look alike: what a step sees of a change of blur is less than that by as much as it exceeds
# UNMIXED of an edge, times MIXED (rendered patterns), and at most by
MIXED, UNMIXED, MOST_MIXED = 7.2, 0.065, 0.8
# Gridlines overlap where blur is wide: a step falls short by the square of blur over edge, times OVERLAP (rendered
# patterns, shifted), and at most by
OVERLAP, MOST_OVERLAP = 6.75, 0.4
WIDE_PATIENCE = 2  # more steps there at least, after which no fewer markers move,
WIDE_EFFORT = 0.6  # and of the effort allowed, so much in images of
USUAL_PIXELS = 640 * 480  # and more in larger ones, which take longer anyway
MAX_STEPS = 10
EXPLAINED = 2.0  # times the noise inside the cells: what a drawing leaves that explains all but dirt
BOARDS = 2  # kept, for images of so many shapes: a frame, and its coarser view
MAX_AGAIN = 0.7  # of the markers may be drawn anew; for more, everything is
AFTER_DIRT = 0.45  # of them, once dirt has moved some: it is dirt that moves so many, too
NO_ROOM = np.empty((0, 4))


class Draughtsman:
    """Takes steps by synthesis; the picture it draws is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology) -> None:
        self._mesh = mesh
        self._kept = threading.local()

    def board(self, shape: tuple[int, ...]) -> Board:
        """With the pattern over black as it was last drawn in an image of this shape."""
        boards: dict[tuple[int, ...], Board] | None = getattr(self._kept, "boards", None)
        if boards is None:
            boards = self._kept.boards = {}
        if shape not in boards:
            while len(boards) >= BOARDS:
                del boards[next(iter(boards))]
            boards[shape] = room_for(shape, self._mesh)
        return boards[shape]

    def approach(self, view: Sight, fit: Fit) -> tuple[Fit, float]:
        """The fit after a first step from everything, and its effort: far from the markers' places, gridlines that may
        bend would follow what these still lack."""
        fit, drawing = self._first(view, _stiff(fit))
        return _farther(fit, drawing), effort(drawing.edge_px)

    def steps(
        self, view: Sight, fit: Fit, steps: Steps, edge_px: float, usual_px: float, spent: float = 0.0
    ) -> Fit:
        """The fit after as many steps as it takes, or as a preset allows.

        Args:
            edge_px, usual_px: a short edge in the view, and a usual one, if these are much blurred.
            spent: the effort of a step that has already been taken.
        """
        begun = spent > 0.0
        wide = fit.sigma > WIDE_BLUR * usual_px  # a usual edge is blurred into the next
        fit, drawing = self._first(view, self._free(fit, wide))
        size, least, tries, soiled = drawing.edge_px, len(fit.xy), 0, False
        share = _share_where_wide(view) if wide else 1.0
        patience = max(steps.patience, WIDE_PATIENCE) if wide else steps.patience
        many = 1.0 if wide else steps.many
        resolved = np.inf if wide or steps.near == 0.0 else SMALL_BLUR
        spent += effort(size)
        for step in range(MAX_STEPS - 1):
            there = _farther(fit, drawing)
            hard = not wide and _settles_slowly(fit, edge_px)
            allowed = steps.effort * (HARD_EFFORT if hard else share)
            if (begun or step > 0) and spent + effort(size, 0.0) > allowed:
                break  # whatever still moves
            assert fit.reading is not None
            moves = there.measured, drawing.xy, fit.strides
            explained = fit.noise < EXPLAINED * fit.grain
            rule = steps.near, drawing.sigma, resolved, steps.enough, steps.few, many, steps.most, explained
            tables = fit.reading.use, self._mesh.spokes, self._mesh.edges
            anew, moving, dirty = still_moving(*moves, *rule, *tables)
            other = _looks_other(fit, drawing, steps.enough) and (wide or not dirty)
            count = np.count_nonzero(anew)
            everything = bool(other or count > MAX_AGAIN * len(anew))
            spent += effort(size, None if everything else count / len(anew))
            tries = tries + 1 if moving >= least and not other else 0
            soiled = soiled or dirty
            by_dirt = dirty or (soiled and count > AFTER_DIRT * len(anew))
            ended = tries == patience or (by_dirt and not everything and step >= steps.in_dirt)
            if not (everything or moving) or ended or ((begun or step > 0) and spent > allowed):
                break
            least = min(least, len(fit.xy) if other else moving)
            if everything:
                fit, drawing = self._first(view, self._free(placed(self._mesh, there), wide))
            else:
                fit = fit._replace(guiding=there.guiding)
                fit, drawing = self._again(view, fit, drawing, anew, wide)
        else:
            there = _farther(fit, drawing)
        slow = SLOW * (drawing.sigma / size) ** 2 if wide else 0.0
        return there._replace(unsettled=unsettled(there.measured - drawing.xy, drawing.sigma, slow))

    def _free(self, fit: Fit, wide: bool) -> Fit:
        """The fit with how freely its gridlines may bend: not at all where the blur is ``wide``. There they would
        follow what the markers beside them still lack, and these would hardly move."""
        return _stiff(fit) if wide else roughened(self._mesh, fit)

    def _first(self, view: Sight, fit: Fit) -> tuple[Fit, Drawing]:
        """A step from everything."""
        drawing = drawn(view, self._mesh, fit, self.board(view.image.shape))
        return self._stepped(view.frame, fit, drawing), drawing

    def _again(
        self, view: Sight, fit: Fit, drawing: Drawing, anew: NDArray[np.bool_], wide: bool
    ) -> tuple[Fit, Drawing]:
        """A step around the markers that are ``anew`` (M,) bool, from what else was read."""
        return stepped_around(view, self._mesh, fit, drawing, anew, self.board(view.image.shape), wide)

    def _stepped(self, frame: Frame, fit: Fit, drawing: Drawing) -> Fit:
        """The fit after the step that what was read asks for."""
        mesh, levels, bettered = self._mesh, drawing.levels, drawing.bettered
        assert fit.reading is not None
        changes = bettered.cell - levels.cell, bettered.black - levels.black
        now = fit.xy, fit.beyond, fit.rough, drawing.bend, fit.reading.use, fit.noise
        seen = drawing.lines, drawing.contrasts, drawing.black, drawing.sums, drawing.sigma
        tables = mesh.edges, mesh.spokes, mesh.cells, mesh.edge_cells
        inks = bettered.cell, bettered.slope
        read, wider, noise, *step = _step(seen, changes, inks, now, tables, tuple(frame))
        use, usual, loose, foot, swelling, aside = read
        how = NO_ROOM, use, aside, drawing.sigma, noise, True
        reading = Reading(drawing.lines, drawing.contrasts, foot, *how)
        sigma = _widened(drawing.sigma, drawing.edge_px, wider)
        if max(sigma, drawing.sigma) > UNMIXED * drawing.edge_px:
            bettered = rebled(bettered, fit.xy, mesh, drawing.sigma, sigma)
        about = {"loose": loose, "reading": reading, "noise": noise, "sigma": sigma, "levels": bettered}
        return moved_on(fit, step, usual=usual, swelling=swelling, **about)


@compiled
def _step(seen, changes, inks, now, tables, frame):  # type: ignore[no-untyped-def]
    """Use, usual misfit, looseness and foot of what was ``seen``, by how much cells are swollen, and gridlines aside
    for it; by how much it says that the blur is larger; its noise; and the solution.

    Args:
        seen: lines, contrasts, black, sums and blur of a drawing.
        changes: of the cells' levels (K, 3) and of the black's polynomial (3, 10) since.
        inks: the levels now, and their slopes.
    """
    lines, contrasts, black, read, sigma = seen
    xy, beyond, rough, bend, before, noise = now
    edges, spokes, cells, edge_cells = tables
    values, least, unjudged = JUDGED_BY_PIXELS
    sums = read.copy()
    cell_change, black_change = changes
    to_a, to_b, off = votes(sums, contrasts, edge_cells, cell_change, black_change, middles(lines), *frame)
    swelling = swelling_of(sums, to_a, to_b, contrasts, edge_cells, sigma)
    aside = unswollen(sums, to_a, to_b, contrasts, edge_cells, swelling)
    said = bend, rough, before, lines, edges, noise
    loose, kept = listened(sums, to_a, to_b, off, *said, values, least, unjudged)
    use, usual, found = trust(
        sums, to_a, to_b, hidden_misfit(loose, contrasts, sigma), values, least, unjudged
    )
    noise = found if np.isfinite(found) else noise
    where = xy, beyond, edges, spokes, sigma, noise, True
    step = solution(sums, to_a, to_b, bend, kept, use, lines, contrasts, *where)
    current = edge_contrasts(lines, xy, cells, edge_cells, inks[0], inks[1])
    wider = widening(sums, aside, use, contrasts, current, sigma)
    return ((use, usual, loose, foot_of(contrasts, black, off), swelling, aside), wider, noise) + step


def _stiff(fit: Fit) -> Fit:
    """The fit with gridlines that may not bend."""
    return fit._replace(rough=np.zeros_like(fit.rough), bend=np.zeros_like(fit.bend))


def _widened(sigma: float, edge_px: float, wider: float) -> float:
    """The blur, px, where gridlines say that it is so much ``wider`` than was drawn."""
    wider /= 1.0 - min(max(MIXED * (sigma / edge_px - UNMIXED), 0.0), MOST_MIXED)
    return max(sigma + min(max(wider, -MAX_WIDEN * sigma), MAX_WIDEN * sigma), MIN_SIGMA_PX)


def _farther(fit: Fit, drawing: Drawing) -> Fit:
    """The fit after a step that goes as far as it would have gone, did gridlines not overlap."""
    hidden = min(OVERLAP * (drawing.sigma / drawing.edge_px) ** 2, MOST_OVERLAP)
    more = hidden / (1.0 - hidden) * (fit.measured - drawing.xy)
    measured = fit.measured + more
    return fit._replace(measured=measured, guiding=np.where(np.isnan(fit.guiding), np.nan, measured))


def _share_where_wide(view: Sight) -> float:
    """Of the effort that a preset allows."""
    pixels = view.image.shape[0] * view.image.shape[1] * view.scale**2
    return float(min(WIDE_EFFORT * max(pixels / USUAL_PIXELS, 1.0), 1.0))


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
    same = min(max(SAME_BLUR, NOISY_BLUR * noise), MOST_BLUR), max(SAME_LEVELS, NOISY_LEVELS * noise)
    return bool(blur > same[0] or levels > same[1])
