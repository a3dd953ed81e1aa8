"""What every step of refinement does, by profiles or by synthesis: bending of the gridlines, then the markers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import (
    MarkerRows,
    bend_after_shift,
    estimate_bend_variance,
    measure_roughness,
    update_without_bending,
)
from extractor.refine.measure.gridline_weights import (
    PRIOR_HIDDEN_PX,
    least_information,
    markers_after_shift,
    weigh_gridlines,
)
from extractor.refine.solve.fisher_information import Information, fisher_information, gradient, solve_shifts
from extractor.refine.synthesis.gridlines import (
    extrapolate_markers,
    gridlines,
    local_maps,
)

PRIOR_PX = 10.0  # deviation of a marker before it is measured


class MisfitRule(NamedTuple):
    """How a gridline is weighed by its misfit.

    Attributes:
        values: that each of its pixels or samples adds.
        min_places: pixels or samples, above which it is weighed.
        default_weight: of a gridline with fewer.
    """

    values: int
    min_places: int
    default_weight: float


PIXEL_MISFIT_RULE = MisfitRule(3, 8, 0.0)


class ExtrapolatedPattern(NamedTuple):
    """Markers with those just beyond the known ones.

    Attributes:
        xy: (M, 2) px; unknown markers beside known ones lie where the maps of these put them.
        hidden: (M,) bool, the markers put that way.
        maps: (M, 2, 5) the map at each marker, as ``local_maps`` gives it.
    """

    xy: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]


class BendingPrior(NamedTuple):
    """What was known about the bending of gridlines before a step.

    Attributes:
        bend: (E, 2) px, how far they bend.
        roughness: (M,) px^2, of the markers.
        weight: (E,) 0 to 1, of the gridlines.
    """

    bend: NDArray[np.float64]
    roughness: NDArray[np.float64]
    weight: NDArray[np.float64]


class StepSolution(NamedTuple):
    """Markers and gridlines after a step; fields as in ``Estimate``."""

    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    bend: NDArray[np.float64]
    information: Information


@compiled
def extrapolate_pattern(xy, topology):  # type: ignore[no-untyped-def]
    """``ExtrapolatedPattern`` of the markers (M, 2), NaN where unknown."""
    near, offset, stencil = topology.ring_markers, topology.ring_vectors, topology.derivative_stencil
    maps = local_maps(xy, near, offset, stencil)
    xy, hidden = extrapolate_markers(xy, maps, near, offset)
    return ExtrapolatedPattern(xy, hidden, maps)


def with_pattern_moved(topology: Topology, estimate: Estimate) -> Estimate:
    """The estimate with its pattern where the last step left the markers."""
    return estimate._replace(**extrapolate_pattern(estimate.reliable, topology)._asdict())


def with_roughness(topology: Topology, estimate: Estimate) -> Estimate:
    """The estimate with the roughness of its markers."""
    rows = MarkerRows(topology.edges, topology.next_markers, topology.third_differences)
    about = rows, topology.spokes, topology.ring_markers
    markers = estimate.reliable, estimate.maps, estimate.information.diagonal
    return estimate._replace(roughness=measure_roughness(*markers, *about))


def gridlines_of(topology: Topology, estimate: Estimate) -> NDArray[np.float64]:
    """(E, 8) the gridlines of the estimate."""
    where = estimate.xy, estimate.maps, estimate.bend
    return np.asarray(gridlines(*where, topology.edges, topology.edge_vectors))


@compiled
def update_for_bending(sums, gradients, prior, lines, edges, noise, rule):  # type: ignore[no-untyped-def]
    """Eliminate the bending of gridlines from the sums and gradients, in place.

    Args:
        sums: (E, 24), written.
        gradients: ``ShiftGradients``, ``start`` and ``end`` written.
        prior: ``BendingPrior``.
        lines, edges: (E, 8) and (E, 2).
        noise: gray levels, one channel.
        rule: ``MisfitRule``.

    Returns:
        (E,) px^2 the bend variance, and (E, 6) the bend response, as ``update_without_bending`` gives it.
    """
    bend_variance, variance = np.zeros(len(sums)), 1.0
    if np.any(prior.roughness) or np.any(prior.bend):
        # a misfit that all gridlines have is not bending
        _, _, found = weigh_gridlines(
            sums, gradients, np.zeros(len(sums)), rule.values, rule.min_places, rule.default_weight
        )
        variance = max(noise, found) ** 2 if np.isfinite(found) else noise**2
        bend_variance = estimate_bend_variance(
            sums, gradients, prior.bend, prior.roughness, prior.weight, lines, edges, variance
        )
    return bend_variance, update_without_bending(sums, gradients, prior.bend, bend_variance, variance)


def with_solution(estimate: Estimate, solution: StepSolution, **others: Any) -> Estimate:
    """The estimate after a step, and with other new fields."""
    return estimate._replace(**solution._asdict(), **others)


@compiled
def solve_step(system, gradients, bend, bend_response, xy, hidden, overlapping):  # type: ignore[no-untyped-def]
    """Move the markers by the shifts that the gradients ask for.

    Args:
        system: ``GridlineSystem``, bending eliminated from its sums.
        gradients: ``ShiftGradients``, likewise.
        bend, bend_response: (E, 2) px and (E, 6), as ``bend_after_shift`` takes them.
        xy, hidden: (M, 2) px and (M,) bool, the markers as drawn.
        overlapping: the sums include the gridlines' ends.

    Returns:
        ``StepSolution``.
    """
    lines, edges, spokes, weight = system.lines, system.edges, system.spokes, system.weight
    information = fisher_information(system, prior_information(hidden), overlapping)
    right = gradient(system, gradients.start, gradients.end)
    shift = solve_shifts(information.diagonal, information.off_diagonal, edges, right)
    least = least_information(system.sums, weight, lines, edges, system.variance, len(xy))
    measured, reliable = markers_after_shift(xy, shift, least, weight, spokes)
    bend = bend_after_shift(bend, bend_response, shift, lines, edges)
    return StepSolution(measured, reliable, bend, information)


@compiled
def prior_information(hidden):  # type: ignore[no-untyped-def]
    """(M,) 1/px^2, the information about each marker before it is measured; ``hidden`` (M,) bool."""
    return np.where(hidden, PRIOR_HIDDEN_PX**-2, PRIOR_PX**-2)
