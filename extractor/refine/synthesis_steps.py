"""A step by synthesis: the pattern is drawn, and read against the image; again only around markers that still move.

One step is nearly all that can be had. Where a marker stepped far, its gridlines were not where they were read, and
what they said holds no longer: a step is taken around it, between all others, whose votes stay valid for where they
were read.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PolynomialFrame, PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.presets import Schedule
from extractor.refine.drawn_pattern import DrawingBuffers, Synthesis, allocate_drawing_buffers, draw_pattern
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import bending_misfit
from extractor.refine.measure.gridline_offsets import GridlineReading, foot_levels
from extractor.refine.measure.gridline_weights import (
    blur_change,
    chord_midpoints,
    shift_gradients,
    weigh_gridlines,
)
from extractor.refine.partial_step import partial_step
from extractor.refine.refinement_step import (
    PIXEL_MISFIT_RULE,
    solve_step,
    update_for_bending,
    with_pattern_moved,
    with_roughness,
    with_solution,
)
from extractor.refine.solve.convergence import (
    WIDE_BLUR_REMAINDER,
    bent_share,
    convergence_covariance,
    median_deviation,
    step_effort,
    unconverged_markers,
)
from extractor.refine.synthesis.blur_bleed import adapt_levels_to_blur
from extractor.refine.synthesis.dot_gain import measure_dot_gain, update_without_dot_gain
from extractor.refine.synthesis.ink_levels import level_change
from extractor.refine.synthesis.residual_kernel import update_known_contrasts

MIN_SIGMA_PX = 0.4  # blur and pixel; the bare pixel has 0.29
MAX_BLUR_CHANGE = 0.3  # of the blur, in one step
BLUR_TOLERANCE = 0.03  # of the blur, by which it may be wrong in a drawing that is kept
LEVEL_TOLERANCE = 0.006  # likewise, of the levels. Both may be wrong by more where markers are by that:
BLUR_NOISE_FACTOR, LEVEL_NOISE_FACTOR = 0.75, 0.18  # of how far noise moves these, in units of the blur
MAX_BLUR_TOLERANCE = 0.2  # of the blur, which no noise explains
SMALL_BLUR = 0.12  # of a short edge; beyond that, blur, levels and places settle together;
MIN_BEND = 0.02  # of an edge, and where gridlines are bent by more,
MAX_BENT_SHARE = 0.25  # of them, each step bends others. Then
HARD_EFFORT = 1.5  # times the effort is allowed
WIDE_BLUR = 0.1  # of a usual edge: where neighbours' errors look like bending
# Wide blur and low levels look alike: what a step sees of a change of blur is less than that by as much as it exceeds
# UNMIXED of an edge, times MIXED (rendered patterns), and at most by
BLUR_LEVEL_COUPLING, UNCOUPLED_BLUR, MAX_COUPLING = 7.2, 0.065, 0.8
# Gridlines overlap where blur is wide: a step falls short by the square of blur over edge, times OVERLAP (rendered
# patterns, shifted), and at most by
OVERLAP_FACTOR, MAX_OVERLAP = 6.75, 0.4
WIDE_PATIENCE = 2  # more steps there at least, after which no fewer markers move,
WIDE_EFFORT = 0.6  # and of the effort allowed, so much in images of
USUAL_PIXELS = 640 * 480  # and more in larger ones, which take longer anyway
MAX_STEPS = 10
MAX_EXPLAINED_NOISE = (
    2.0  # times the noise inside the cells: what a drawing leaves that explains all but dirt
)
MAX_BUFFERS = 2  # kept, for images of so many shapes: a frame, and its coarser view
MAX_PARTIAL_SHARE = 0.7  # of the markers may be drawn anew; for more, everything is
MAX_PARTIAL_SHARE_DIRTY = 0.45  # of them, once dirt has moved some: it is dirt that moves so many, too
NO_CLEARANCE = np.empty((0, 4))


class SynthesisSolver:
    """Takes steps by synthesis; the picture it draws is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology) -> None:
        self._mesh = mesh
        self._kept = threading.local()

    def buffers(self, shape: tuple[int, ...]) -> DrawingBuffers:
        """With the pattern over black as it was last drawn in an image of this shape."""
        boards: dict[tuple[int, ...], DrawingBuffers] | None = getattr(self._kept, "boards", None)
        if boards is None:
            boards = self._kept.boards = {}
        if shape not in boards:
            while len(boards) >= MAX_BUFFERS:
                del boards[next(iter(boards))]
            boards[shape] = allocate_drawing_buffers(shape, self._mesh)
        return boards[shape]

    def first_step(self, view: PyramidLevel, fit: Estimate) -> tuple[Estimate, float]:
        """The fit after a first step from everything, and its effort: far from the markers' places, gridlines that may
        bend would follow what these still lack."""
        fit, drawing = self._full_step(view, _without_bending(fit))
        return _overlap_corrected(fit, drawing), step_effort(drawing.edge_px)

    def steps(
        self,
        view: PyramidLevel,
        fit: Estimate,
        steps: Schedule,
        edge_px: float,
        usual_px: float,
        spent: float = 0.0,
    ) -> Estimate:
        """The fit after as many steps as it takes, or as a preset allows.

        Args:
            edge_px, usual_px: a short edge in the view, and a usual one, if these are much blurred.
            spent: the effort of a step that has already been taken.
        """
        begun = spent > 0.0
        wide = fit.sigma > WIDE_BLUR * usual_px  # a usual edge is blurred into the next
        fit, drawing = self._full_step(view, self._with_bending(fit, wide))
        size, least, tries, soiled = drawing.edge_px, len(fit.xy), 0, False
        share = _wide_blur_effort_share(view) if wide else 1.0
        patience = max(steps.patience, WIDE_PATIENCE) if wide else steps.patience
        many = 1.0 if wide else steps.max_partial_share
        resolved = np.inf if wide or steps.near == 0.0 else SMALL_BLUR
        spent += step_effort(size)
        for step in range(MAX_STEPS - 1):
            there = _overlap_corrected(fit, drawing)
            hard = not wide and _converges_slowly(fit, edge_px)
            allowed = steps.max_synthesis_effort * (HARD_EFFORT if hard else share)
            if (begun or step > 0) and spent + step_effort(size, 0.0) > allowed:
                break  # whatever still moves
            assert fit.reading is not None
            moves = there.measured, drawing.xy, fit.normalized_steps
            explained = fit.noise < MAX_EXPLAINED_NOISE * fit.pixel_noise
            rule = (
                steps.near,
                drawing.sigma,
                resolved,
                steps.converged_deviations,
                steps.max_moving_share,
                many,
                steps.max_partial_share_in_dirt,
                explained,
            )
            tables = fit.reading.weight, self._mesh.spokes, self._mesh.edges
            anew, moving, dirty = unconverged_markers(*moves, *rule, *tables)
            other = _has_appearance_changed(fit, drawing, steps.converged_deviations) and (wide or not dirty)
            count = np.count_nonzero(anew)
            everything = bool(other or count > MAX_PARTIAL_SHARE * len(anew))
            spent += step_effort(size, None if everything else count / len(anew))
            tries = tries + 1 if moving >= least and not other else 0
            soiled = soiled or dirty
            by_dirt = dirty or (soiled and count > MAX_PARTIAL_SHARE_DIRTY * len(anew))
            ended = tries == patience or (by_dirt and not everything and step >= steps.max_steps_in_dirt)
            if not (everything or moving) or ended or ((begun or step > 0) and spent > allowed):
                break
            least = min(least, len(fit.xy) if other else moving)
            if everything:
                fit, drawing = self._full_step(
                    view, self._with_bending(with_pattern_moved(self._mesh, there), wide)
                )
            else:
                fit = fit._replace(reliable=there.reliable)
                fit, drawing = self._partial_step(view, fit, drawing, anew, wide)
        else:
            there = _overlap_corrected(fit, drawing)
        slow = WIDE_BLUR_REMAINDER * (drawing.sigma / size) ** 2 if wide else 0.0
        return there._replace(
            convergence_cov_px2=convergence_covariance(there.measured - drawing.xy, drawing.sigma, slow)
        )

    def _with_bending(self, fit: Estimate, wide: bool) -> Estimate:
        """The fit with how freely its gridlines may bend: not at all where the blur is ``wide``. There they would
        follow what the markers beside them still lack, and these would hardly move."""
        return _without_bending(fit) if wide else with_roughness(self._mesh, fit)

    def _full_step(self, view: PyramidLevel, fit: Estimate) -> tuple[Estimate, Synthesis]:
        """A step from everything."""
        drawing = draw_pattern(view, self._mesh, fit, self.buffers(view.image.shape))
        return self._update_estimate(view.frame, fit, drawing), drawing

    def _partial_step(
        self, view: PyramidLevel, fit: Estimate, drawing: Synthesis, anew: NDArray[np.bool_], wide: bool
    ) -> tuple[Estimate, Synthesis]:
        """A step around the markers that are ``anew`` (M,) bool, from what else was read."""
        return partial_step(view, self._mesh, fit, drawing, anew, self.buffers(view.image.shape), wide)

    def _update_estimate(self, frame: PolynomialFrame, fit: Estimate, drawing: Synthesis) -> Estimate:
        """The fit after the step that what was read asks for."""
        mesh, levels, bettered = self._mesh, drawing.levels, drawing.corrected_levels
        assert fit.reading is not None
        changes = bettered.cell - levels.cell, bettered.black - levels.black
        now = fit.xy, fit.beyond, fit.roughness, drawing.bend, fit.reading.weight, fit.noise
        seen = drawing.lines, drawing.contrasts, drawing.black, drawing.sums, drawing.sigma
        tables = mesh.edges, mesh.spokes, mesh.cells, mesh.edge_cells
        inks = bettered.cell, bettered.slope
        read, wider, noise, *step = _update_and_solve(seen, changes, inks, now, tables, tuple(frame))
        use, usual, loose, foot, swelling, aside = read
        how = NO_CLEARANCE, use, aside, drawing.sigma, noise, True
        reading = GridlineReading(drawing.lines, drawing.contrasts, foot, *how)
        sigma = _blur_after_step(drawing.sigma, drawing.edge_px, wider)
        if max(sigma, drawing.sigma) > UNCOUPLED_BLUR * drawing.edge_px:
            bettered = adapt_levels_to_blur(bettered, fit.xy, mesh, drawing.sigma, sigma)
        about = {
            "bend_variance": loose,
            "reading": reading,
            "noise": noise,
            "sigma": sigma,
            "levels": bettered,
        }
        return with_solution(fit, step, median_misfit=usual, dot_gain=swelling, **about)


