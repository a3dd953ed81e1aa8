"""Steps by synthesis: the pattern is drawn and compared with the image; again only around markers that still move.

One step is nearly enough. Where a marker stepped far, its gridlines were not where they were read, and their sums hold
no longer: a step is taken around it, between all other markers, whose sums stay valid.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.presets import Schedule
from extractor.refine.drawn_pattern import DrawingBuffers, Synthesis, allocate_drawing_buffers, draw_pattern
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import bending_misfit
from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.measure.gridline_weights import (
    ShiftGradients,
    blur_after_step,
    blur_change,
    update_for_blur,
    weigh_gridlines,
)
from extractor.refine.partial_step import partial_step
from extractor.refine.refinement_step import (
    PIXEL_MISFIT_RULE,
    BendingPrior,
    StepSolution,
    solve_step,
    update_for_bending,
    with_pattern_moved,
    with_roughness,
    with_solution,
)
from extractor.refine.solve.convergence import (
    WIDE_BLUR_REMAINDER,
    ConvergenceRule,
    bent_share,
    convergence_covariance,
    median_deviation,
    step_effort,
    unconverged_markers,
)
from extractor.refine.solve.fisher_information import GridlineSystem
from extractor.refine.synthesis.blur_bleed import levels_at_blur
from extractor.refine.synthesis.dot_gain import measure_dot_gain, update_without_dot_gain
from extractor.refine.synthesis.ink_levels import level_change
from extractor.refine.synthesis.residual_kernel import A, B

BLUR_TOLERANCE = 0.03  # relative error of the blur of a drawing that is kept
LEVEL_TOLERANCE = (
    0.006  # likewise, of the levels. Both may be larger where the markers' deviation explains it:
)
BLUR_NOISE_FACTOR, LEVEL_NOISE_FACTOR = (
    0.75,
    0.18,
)  # relative error per deviation of a marker in units of the blur
MAX_BLUR_TOLERANCE = 0.2  # relative error of the blur that no deviation explains
SMALL_BLUR = 0.12  # of a short edge; above that, blur, levels and places converge together;
MIN_BEND = 0.02  # of an edge, and where gridlines bend by more,
MAX_BENT_SHARE = 0.25  # of them, each step bends others. Then
HARD_EFFORT = 1.5  # times the effort is allowed
WIDE_BLUR = 0.1  # of a usual edge: above, the errors of neighbours look like bending
# Gridlines overlap where blur is wide: a step falls short by OVERLAP_FACTOR times the square of blur over edge
# (rendered patterns, shifted), at most by MAX_OVERLAP.
OVERLAP_FACTOR, MAX_OVERLAP = 6.75, 0.4
WIDE_PATIENCE = 2  # steps there at least, after which no fewer markers move,
WIDE_EFFORT = 0.6  # and share of the effort that is allowed in images of
USUAL_PIXELS = 640 * 480  # and more in larger ones, which take longer anyway
MAX_STEPS = 10
MAX_EXPLAINED_NOISE = 2.0  # times the noise inside the cells, in a drawing that explains all but dirt
MAX_BUFFERS = 2  # kept, for images of so many shapes: a frame, and its coarser view
MAX_PARTIAL_SHARE = 0.7  # of the markers that are drawn again; above, everything is
MAX_PARTIAL_SHARE_DIRTY = 0.45  # of them, once dirt has moved some: dirt moves so many, too
NO_CLEARANCE = np.empty((0, 4))


class SynthesisReading(NamedTuple):
    """The measurements along the gridlines of a drawing, and the solution.

    Attributes:
        weight: (E,) 0 to 1.
        median_misfit: squared gray levels.
        bend_variance: (E,) px^2.
        dot_gain: px.
        dot_gain_offset: (E,) px.
        sigma: px, the blur after the step.
        noise: gray levels, one channel.
        solution: the markers after the step.
    """

    weight: NDArray[np.float64]
    median_misfit: float
    bend_variance: NDArray[np.float64]
    dot_gain: float
    dot_gain_offset: NDArray[np.float64]
    sigma: float
    noise: float
    solution: StepSolution


class SynthesisSolver:
    """Takes steps by synthesis. The picture that it draws is kept from image to image, one for each thread.

    Copies and pickles have no picture; they draw their own.
    """

    def __init__(self, topology: Topology) -> None:
        self._topology = topology
        self._kept = threading.local()

    def __getstate__(self) -> dict[str, Any]:
        """All but the pictures of the threads."""
        return {name: value for name, value in self.__dict__.items() if name != "_kept"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._kept = threading.local()

    def buffers(self, shape: tuple[int, ...]) -> DrawingBuffers:
        """The thread's buffers for images of a shape (H, W, 3), with the pattern as it was last drawn."""
        kept: dict[tuple[int, ...], DrawingBuffers] | None = getattr(self._kept, "buffers", None)
        if kept is None:
            kept = self._kept.buffers = {}
        if shape not in kept:
            while len(kept) >= MAX_BUFFERS:
                del kept[next(iter(kept))]
            kept[shape] = allocate_drawing_buffers(shape, self._topology)
        return kept[shape]

    def first_step(self, view: PyramidLevel, estimate: Estimate) -> tuple[Estimate, float]:
        """The estimate after a first step from everything, and the effort.

        No gridline may bend: far from the markers' places, gridlines would take up the error of the markers.
        """
        estimate, drawing = self._full_step(view, _without_bending(estimate))
        return _overlap_corrected(estimate, drawing), step_effort(drawing.edge_px)

    def steps(
        self,
        view: PyramidLevel,
        estimate: Estimate,
        schedule: Schedule,
        edge_px: float,
        usual_px: float,
        spent: float = 0.0,
    ) -> Estimate:
        """The estimate after steps until it converges, or as many as a preset allows.

        Args:
            view: the image.
            estimate: with its pattern where the last step left the markers.
            schedule: of the preset.
            edge_px, usual_px: a short edge in the view, and a usual one, if these are much blurred.
            spent: the effort of a step that has already been taken.
        """
        begun = spent > 0.0
        wide_blur = estimate.sigma > WIDE_BLUR * usual_px  # a usual edge is blurred into the next
        estimate, drawing = self._full_step(view, self._with_bending(estimate, wide_blur))
        drawn_edge_px, least_moving, idle_steps, dirt_found = drawing.edge_px, len(estimate.xy), 0, False
        effort_share = _wide_blur_effort_share(view) if wide_blur else 1.0
        patience = max(schedule.patience, WIDE_PATIENCE) if wide_blur else schedule.patience
        spent += step_effort(drawn_edge_px)
        for step in range(MAX_STEPS - 1):
            corrected = _overlap_corrected(estimate, drawing)
            slow = not wide_blur and _converges_slowly(estimate, edge_px)
            allowed = schedule.max_synthesis_effort * (HARD_EFFORT if slow else effort_share)
            if (begun or step > 0) and spent + step_effort(drawn_edge_px, 0.0) > allowed:
                break
            redrawn, moving, dirty = self._unconverged(corrected, drawing, schedule, wide_blur)
            changed = _has_appearance_changed(estimate, drawing, schedule.converged_deviations) and (
                wide_blur or not dirty
            )
            count = np.count_nonzero(redrawn)
            everything = bool(changed or count > MAX_PARTIAL_SHARE * len(redrawn))
            spent += step_effort(drawn_edge_px, None if everything else count / len(redrawn))
            # what moves no fewer markers again and again is nothing that a drawing could explain
            idle_steps = idle_steps + 1 if moving >= least_moving and not changed else 0
            dirt_found = dirt_found or dirty
            by_dirt = dirty or (dirt_found and count > MAX_PARTIAL_SHARE_DIRTY * len(redrawn))
            ended = idle_steps == patience or (
                by_dirt and not everything and step >= schedule.max_steps_in_dirt
            )
            if not (everything or moving) or ended or ((begun or step > 0) and spent > allowed):
                break
            least_moving = min(least_moving, len(estimate.xy) if changed else moving)
            if everything:
                moved = with_pattern_moved(self._topology, corrected)
                estimate, drawing = self._full_step(view, self._with_bending(moved, wide_blur))
            else:
                estimate = estimate._replace(reliable=corrected.reliable)
                estimate, drawing = self._partial_step(view, estimate, drawing, redrawn, wide_blur)
        else:
            corrected = _overlap_corrected(estimate, drawing)
        remaining = WIDE_BLUR_REMAINDER * (drawing.sigma / drawn_edge_px) ** 2 if wide_blur else 0.0
        cov = convergence_covariance(corrected.measured - drawing.xy, drawing.sigma, remaining)
        return corrected._replace(convergence_cov_px2=cov)

    def _unconverged(
        self, estimate: Estimate, drawing: Synthesis, schedule: Schedule, wide_blur: bool
    ) -> tuple[NDArray[np.bool_], int, bool]:
        """``UnconvergedMarkers`` after a step."""
        assert estimate.reading is not None
        rule = ConvergenceRule(
            converged_blur_share=schedule.converged_blur_share,
            sigma=drawing.sigma,
            converged_deviations=schedule.converged_deviations,
            max_moving_share=schedule.max_moving_share,
            max_partial_share=1.0 if wide_blur else schedule.max_partial_share,
            max_partial_share_in_dirt=schedule.max_partial_share_in_dirt,
            explained=estimate.noise < MAX_EXPLAINED_NOISE * estimate.pixel_noise,
        )
        moves = estimate.measured, drawing.xy, estimate.normalized_steps
        tables = estimate.reading.weight, self._topology.spokes, self._topology.edges
        unconverged: tuple[NDArray[np.bool_], int, bool] = unconverged_markers(*moves, rule, *tables)
        return unconverged

    def _with_bending(self, estimate: Estimate, wide_blur: bool) -> Estimate:
        """The estimate with the roughness that lets its gridlines bend; with none where the blur is wide.

        There the gridlines would take up the error of the markers beside them, which would hardly move.
        """
        return _without_bending(estimate) if wide_blur else with_roughness(self._topology, estimate)

    def _full_step(self, view: PyramidLevel, estimate: Estimate) -> tuple[Estimate, Synthesis]:
        """A step from everything."""
        drawing = draw_pattern(view, self._topology, estimate, self.buffers(view.image.shape))
        return self._update_estimate(estimate, drawing), drawing

    def _partial_step(
        self,
        view: PyramidLevel,
        estimate: Estimate,
        drawing: Synthesis,
        redrawn: NDArray[np.bool_],
        wide_blur: bool,
    ) -> tuple[Estimate, Synthesis]:
        """A step around the markers to draw again (M,) bool, with the sums of all others as they were."""
        buffers = self.buffers(view.image.shape)
        return partial_step(view, self._topology, estimate, drawing, redrawn, buffers, wide_blur)

    def _update_estimate(self, estimate: Estimate, drawing: Synthesis) -> Estimate:
        """The estimate after the step that the sums of the drawing ask for."""
        topology, levels = self._topology, drawing.corrected_levels
        read = _update_and_solve(drawing, estimate.pattern_state(), topology)
        how = NO_CLEARANCE, read.weight, read.dot_gain_offset, drawing.sigma, read.noise, True
        reading = GridlineReading(drawing.lines, drawing.sides, drawing.added, *how)
        sigma = read.sigma
        levels = levels_at_blur(
            levels, estimate.xy, topology.cells, topology.cell_color, drawing.sigma, sigma
        )
        return with_solution(
            estimate,
            read.solution,
            bend_variance=read.bend_variance,
            reading=reading,
            noise=read.noise,
            sigma=sigma,
            levels=levels,
            median_misfit=read.median_misfit,
            dot_gain=read.dot_gain,
        )


