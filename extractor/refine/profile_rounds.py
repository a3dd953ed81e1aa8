"""A round of profiles: gridlines are read across, weighed, and the markers solved.

One compiled function leads from the gridlines to the markers: between small functions, every array would pass through
Python.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import EdgeContrasts, Estimate
from extractor.refine.measure.gridline_bending import bending_gridlines
from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.measure.gridline_weights import ShiftGradients, weigh_gridlines
from extractor.refine.measure.matched_filter import read_profiles
from extractor.refine.outliers import suspect_markers
from extractor.refine.refinement_step import (
    BendingPrior,
    MisfitRule,
    StepSolution,
    solve_step,
    update_for_bending,
    with_solution,
)
from extractor.refine.solve.disagreement import variance_ratios, with_weight
from extractor.refine.solve.fisher_information import GridlineSystem
from extractor.refine.synthesis.dot_gain import measure_dot_gain, update_without_dot_gain
from extractor.refine.synthesis.residual_kernel import AA, A, B

SAMPLE_MISFIT_RULE = MisfitRule(1, 4, 1.0)
MISFIT_TOLERANCE = 0.1  # of the contrast, by glare and uneven light in a profile
SQUARED_CONTRAST = 3  # column of the clearance


class ProfileStep(NamedTuple):
    """The measurements of a round of profiles, and the solution.

    Attributes:
        profile_weight: (E,) 0 to 1, how well each gridline looks like the pattern.
        weight: (E,) 0 to 1, with which it was used.
        variance_ratio: (E,), as ``variance_ratios`` gives it; 1 before the last round.
        bend_variance: (E,) px^2.
        dot_gain: px.
        dot_gain_offset: (E,) px, offset of each gridline by the dot gain.
        solution: the markers after the step.
    """

    profile_weight: NDArray[np.float64]
    weight: NDArray[np.float64]
    variance_ratio: NDArray[np.float64]
    bend_variance: NDArray[np.float64]
    dot_gain: float
    dot_gain_offset: NDArray[np.float64]
    solution: StepSolution


def profile_step(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    lines: NDArray[np.float64],
    contrasts: EdgeContrasts,
    stations: int,
    *,
    judged: bool,
) -> tuple[Estimate, NDArray[np.float64]]:
    """A round of profiles.

    Args:
        view: the image.
        topology: of the layout.
        estimate: before the round.
        lines: (E, 8) its gridlines.
        contrasts: across them.
        stations: rows of pixels across each gridline at most.
        judged: use gridlines by how well they look like the pattern, as in the last round, where they are already
            close. Before, the best ones look wrong, and it counts only around markers where little else is measured.

    Returns:
        The estimate after the round, and (E,) 0 to 1, how well gridlines look like the pattern.
    """
    state = estimate.pattern_state()
    step = _profile_step(view, lines, contrasts, state, topology, stations, judged)
    weights = step.weight, step.variance_ratio, step.dot_gain_offset
    look = contrasts.sides, contrasts.sides, contrasts.clearance, *weights
    reading = GridlineReading(lines, *look, estimate.sigma, estimate.noise, False)
    others = {"bend_variance": step.bend_variance, "dot_gain": step.dot_gain, "reading": reading}
    return with_solution(estimate, step.solution, **others), step.profile_weight


@compiled
def _profile_step(view, lines, across, state, topology, stations, judged):  # type: ignore[no-untyped-def]
    """``ProfileStep`` from the gridlines (E, 8), the ``EdgeContrasts`` across them, and the ``PatternState``."""
    contrasts, clearance = across.contrasts, across.clearance
    edges, spokes, edge_cells = topology.edges, topology.spokes, topology.edge_cells
    sigma, noise, rule = state.sigma, state.noise, SAMPLE_MISFIT_RULE
    bending = bending_gridlines(state.roughness, state.bend, edges)
    sums = read_profiles(view, lines, across, sigma, bending, stations)
    gradients = ShiftGradients(sums[:, A].copy(), sums[:, B].copy())
    dot_gain = measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma)
    dot_gain_offset = update_without_dot_gain(sums, gradients, contrasts, edge_cells, dot_gain)
    prior = BendingPrior(state.bend, state.roughness, state.weight)
    bend_variance, bend_response = update_for_bending(sums, gradients, prior, lines, edges, noise, rule)
    pardon = MISFIT_TOLERANCE**2 * clearance[:, SQUARED_CONTRAST]
    profile_weight, _, _ = weigh_gridlines(
        sums, gradients, pardon, rule.values, rule.min_places, rule.default_weight
    )
    weight = profile_weight if judged else _lenient_weights(profile_weight, sums, edges, spokes)
    system = GridlineSystem(sums, weight, lines, contrasts, edges, spokes, sigma, noise**2)
    solution = solve_step(system, gradients, state.bend, bend_response, state.xy, state.hidden, False)
    ratio = np.ones(len(edges))
    if judged:
        ratio = variance_ratios(system, gradients, solution.measured - state.xy)
        system = with_weight(system, weight / ratio)
        solution = solve_step(system, gradients, state.bend, bend_response, state.xy, state.hidden, False)
    return ProfileStep(profile_weight, weight, ratio, bend_variance, dot_gain, dot_gain_offset, solution)


@compiled
def _lenient_weights(profile_weight, sums, edges, spokes):  # type: ignore[no-untyped-def]
    """(E,) 0 to 1: weights of gridlines that are judged only around markers where little else is measured."""
    read = sums[:, AA] > 0.0
    suspect, _ = suspect_markers(profile_weight, read, spokes)
    return np.where(_groups_with_any(suspect, edges), profile_weight, np.where(read, 1.0, 0.0))


@compiled
def _groups_with_any(selected, groups):  # type: ignore[no-untyped-def]
    """(G,) bool, the groups (G, n) of markers that contain a selected one (M,) bool."""
    out = np.zeros(groups.shape[0], np.bool_)
    for g in range(groups.shape[0]):
        for k in range(groups.shape[1]):
            out[g] |= selected[groups[g, k]]
    return out