@compiled
def _update_and_solve(seen, changes, inks, now, tables, frame):  # type: ignore[no-untyped-def]
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
    values, least, unjudged = PIXEL_MISFIT_RULE
    sums = read.copy()
    cell_change, black_change = changes
    to_a, to_b, off = shift_gradients(
        sums, contrasts, edge_cells, cell_change, black_change, chord_midpoints(lines), *frame
    )
    swelling = measure_dot_gain(sums, to_a, to_b, contrasts, edge_cells, sigma)
    aside = update_without_dot_gain(sums, to_a, to_b, contrasts, edge_cells, swelling)
    said = bend, rough, before, lines, edges, noise
    loose, kept = update_for_bending(sums, to_a, to_b, off, *said, values, least, unjudged)
    use, usual, found = weigh_gridlines(
        sums, to_a, to_b, bending_misfit(loose, contrasts, sigma), values, least, unjudged
    )
    noise = found if np.isfinite(found) else noise
    where = xy, beyond, edges, spokes, sigma, noise, True
    step = solve_step(sums, to_a, to_b, bend, kept, use, lines, contrasts, *where)
    current = update_known_contrasts(lines, xy, cells, edge_cells, inks[0], inks[1])
    wider = blur_change(sums, aside, use, contrasts, current, sigma)
    return ((use, usual, loose, foot_levels(contrasts, black, off), swelling, aside), wider, noise) + step


