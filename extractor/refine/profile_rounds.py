"""A round of profiles: gridlines are read across and weighted, and the markers are solved for."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.refine.estimate import EdgeContrasts, Estimate
from extractor.refine.measure.matched_filter import LIMITS as ROW_LIMITS
from extractor.refine.measure.matched_filter import MatchedFilterLimits
from extractor.refine.outliers import LIMITS as OUTLIER_LIMITS
from extractor.refine.outliers import OutlierLimits
from extractor.refine.refinement_step import LIMITS as STEP_LIMITS
from extractor.refine.refinement_step import (
    MisfitRule,
    StepLimits,
    StepSolution,
    with_solution,
)
from extractor.refine.synthesis.dot_gain import LIMITS as DOT_GAIN_LIMITS
from extractor.refine.synthesis.dot_gain import DotGainLimits

SAMPLE_MISFIT_RULE = MisfitRule(1, 4, 1.0)
MISFIT_TOLERANCE = 0.1  # of the contrast, by glare and uneven light in a profile; chosen


class ProfileLimits(NamedTuple):
    """Limits of a round of profiles.

    Attributes:
        misfit_tolerance: of the contrast; what glare and uneven light make in a profile does not lower its weight.
            Chosen.
        rule: by which gridlines are weighed.
        step: of the step.
        rows: of the rows of pixels.
        dot_gain: of the dot gain.
        outliers: of the markers around which gridlines are tested.
    """

    misfit_tolerance: float = MISFIT_TOLERANCE
    rule: MisfitRule = SAMPLE_MISFIT_RULE
    step: StepLimits = STEP_LIMITS
    rows: MatchedFilterLimits = ROW_LIMITS
    dot_gain: DotGainLimits = DOT_GAIN_LIMITS
    outliers: OutlierLimits = OUTLIER_LIMITS


LIMITS = ProfileLimits()


class ProfileStep(NamedTuple):
    """The measurements of a round of profiles, and the solution.

    Attributes:
        profile_weight: (E,) 0 to 1, similarity of each gridline to the pattern.
        weight: (E,) 0 to 1, with which it was used.
        dot_gain: px.
        solution: the markers after the step, the fields of ``StepSolution``.
    """

    profile_weight: NDArray[np.float64]
    weight: NDArray[np.float64]
    dot_gain: float
    solution: tuple[Any, ...]


def profile_step(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    lines: NDArray[np.float64],
    contrasts: EdgeContrasts,
    stations: int,
) -> tuple[Estimate, NDArray[np.float64]]:
    """A round of profiles.

    The best gridlines look wrong while their markers are a pixel off. So the weights by their looks are used only
    around markers with few other measurements.

    Args:
        view: the image.
        topology: of the layout.
        estimate: before the round.
        lines: (E, 8) its gridlines.
        contrasts: across them.
        stations: rows of pixels across each gridline at most.

    Returns:
        The estimate after the round, and (E,) 0 to 1, similarity of gridlines to the pattern.
    """
    given = view, lines, contrasts, estimate, topology, stations
    step = ProfileStep(*native.profile_step(*given, LIMITS))
    after = with_solution(estimate, StepSolution(*step.solution), weight=step.weight, dot_gain=step.dot_gain)
    return after, step.profile_weight