@compiled
def _update_and_solve(drawing, state, topology):  # type: ignore[no-untyped-def]
    """``SynthesisReading`` of a drawing."""
    lines, contrasts, sums, sigma = drawing.lines, drawing.contrasts, drawing.sums.copy(), drawing.sigma
    edges, spokes, edge_cells, rule = topology.edges, topology.spokes, topology.edge_cells, PIXEL_MISFIT_RULE
    gradients = ShiftGradients(sums[:, A].copy(), sums[:, B].copy())
    blur_px = blur_after_step(sigma, blur_change(sums, state.weight))
    update_for_blur(sums, gradients, blur_px - sigma)
    dot_gain = measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma)
    dot_gain_offset = update_without_dot_gain(sums, gradients, contrasts, edge_cells, dot_gain)
    prior = BendingPrior(drawing.bend, state.roughness, state.weight)
    bend_variance, bend_response = update_for_bending(sums, gradients, prior, lines, edges, state.noise, rule)
    pardon = bending_misfit(bend_variance, contrasts, sigma)
    weight, median_misfit, found = weigh_gridlines(
        sums, gradients, pardon, rule.values, rule.min_places, rule.default_weight
    )
    noise = found if np.isfinite(found) else state.noise
    system = GridlineSystem(sums, weight, lines, contrasts, edges, spokes, sigma, noise**2)
    solution = solve_step(system, gradients, drawing.bend, bend_response, state.xy, state.hidden, True)
    return SynthesisReading(
        weight, median_misfit, bend_variance, dot_gain, dot_gain_offset, blur_px, noise, solution
    )


