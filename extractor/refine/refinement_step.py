"""The common part of steps of refinement, by profiles or by synthesis: bending of the gridlines, then the markers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.layout.topology import Topology
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import LIMITS as BENDING_LIMITS
from extractor.refine.measure.gridline_bending import BendingLimits
from extractor.refine.measure.gridline_weights import LIMITS as WEIGHT_LIMITS
from extractor.refine.measure.gridline_weights import GridlineWeightLimits
from extractor.refine.measure.marker_scatter import LIMITS as SCATTER_LIMITS
from extractor.refine.measure.marker_scatter import MarkerScatter, ScatterLimits, measure_scatter
from extractor.refine.solve.disagreement import LIMITS as DISAGREEMENT_LIMITS
from extractor.refine.solve.disagreement import DisagreementLimits
from extractor.refine.solve.fisher_information import LIMITS as INFORMATION_LIMITS
from extractor.refine.solve.fisher_information import Information, InformationLimits
from extractor.refine.synthesis.gridlines import LIMITS as GRIDLINE_LIMITS
from extractor.refine.synthesis.gridlines import GridlineLimits, gridlines

PRIOR_PX = 10.0  # deviation of a marker before it is measured; chosen, far above any error


class MisfitRule(NamedTuple):
    """The rule of a gridline's weight by its misfit.

    Attributes:
        values: that each of its pixels or samples adds.
        min_places: number of pixels or samples above which the gridline is weighted.
        default_weight: weight of a gridline with fewer.
    """

    values: int
    min_places: int
    default_weight: float


PIXEL_MISFIT_RULE = MisfitRule(3, 8, 0.0)


class StepLimits(NamedTuple):
    """Limits of a step.

    Attributes:
        prior_px: deviation of a marker before it is measured. Chosen.
        weights: of the gridlines.
        bending: of the gridlines.
        information: about the markers.
        disagreement: of the gridlines.
        gridlines: of the maps that curve gridlines.
        scatter: of the markers.
    """

    prior_px: float = PRIOR_PX
    weights: GridlineWeightLimits = WEIGHT_LIMITS
    bending: BendingLimits = BENDING_LIMITS
    information: InformationLimits = INFORMATION_LIMITS
    disagreement: DisagreementLimits = DISAGREEMENT_LIMITS
    gridlines: GridlineLimits = GRIDLINE_LIMITS
    scatter: ScatterLimits = SCATTER_LIMITS


LIMITS = StepLimits()


class ExtrapolatedPattern(NamedTuple):
    """Markers, with the markers next to known markers.

    Attributes:
        xy: (M, 2) px; unknown markers beside known markers lie at the places by the maps of the known markers.
        hidden: (M,) bool, the markers that were placed in this way.
        maps: (M, 2, 5) the map at each marker, as ``local_maps`` gives it.
    """

    xy: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]


class MovedPattern(NamedTuple):
    """The pattern at the markers of a step.

    Attributes:
        xy, hidden, maps: as in ``ExtrapolatedPattern``.
        roughness: (M,) px^2. It is the median of the squared third differences along the gridlines at a marker and at
            its neighbours, less the part that noise and the layout itself explain. With the median, one marker that
            dirt has moved does not let its gridlines bend.
        scatter: the fields of ``MarkerScatter``.
    """

    xy: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]
    roughness: NDArray[np.float64]
    scatter: tuple[float, float]


class StepSolution(NamedTuple):
    """Markers and gridlines after a step; fields as in ``Estimate``, and the two blocks of its information."""

    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    bend: NDArray[np.float64]
    blocks: tuple[NDArray[np.float64], NDArray[np.float64]]


def extrapolate_pattern(xy: NDArray[np.float64], topology: Topology) -> ExtrapolatedPattern:
    """The markers (M, 2), NaN where unknown, with the markers next to known markers."""
    return ExtrapolatedPattern(*native.extrapolate_pattern(xy, topology, GRIDLINE_LIMITS))


def with_pattern_moved(topology: Topology, estimate: Estimate) -> Estimate:
    """The estimate with its pattern at the markers of the last step."""
    moved = extrapolate_pattern(estimate.reliable, topology)
    return estimate._replace(xy=moved.xy, hidden=moved.hidden, maps=moved.maps)


def with_pattern_bent(topology: Topology, estimate: Estimate) -> Estimate:
    """The same with gridlines that may bend by the roughness of the markers, and by their scatter."""
    moved = MovedPattern(*native.move_pattern(estimate, topology, LIMITS))
    return estimate._replace(
        xy=moved.xy,
        hidden=moved.hidden,
        maps=moved.maps,
        roughness=moved.roughness,
        scatter=MarkerScatter(*moved.scatter),
    )


def scatter_of(topology: Topology, estimate: Estimate) -> MarkerScatter:
    """The scatter of the estimate's markers."""
    markers = estimate.reliable, estimate.maps, estimate.information.diagonal
    return measure_scatter(*markers, topology)


def gridlines_of(topology: Topology, estimate: Estimate) -> NDArray[np.float64]:
    """(E, 8) the gridlines of the estimate."""
    where = estimate.xy, estimate.maps, estimate.bend
    return np.asarray(gridlines(*where, topology.edges, topology.edge_vectors, estimate.scatter.share))


def with_solution(estimate: Estimate, solution: StepSolution, **others: Any) -> Estimate:
    """The estimate after a step, and with other new fields."""
    return estimate._replace(
        measured=solution.measured,
        reliable=solution.reliable,
        bend=solution.bend,
        information=Information(*solution.blocks),
        **others,
    )