def _without_bending(fit: Estimate) -> Estimate:
    """The fit with gridlines that may not bend."""
    return fit._replace(roughness=np.zeros_like(fit.roughness), bend=np.zeros_like(fit.bend))


def _blur_after_step(sigma: float, edge_px: float, wider: float) -> float:
    """The blur, px, where gridlines say that it is so much ``wider`` than was drawn."""
    wider /= 1.0 - min(max(BLUR_LEVEL_COUPLING * (sigma / edge_px - UNCOUPLED_BLUR), 0.0), MAX_COUPLING)
    return max(sigma + min(max(wider, -MAX_BLUR_CHANGE * sigma), MAX_BLUR_CHANGE * sigma), MIN_SIGMA_PX)


def _overlap_corrected(fit: Estimate, drawing: Synthesis) -> Estimate:
    """The fit after a step that goes as far as it would have gone, did gridlines not overlap."""
    hidden = min(OVERLAP_FACTOR * (drawing.sigma / drawing.edge_px) ** 2, MAX_OVERLAP)
    more = hidden / (1.0 - hidden) * (fit.measured - drawing.xy)
    measured = fit.measured + more
    return fit._replace(measured=measured, reliable=np.where(np.isnan(fit.reliable), np.nan, measured))


def _wide_blur_effort_share(view: PyramidLevel) -> float:
    """Of the effort that a preset allows."""
    pixels = view.image.shape[0] * view.image.shape[1] * view.scale**2
    return float(min(WIDE_EFFORT * max(pixels / USUAL_PIXELS, 1.0), 1.0))


def _converges_slowly(fit: Estimate, edge_px: float) -> bool:
    """Whether some gridlines are much blurred for their length, or many are bent; ``edge_px`` is a short edge."""
    return fit.sigma > SMALL_BLUR * edge_px or bool(bent_share(fit.bend, MIN_BEND * edge_px) > MAX_BENT_SHARE)


def _has_appearance_changed(fit: Estimate, drawing: Synthesis, enough: float) -> bool:
    """Whether the blur or the levels were found to be others than those drawn, by more than what noise of
    ``converged_deviations``
    standard deviations of a marker makes of them."""
    blur = abs(fit.sigma - drawing.sigma) / drawing.sigma
    levels = level_change(drawing.levels.cell, fit.levels.cell)
    if blur < BLUR_TOLERANCE and levels < LEVEL_TOLERANCE:
        return False
    noise = enough * median_deviation(fit.information.diagonal) / drawing.sigma
    same = (
        min(max(BLUR_TOLERANCE, BLUR_NOISE_FACTOR * noise), MAX_BLUR_TOLERANCE),
        max(LEVEL_TOLERANCE, LEVEL_NOISE_FACTOR * noise),
    )
    return bool(blur > same[0] or levels > same[1])
