"""A round of profiles: gridlines are read across and weighted, and the markers are solved for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.refine.estimate import EdgeContrasts, Estimate
from extractor.refine.refinement_step import (
    StepSolution,
    with_solution,
)


class ProfileStep(NamedTuple):
    """The measurements of a round of profiles, and the solution.

    Attributes:
        profile_weight: (E,) 0 to 1, similarity of each gridline to the pattern.
        weight: (E,) 0 to 1, with which it was used.
        dot_gain: px.
        ink_shift: as in ``Estimate``.
        solution: the markers after the step.
    """

    profile_weight: NDArray[np.float64]
    weight: NDArray[np.float64]
    dot_gain: float
    ink_shift: NDArray[np.float64]
    solution: StepSolution


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
    step = native.profile_step(view, lines, contrasts, estimate, topology, stations)
    inks = {"dot_gain": step.dot_gain, "ink_shift": step.ink_shift}
    after = with_solution(estimate, step.solution, weight=step.weight, **inks)
    return after, step.profile_weight
