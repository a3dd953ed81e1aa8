"""Stage 8, first half: markers that contradict their neighbours are dropped.

A marker must lie where the map of its two rings puts it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice_tables import Lattice
from extractor.localmap.neighbour_prediction import is_neighbour_outlier, predict_markers
from extractor.numbering.marker_places import InitialMarkers
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.refine.estimate import RefinedMarkers

MAX_ROUNDS = 40  # of rejection; each round drops the worst marker of every neighbourhood
# Distances between a marker and its prediction, and deviations, are in units of the edge.
MAX_DISTANCE = 0.15  # from the prediction by two rings
MAX_AGREED_UNEXPLAINED_DISTANCE = 0.14  # where two triangles agree and synthesis explains nothing
MAX_PREDICTED_DEVIATION = 0.12  # of the prediction of a marker that only two triangles confirm
MAX_UNEXPLAINED_DISTANCE = 0.06  # of a marker that is obstructed


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
    """Results of earlier stages by which markers are judged, for each of M markers.

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
    edge_px, is_complete = _update_rejecting_inconsistent(xy, cov, evidence, lattice.ring_tables, size)
    return ConsistentMarkers(xy, cov, edge_px, is_complete)


@compiled
def _update_rejecting_inconsistent(xy, cov, evidence, tables, size):  # type: ignore[no-untyped-def]
    """Set inconsistent markers to NaN; (M,) the edge at each marker, and whether all markers are consistent."""
    explained, agreed, first_ring = evidence.explained, evidence.agreed, tables.first_ring
    edge_px, tolerance_px = evidence.edge_px.copy(), np.zeros(xy.shape[0])
    for m in range(xy.shape[0]):
        if not agreed[m]:
            edge_px[m] = _shortest_edge(xy, m, first_ring, edge_px[m])
        tolerance = MAX_DISTANCE if explained[m] else MAX_AGREED_UNEXPLAINED_DISTANCE * agreed[m]
        tolerance_px[m] = edge_px[m] * tolerance
    judged = MarkerEvidence(explained, edge_px, agreed, evidence.is_intact)
    if _is_consistent(xy, tolerance_px, tables, size):
        return edge_px, True
    _update_rejecting_outliers(xy, cov, tolerance_px, judged, tables)
    return edge_px, False


@inlined_no_refcount
def _shortest_edge(xy, m, first_ring, edge_px):  # type: ignore[no-untyped-def]
    """The smaller of the edge at marker m and the distance to its nearest known neighbour, px.

    A tolerance in units of a longer edge might reach half-way to another marker.
    """
    for k in range(first_ring.shape[1]):
        n = first_ring[m, k]
        if n >= 0:
            distance = np.hypot(xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1])
            if distance < edge_px:
                edge_px = distance
    return edge_px


@compiled
def _is_consistent(xy, tolerance_px, tables, size):  # type: ignore[no-untyped-def]
    """Whether every marker of the pattern is known and no rule could drop one, which is the usual case."""
    present, weights, neighbours = tables.present, tables.ring_weights, tables.neighbours
    for m in range(xy.shape[0]):
        x, y = xy[m, 0], xy[m, 1]
        if np.isnan(x):
            if present[m]:
                return False
            continue
        if not is_inside_image(x, y, size):
            return False
        if is_neighbour_outlier(xy, m, tolerance_px[m], weights, neighbours):
            return False
    return True


@compiled
def is_inside_image(x, y, size):  # type: ignore[no-untyped-def]
    """Whether a place lies within the image, up to the outer edges of its pixels; False for NaN."""
    return x >= -0.5 and y >= -0.5 and x <= size[0] - 0.5 and y <= size[1] - 0.5


@compiled
def _update_rejecting_outliers(xy, cov, tolerance_px, evidence, tables):  # type: ignore[no-untyped-def]
    """Set to NaN the markers that do not lie where their neighbours put them, the worst of each neighbourhood first."""
    neighbours, count = tables.neighbours, xy.shape[0]
    misfit, doubtful = np.zeros(count), np.zeros(count, np.bool_)
    pending = np.arange(count)
    for _ in range(MAX_ROUNDS):
        # only markers beyond the tolerance are predicted, again where a neighbour has been dropped
        doubtful[:] = False
        for m in pending:
            misfit[m] = 0.0
            doubtful[m] = not np.isnan(xy[m, 0]) and is_neighbour_outlier(
                xy, m, tolerance_px[m], tables.ring_weights, neighbours
            )
        predicted, variance, leverage, _ = predict_markers(xy, doubtful, tables.marker_mm, neighbours)
        for m in np.flatnonzero(doubtful):
            distance = np.hypot(xy[m, 0] - predicted[m, 0], xy[m, 1] - predicted[m, 1])
            sigma = np.sqrt(variance[m] * (1 + leverage[m]))
            misfit[m] = _misfit_ratio(m, distance, sigma, evidence)
        worst = np.zeros(count, np.bool_)
        for m in np.flatnonzero(misfit > 1.0):
            worst[m] = True
            for n in neighbours[m]:
                worst[m] = worst[m] and (n < 0 or misfit[m] >= misfit[n])
        if not worst.any():
            break
        affected = worst.copy()
        for m in np.flatnonzero(worst):
            xy[m], cov[m] = np.nan, np.nan
            for n in neighbours[m]:
                if n >= 0:
                    affected[n] = True
        pending = np.flatnonzero(affected)


@compiled
def _misfit_ratio(m, distance, sigma, evidence):  # type: ignore[no-untyped-def]
    """The distance of a marker from its prediction over the allowed distance.

    It is infinite where neither triangles nor neighbours confirm the marker, or the prediction is too uncertain. The
    allowed distance is smaller where synthesis does not explain the image; the neighbours must then be known.

    Args:
        distance: from the prediction, px.
        sigma: standard deviation of the prediction, px.
    """
    edge_px, explained, agreed = evidence.edge_px[m], evidence.explained[m], evidence.agreed[m]
    is_intact = evidence.is_intact[m]
    confirmed, allowed = explained or agreed, MAX_DISTANCE
    if not confirmed:
        allowed = MAX_UNEXPLAINED_DISTANCE
    elif not explained:
        allowed = MAX_AGREED_UNEXPLAINED_DISTANCE
    max_deviation = MAX_PREDICTED_DEVIATION if confirmed else MAX_UNEXPLAINED_DISTANCE
    if not (explained or is_intact or sigma < max_deviation * edge_px):
        return np.inf
    ratio = distance / (edge_px * allowed)
    if np.isfinite(ratio):
        return ratio
    return 0.0 if agreed else np.inf
