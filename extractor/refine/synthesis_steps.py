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
from extractor.refine.estimate import Estimate, UnevenDotGain
from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.measure.marker_scatter import NO_SCATTER
from extractor.refine.refinement_step import (
    StepSolution,
    scatter_of,
    with_pattern_bent,
    with_solution,
)
from extractor.refine.solve.convergence import (
    remaining_share,
    step_remainder,
    typical_bending,
)
from extractor.refine.synthesis.ink_levels import InkLevels

MAX_PICTURES = 2  # kept, for images of so many shapes; chosen, for memory
# each over all markers. Chosen: clean pictures take one or two, dirt and scatter up to four.
MAX_STEPS = 4
# share of the blur, by which blur and dot gain together change in a step after which no step may follow.
# Sharp pictures of inks that did not bleed change by 0.01, inks that bled by a tenth of an edge by 0.15 in
# the second step. Measured: rule "settled appearance".
SMALL_CHANGE = 0.05
# RMS of the gridlines' bending, which the first step does not follow, after which no step may follow, in
# deviations of a marker. With larger ones, the rim's markers are off. Measured: rule "bent gridlines".
SMALL_BEND = 2.0


class SynthesisStep(NamedTuple):
    """A step by synthesis.

    Attributes:
        reading: the gridlines as they were drawn and read.
        solution: the markers after the step.
        bend_variance: (E,) px^2.
        dot_gain: px.
        uneven_dot_gain: its changes over the image.
        ink_shift: as in ``Estimate``.
        sigma: px, the blur after the step.
        levels: of the inks at that blur.
        is_read: (E,) bool, the gridlines that were read.
        edge_px: the median length of the gridlines.
    """

    reading: GridlineReading
    solution: StepSolution
    bend_variance: NDArray[np.float64]
    dot_gain: float
    uneven_dot_gain: UnevenDotGain
    ink_shift: NDArray[np.float64]
    sigma: float
    levels: InkLevels
    is_read: NDArray[np.bool_]
    edge_px: float


class SynthesisSolver:
    """Takes steps by synthesis. The picture that it draws is kept from image to image, one for each thread.

    Copies and pickles have no picture; they draw their own.

    Args:
        topology: of the layout.
        stations: points of each gridline at which drawing and image are compared, too.
    """

    def __init__(self, topology: Topology, stations: int) -> None:
        self._topology = topology
        self._stations = stations
        self._no_shift = np.full((len(topology.spokes), 2), np.nan)
        self._kept = threading.local()

    def __getstate__(self) -> dict[str, Any]:
        """The state without the pictures of the threads."""
        return {name: value for name, value in self.__dict__.items() if name != "_kept"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._kept = threading.local()

    def _picture(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
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
        shift = self._no_shift
        for _ in range(MAX_STEPS):
            before = with_pattern_bent(self._topology, estimate)
            estimate, step = self._full_step(view, before)
            share = remaining_share(before.sigma, step.edge_px)
            places = estimate.measured, before.xy, shift
            shift, cov, remainder = step_remainder(*places, before.sigma, share, estimate.information)
            if remainder < schedule.small_remainder and self._is_settled(before, estimate, step):
                break
        return estimate._replace(convergence_cov_px2=cov)

    def _is_settled(self, before: Estimate, after: Estimate, step: SynthesisStep) -> bool:
        """Whether the next drawing would differ from the last one by small moves of the markers only.

        Blur or dot gain that has changed, bending that was not drawn, and markers that scatter are drawn otherwise.
        """
        change_px = abs(after.sigma - before.sigma) + abs(after.dot_gain - before.dot_gain)
        change_px += step.edge_px * float(abs(after.ink_shift - before.ink_shift).max())
        if change_px >= SMALL_CHANGE * before.sigma:
            return False
        new_bend = 0.0 if before.bend.any() else typical_bending(after.bend, step.is_read, after.information)
        if new_bend >= SMALL_BEND:
            return False
        return scatter_of(self._topology, after) == NO_SCATTER

    def _full_step(self, view: PyramidLevel, estimate: Estimate) -> tuple[Estimate, SynthesisStep]:
        """A step from all measurements: the pattern is drawn, compared with the image, and solved for."""
        picture = self._picture(view.image.shape)
        step = native.synthesis_step(view, self._topology, picture, estimate, estimate.levels, self._stations)
        after = with_solution(
            estimate,
            step.solution,
            bend_variance=step.bend_variance,
            weight=step.reading.weight,
            reading=step.reading,
            noise=step.reading.noise,
            sigma=step.sigma,
            levels=step.levels,
            dot_gain=step.dot_gain,
            uneven_dot_gain=step.uneven_dot_gain,
            ink_shift=step.ink_shift,
        )
        return after, step