def _without_bending(estimate: Estimate) -> Estimate:
    """The estimate with gridlines that may not bend."""
    roughness, bend = np.zeros_like(estimate.roughness), np.zeros_like(estimate.bend)
    return estimate._replace(roughness=roughness, bend=bend)


def _overlap_corrected(estimate: Estimate, drawing: Synthesis) -> Estimate:
    """The estimate after a step that is as long as it would be if gridlines did not overlap."""
    missing = min(OVERLAP_FACTOR * (drawing.sigma / drawing.edge_px) ** 2, MAX_OVERLAP)
    measured = estimate.measured + missing / (1.0 - missing) * (estimate.measured - drawing.xy)
    reliable = np.where(np.isnan(estimate.reliable), np.nan, measured)
    return estimate._replace(measured=measured, reliable=reliable)


def _wide_blur_effort_share(view: PyramidLevel) -> float:
    """The share of the preset's effort that is allowed where blur is wide."""
    pixels = view.image.shape[0] * view.image.shape[1] * view.scale**2
    return float(min(WIDE_EFFORT * max(pixels / USUAL_PIXELS, 1.0), 1.0))


def _converges_slowly(estimate: Estimate, edge_px: float) -> bool:
    """Whether some gridlines are much blurred for their length, or many are bent; ``edge_px`` is a short edge."""
    if estimate.sigma > SMALL_BLUR * edge_px:
        return True
    return bool(bent_share(estimate.bend, MIN_BEND * edge_px) > MAX_BENT_SHARE)


def _has_appearance_changed(estimate: Estimate, drawing: Synthesis, converged_deviations: float) -> bool:
    """Whether blur or levels of the estimate differ from those drawn, by more than the noise that
    ``converged_deviations`` standard deviations of a marker make."""
    blur = abs(estimate.sigma - drawing.sigma) / drawing.sigma
    levels = level_change(drawing.levels.cell, estimate.levels.cell)
    if blur < BLUR_TOLERANCE and levels < LEVEL_TOLERANCE:
        return False
    noise = converged_deviations * median_deviation(estimate.information.diagonal) / drawing.sigma
    max_blur = min(max(BLUR_TOLERANCE, BLUR_NOISE_FACTOR * noise), MAX_BLUR_TOLERANCE)
    max_levels = max(LEVEL_TOLERANCE, LEVEL_NOISE_FACTOR * noise)
    return bool(blur > max_blur or levels > max_levels)
