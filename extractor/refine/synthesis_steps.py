"""Steps by synthesis: the pattern is drawn and compared with the image, and all markers are solved for."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.presets import Schedule
from extractor.refine.drawn_pattern import Synthesis, draw_pattern
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.measure.marker_scatter import NO_SCATTER
from extractor.refine.refinement_step import LIMITS as STEP_LIMITS
from extractor.refine.refinement_step import (
    PIXEL_MISFIT_RULE,
    MisfitRule,
    StepLimits,
    StepSolution,
    step_solution,
    with_pattern_moved,
    with_roughness,
    with_solution,
)
from extractor.refine.solve.convergence import WIDE_BLUR_REMAINDER, convergence_covariance, typical_move
from extractor.refine.synthesis.blur_bleed import levels_at_blur
from extractor.refine.synthesis.dot_gain import LIMITS as DOT_GAIN_LIMITS
from extractor.refine.synthesis.dot_gain import DotGainLimits

WIDE_BLUR = 0.1  # of a usual edge: above, the errors of neighbours look like bending. Chosen
# Gridlines overlap where blur is wide: a step falls short by OVERLAP_FACTOR times the square of blur over edge
# (rendered patterns, shifted), at most by MAX_OVERLAP.
OVERLAP_FACTOR, MAX_OVERLAP = 6.75, 0.4
MAX_PICTURES = 2  # kept, for images of so many shapes; chosen, for memory
NO_CLEARANCE = np.empty((0, 4))


class SynthesisLimits(NamedTuple):
    """Limits of a step by synthesis.

    Attributes:
        rule: rule of the gridlines' weights.
        step: of the step.
        dot_gain: of the dot gain.
        small_change: share of the blur, by which blur and dot gain together change in a step after which no step may
            follow. Sharp pictures of inks that did not bleed change by 0.01, inks that bled by a tenth of an edge by
            0.15 in the second step. Measured: rule "settled appearance".
    """

    rule: MisfitRule = PIXEL_MISFIT_RULE
    step: StepLimits = STEP_LIMITS
    dot_gain: DotGainLimits = DOT_GAIN_LIMITS
    small_change: float = 0.05


LIMITS = SynthesisLimits()


class SynthesisReading(NamedTuple):
    """The measurements along the gridlines of a drawing, and the solution.

    Attributes:
        weight: (E,) 0 to 1.
        variance_ratio: (E,), as ``variance_ratios`` gives it; 1 in the first step.
        bend_variance: (E,) px^2.
        dot_gain: px.
        dot_gain_offset: (E,) px.
        sigma: px, the blur after the step.
        noise: gray levels, one channel.
        solution: the markers after the step.
    """

    weight: NDArray[np.float64]
    variance_ratio: NDArray[np.float64]
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
        """The state without the pictures of the threads."""
        return {name: value for name, value in self.__dict__.items() if name != "_kept"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._kept = threading.local()

    def picture(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """(H, W, 3) the thread's picture of a shape: the light of the pattern over black, from the last drawing."""
        kept: dict[tuple[int, ...], NDArray[np.float32]] | None = getattr(self._kept, "pictures", None)
        if kept is None:
            kept = self._kept.pictures = {}
        if shape not in kept:
            while len(kept) >= MAX_PICTURES:
                del kept[next(iter(kept))]
            kept[shape] = np.zeros(shape, np.float32)
        return kept[shape]

    def steps(self, view: PyramidLevel, estimate: Estimate, schedule: Schedule, usual_px: float) -> Estimate:
        """The estimate after steps over all markers, until a step hardly changes markers, blur and dot gain.

        Args:
            view: the image.
            estimate: with its pattern at the markers of the last step.
            schedule: largest number of steps, and the move after which no step follows.
            usual_px: a usual edge in the view.
        """
        wide_blur = estimate.sigma > WIDE_BLUR * usual_px  # a usual edge is blurred into the next
        shift = np.full_like(estimate.xy, np.nan)
        for step in range(schedule.steps):
            if step > 0:
                estimate = with_pattern_moved(self._topology, estimate)
            judged = step > 0  # the misfit of the first step is the misfit of its start
            before = self._with_bending(estimate, wide_blur, judged)
            stepped, drawing = self._full_step(view, before, judged)
            estimate = _overlap_corrected(stepped, drawing)
            change_px = abs(estimate.sigma - drawing.sigma) + abs(estimate.dot_gain - before.dot_gain)
            is_settled = change_px < LIMITS.small_change * drawing.sigma
            last, shift = shift, estimate.measured - drawing.xy
            if judged and is_settled and typical_move(shift, estimate.information) < schedule.small_move:
                break
        remaining = WIDE_BLUR_REMAINDER * (drawing.sigma / drawing.edge_px) ** 2 if wide_blur else 0.0
        cov = convergence_covariance(shift, last, drawing.sigma, remaining)
        return estimate._replace(convergence_cov_px2=cov)

    def _with_bending(self, estimate: Estimate, wide_blur: bool, judged: bool) -> Estimate:
        """The estimate with the roughness and the scatter that let its gridlines bend; without both where blur is wide.

        With wide blur, gridlines would bend instead of correcting the markers beside them.
        """
        if wide_blur:
            return _without_bending(estimate)
        return with_roughness(self._topology, estimate, by_synthesis=judged)

    def _full_step(self, view: PyramidLevel, estimate: Estimate, judged: bool) -> tuple[Estimate, Synthesis]:
        """A step from all measurements."""
        drawing = draw_pattern(view, self._topology, estimate, self.picture(view.image.shape))
        return self._update_estimate(estimate, drawing, judged), drawing

    def _update_estimate(self, estimate: Estimate, drawing: Synthesis, judged: bool) -> Estimate:
        """The estimate after the step by the sums of the drawing."""
        topology, levels = self._topology, drawing.corrected_levels
        found = native.update_and_solve(drawing, estimate.pattern_state(), topology, judged, LIMITS)
        read = SynthesisReading(*(*found[:-1], step_solution(*found[-1])))
        weights = read.weight, read.variance_ratio, read.dot_gain_offset
        how = NO_CLEARANCE, *weights, drawing.sigma, read.noise, True
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
            dot_gain=read.dot_gain,
        )


def _without_bending(estimate: Estimate) -> Estimate:
    """The estimate with gridlines that may not bend."""
    roughness, bend = np.zeros_like(estimate.roughness), np.zeros_like(estimate.bend)
    return estimate._replace(roughness=roughness, bend=bend, scatter=NO_SCATTER)


def _overlap_corrected(estimate: Estimate, drawing: Synthesis) -> Estimate:
    """The estimate after a step of the length without overlap of gridlines."""
    missing = min(OVERLAP_FACTOR * (drawing.sigma / drawing.edge_px) ** 2, MAX_OVERLAP)
    measured = estimate.measured + missing / (1.0 - missing) * (estimate.measured - drawing.xy)
    reliable = np.where(np.isnan(estimate.reliable), np.nan, measured)
    return estimate._replace(measured=measured, reliable=reliable)
