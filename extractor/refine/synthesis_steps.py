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
    scatter_of,
    step_solution,
    with_bending,
    with_pattern_moved,
    with_solution,
)
from extractor.refine.solve.convergence import (
    convergence_covariance,
    remaining_error,
    remaining_share,
    typical_deviation,
)
from extractor.refine.synthesis.blur_bleed import levels_at_blur
from extractor.refine.synthesis.dot_gain import LIMITS as DOT_GAIN_LIMITS
from extractor.refine.synthesis.dot_gain import DotGainLimits

MAX_PICTURES = 2  # kept, for images of so many shapes; chosen, for memory
READ_SUM = 0  # column of a drawing's sums; above 0 where a gridline is read


class SynthesisLimits(NamedTuple):
    """Limits of a step by synthesis.

    Attributes:
        max_steps: each over all markers. Chosen: clean pictures take one or two, dirt and scatter up to four.
        rule: rule of the gridlines' weights.
        step: of the step.
        dot_gain: of the dot gain.
        small_change: share of the blur, by which blur and dot gain together change in a step after which no step may
            follow. Sharp pictures of inks that did not bleed change by 0.01, inks that bled by a tenth of an edge by
            0.15 in the second step. Measured: rule "settled appearance".
        small_bend: RMS of the gridlines' bending, which the first step does not follow, after which no step may follow, in
            deviations of a marker. With larger ones, the rim's markers are off. Measured: rule "bent gridlines".
    """

    max_steps: int = 4
    rule: MisfitRule = PIXEL_MISFIT_RULE
    step: StepLimits = STEP_LIMITS
    dot_gain: DotGainLimits = DOT_GAIN_LIMITS
    small_change: float = 0.05
    small_bend: float = 2.0


LIMITS = SynthesisLimits()


class SynthesisReading(NamedTuple):
    """The measurements along the gridlines of a drawing, and the solution.

    Attributes:
        weight: (E,) 0 to 1.
        variance_ratio: (E,), as ``variance_ratios`` gives it.
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

    def steps(self, view: PyramidLevel, estimate: Estimate, schedule: Schedule) -> Estimate:
        """The estimate after steps over all markers, until a further step would hardly change them.

        Args:
            view: the image.
            estimate: after the round of profiles.
            schedule: the error that a step may leave for no step to follow.
        """
        shift = np.full_like(estimate.xy, np.nan)
        for _ in range(LIMITS.max_steps):
            before = self._drawn(estimate)
            estimate, drawing = self._full_step(view, before)
            last, shift = shift, estimate.measured - drawing.xy
            share = remaining_share(drawing.sigma, drawing.edge_px)
            cov = convergence_covariance(shift, last, drawing.sigma, share)
            remainder = remaining_error(cov, estimate.information)
            if remainder < schedule.small_remainder and self._is_settled(before, estimate, drawing):
                break
        return estimate._replace(convergence_cov_px2=cov)

    def _drawn(self, estimate: Estimate) -> Estimate:
        """The estimate with its pattern at the markers of the last step, and with gridlines that may bend."""
        moved = with_pattern_moved(self._topology, estimate)
        return with_bending(self._topology, moved, scatter_of(self._topology, moved))

    def _is_settled(self, before: Estimate, after: Estimate, drawing: Synthesis) -> bool:
        """Whether the next drawing would differ from the last one by small moves of the markers only.

        Blur or dot gain that has changed, bending that was not drawn, and markers that scatter are drawn otherwise.
        """
        change_px = abs(after.sigma - before.sigma) + abs(after.dot_gain - before.dot_gain)
        read = drawing.sums[:, READ_SUM] > 0.0
        if change_px >= LIMITS.small_change * before.sigma or not read.any():
            return False
        if not before.bend.any():
            bend_px = np.sqrt(np.mean(after.bend[read] ** 2))
            if bend_px >= LIMITS.small_bend * typical_deviation(after.information):
                return False
        return scatter_of(self._topology, after) == NO_SCATTER

    def _full_step(self, view: PyramidLevel, estimate: Estimate) -> tuple[Estimate, Synthesis]:
        """A step from all measurements."""
        drawing = draw_pattern(view, self._topology, estimate, self.picture(view.image.shape))
        return self._update_estimate(estimate, drawing), drawing

    def _update_estimate(self, estimate: Estimate, drawing: Synthesis) -> Estimate:
        """The estimate after the step by the sums of the drawing."""
        topology, levels = self._topology, drawing.corrected_levels
        found = native.update_and_solve(drawing, estimate.pattern_state(), topology, LIMITS)
        read = SynthesisReading(*(*found[:-1], step_solution(*found[-1])))
        weights = read.weight, read.variance_ratio, read.dot_gain_offset
        how = drawing.sides, drawing.added, *weights, drawing.sigma, read.noise
        reading = GridlineReading(drawing.lines, *how)
        sigma = read.sigma
        levels = levels_at_blur(
            levels, estimate.xy, topology.cells, topology.cell_color, drawing.sigma, sigma
        )
        return with_solution(
            estimate,
            read.solution,
            bend_variance=read.bend_variance,
            weight=read.weight,
            reading=reading,
            noise=read.noise,
            sigma=sigma,
            levels=levels,
            dot_gain=read.dot_gain,
        )
