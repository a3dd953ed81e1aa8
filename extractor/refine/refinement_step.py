"""The common part of steps of refinement, by profiles or by synthesis: bending of the gridlines, then the markers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.layout.topology import Topology
from extractor.refine.estimate import Estimate
from extractor.refine.measure.marker_scatter import MarkerScatter, measure_scatter
from extractor.refine.solve.fisher_information import Information
from extractor.refine.synthesis.gridlines import gridlines


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
        scatter: of the markers.
    """

    xy: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]
    roughness: NDArray[np.float64]
    scatter: MarkerScatter


class StepSolution(NamedTuple):
    """Markers and gridlines after a step; fields as in ``Estimate``."""

    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    bend: NDArray[np.float64]
    information: Information


def extrapolate_pattern(xy: NDArray[np.float64], topology: Topology) -> ExtrapolatedPattern:
    """The markers (M, 2), NaN where unknown, with the markers next to known markers."""
    return native.extrapolate_pattern(xy, topology)


def with_pattern_moved(topology: Topology, estimate: Estimate) -> Estimate:
    """The estimate with its pattern at the markers of the last step."""
    return estimate._replace(**extrapolate_pattern(estimate.reliable, topology)._asdict())


def with_pattern_bent(topology: Topology, estimate: Estimate) -> Estimate:
    """The same with gridlines that may bend by the roughness of the markers, and by their scatter."""
    return estimate._replace(**native.move_pattern(estimate, topology)._asdict())


def scatter_of(topology: Topology, estimate: Estimate) -> MarkerScatter:
    """The scatter of the estimate's markers."""
    markers = estimate.reliable, estimate.maps, estimate.information.diagonal
    return measure_scatter(*markers, topology)


def gridlines_of(topology: Topology, estimate: Estimate) -> NDArray[np.float64]:
    """(E, 8) the gridlines of the estimate."""
    where = estimate.xy, estimate.maps, estimate.bend
    return gridlines(*where, topology.edges, topology.edge_vectors, estimate.scatter.share)


def with_solution(estimate: Estimate, solution: StepSolution, **others: Any) -> Estimate:
    """The estimate after a step, and with other new fields."""
    return estimate._replace(**solution._asdict(), **others)
