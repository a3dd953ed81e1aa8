"""Stage 8, first half: markers that contradict their neighbours are dropped.

A marker must lie at the place that follows from the map of its two rings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native
from extractor.layout.lattice_tables import Lattice
from extractor.layout.neighbour_tables import LIMITS as NEIGHBOUR_MAP_LIMITS
from extractor.layout.neighbour_tables import NeighbourMapLimits
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import RefinedMarkers


class ConsistencyLimits(NamedTuple):
    """Limits of markers that do not contradict their neighbours. Distances and deviations are in edges.

    Attributes:
        max_rounds: of rejection; each round drops the worst marker of every neighbourhood. Measured: rule "ring
            outliers".
        max_distance: between a marker and its prediction by two rings. Measured:
            `python -m benchmarks.acceptance`.
        max_predicted_deviation: of the prediction of a marker that only two triangles confirm. Measured: rule
            "confirmed".
        max_unexplained_distance: of a marker that is obstructed, and the deviation of its prediction. Measured: rule
            "unexplained".
        maps: limits of the predictions.
    """

    max_rounds: int = 40
    max_distance: float = 0.14
    max_predicted_deviation: float = 0.12
    max_unexplained_distance: float = 0.06
    maps: NeighbourMapLimits = NEIGHBOUR_MAP_LIMITS


LIMITS = ConsistencyLimits()


class ConsistentMarkers(NamedTuple):
    """Markers that do not contradict each other.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2) float64, NaN where lost or dropped.
        edge_px: (M,) float64, the mean edge at each marker.
        is_complete: every marker of the pattern is known, and none was dropped.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    is_complete: bool


class MarkerEvidence(NamedTuple):
    """Results of earlier stages for the tests of markers, for each of M markers.

    Attributes:
        explained: (M,) bool, synthesis explains the image around the marker.
        edge_px: (M,) float64, the mean edge at the marker.
        agreed: (M,) bool, all triangles of the marker, or at least two, were found and agree.
        is_intact: (M,) bool, all triangles of the marker, and at least two, were found and agree.
    """

    explained: NDArray[np.bool_]
    edge_px: NDArray[np.float64]
    agreed: NDArray[np.bool_]
    is_intact: NDArray[np.bool_]


def reject_inconsistent_markers(
    refined: RefinedMarkers, places: InitialMarkers, lattice: Lattice, size: tuple[int, int]
) -> ConsistentMarkers:
    """The markers without those that contradict their neighbours.

    Args:
        refined: the markers after refinement.
        places: the markers before refinement.
        size: width and height of the image, px.
    """
    xy, cov = refined.xy_px.copy(), refined.cov_px2.copy()
    evidence = MarkerEvidence(
        explained=refined.explained,
        edge_px=places.edge_px,
        agreed=places.agreed,
        is_intact=places.is_intact,
    )
    edge_px, is_complete = native.update_rejecting_inconsistent(
        xy, cov, evidence, lattice.ring_tables, size, LIMITS
    )
    return ConsistentMarkers(xy, cov, edge_px, is_complete)
