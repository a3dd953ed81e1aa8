"""Stage 8: markers that contradict their neighbours are dropped, and lost ones repaired where that is safe.

Mild omission (the article's eq. 6): the triangles around a lost marker imply its place; here all markers of two rings
do, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers of the same layer and
sextant, read at equidistant places. A marker that neither predicts within a tenth of an edge stays lost.

An uncertain marker, as under dirt, may be predicted by its rings better than it is measured: both are fused.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.complete.consistency_filter import is_inside_image, reject_inconsistent_markers
from extractor.complete.layer_arcs import predict_by_layer
from extractor.complete.uncertain_markers import find_uncertain_markers, update_by_fusion
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.neighbour_prediction import MIN_CUBIC_NEIGHBOURS, cubic_variance, predict_markers
from extractor.numbering.marker_places import InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import RefinedMarkers
from extractor.result import Status

# Distances and deviations are in units of the edge, unless stated otherwise.
MAX_IMPLIED_DISTANCE = 0.1  # between the place that cells imply and the prediction by markers
IMPLIED_DEVIATION = 0.02  # of a place that cells imply
BORDER_WIDTH = 0.25  # of the image's border, which cuts cells; cells there imply nothing
MILD_SUPPORT = 10  # known neighbours of two rings that make an omission mild
MAX_REPAIRED_DEVIATION = 0.08  # of a repaired marker: three such deviations stay below a quarter of an edge
MAX_FITTED_DEVIATION = 0.05  # of a fitted marker: a layer's quadratic is wrong where the surface is bent
MIN_RIM_SUPPORT = 6  # known neighbours of a lost marker that cells imply
MAX_LEVERAGE = 1.2  # of the neighbours' errors on a repaired marker
MAX_RIM_LEVERAGE = 2.0  # the same on a marker that cells imply
OUTER_RING_ERROR = 0.04  # possible error of the outer ring where too little of the inner ring can confirm it
MODEL_DEVIATION = 0.012  # deviation of a smooth surface from a quadratic map
# Errors of repaired markers against the residual of the fit to their neighbours, from 300 rendered scenes with missing
# cells and dirt on flat, tilted, pressed and twisted patterns: deviation = MILD_ERROR * leverage * residual, as the
# surface departs the more from the map the farther this extrapolates. A layer's quadratic rests on few markers and may
# seem to fit better than it does: its variance counts HEAVY_ERROR times, and is never below that of the model.
MILD_ERROR = 1.6
HEAVY_ERROR = 2.0
# Likewise against the residual of a cubic in nearly whole rings, on the surfaces under balls, rings, ribs, wedges and
# cubes (their true markers, with up to three neighbours removed): 99 % of the errors stay below 1.5 such deviations.
CUBIC_ERROR = 1.6
LOST, MEASURED = np.uint8(Status.LOST), np.uint8(Status.MEASURED)
REPAIRED, FITTED = np.uint8(Status.REPAIRED), np.uint8(Status.FITTED)


@dataclass(frozen=True, eq=False)
class RepairedMarkers:
    """Markers after repair.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2) float64, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


class RingPrediction(NamedTuple):
    """Predictions of M markers by the markers around them, see ``predict_markers``; NaN where unknown.

    Attributes:
        xy_px: (M, 2) float64, by two rings.
        variance: (M,) float64, px^2 per axis, of the residuals in the rings.
        leverage: (M,) float64, of the neighbours' errors.
        support: (M,) int32, number of known neighbours.
        inner_xy_px: (M, 2) float64, by the inner ring alone.
    """

    xy_px: NDArray[np.float64]
    variance: NDArray[np.float64]
    leverage: NDArray[np.float64]
    support: NDArray[np.int32]
    inner_xy_px: NDArray[np.float64]


def repair_markers(
    refined: RefinedMarkers, places: InitialMarkers, lattice: Lattice, size: tuple[int, int]
) -> RepairedMarkers:
    """Drop inconsistent markers, repair lost ones that the others predict, and fuse uncertain ones with predictions.

    Args:
        refined: the markers after refinement.
        places: the markers before refinement.
        size: width and height of the image, px; no marker is reported outside the image.
    """
    kept = reject_inconsistent_markers(refined, places, lattice, size)
    uncertain, any_uncertain = find_uncertain_markers(kept.cov_px2, kept.edge_px)
    if kept.is_complete and not any_uncertain:
        return RepairedMarkers(kept.xy_px, kept.cov_px2, np.isfinite(kept.xy_px[:, 0]) * MEASURED)
    status = _fill_lost_markers(
        kept.xy_px, kept.cov_px2, uncertain, kept.edge_px, places.xy_px, lattice.ring_tables, size
    )
    return RepairedMarkers(kept.xy_px, kept.cov_px2, status)


@compiled
def _interpolated_edges(edge_px, neighbours):  # type: ignore[no-untyped-def]
    """(M,) the edge at each marker; where it is NaN, the mean of the neighbours' edges, or NaN without any."""
    out = edge_px.copy()
    for m in np.flatnonzero(np.isnan(edge_px)):
        total, count = 0.0, 0
        for n in neighbours[m]:
            if n >= 0 and not np.isnan(edge_px[n]):
                total += edge_px[n]
                count += 1
        out[m] = total / count if count > 0 else np.nan
    return out


@compiled
def _fill_lost_markers(xy, cov, uncertain, edge_px, implied, tables, size):  # type: ignore[no-untyped-def]
    """Write places and covariances of the lost markers that are predicted, and fuse the uncertain ones.

    Markers outside the image become NaN.

    Args:
        xy, cov: (M, 2) and (M, 2, 2), NaN where lost.
        uncertain: (M,) bool.
        edge_px: (M,) edge at each marker, px.
        implied: (M, 2) the places before refinement, which the cells imply, px.

    Returns:
        (M,) uint8, the status of all markers.
    """
    lost, edge_px = np.isnan(xy[:, 0]), _interpolated_edges(edge_px, tables.neighbours)
    status = np.where(lost, LOST, MEASURED)
    lost &= tables.present
    certain = _merged_rows(uncertain, np.full(xy.shape, np.nan), xy)
    rings = _predict_by_rings(certain, lost | uncertain, tables)
    for m in np.flatnonzero(lost | uncertain):
        variance = _variance_by_neighbours(m, rings, edge_px[m])
        if lost[m]:
            lost[m], status[m] = not _fill_marker(m, rings.xy_px[m], variance, xy, cov, size), REPAIRED
        elif variance >= 0.0:
            update_by_fusion(xy[m], cov[m], rings.xy_px[m], variance)
    known = _merged_rows(uncertain, xy, certain)
    if lost.any() and uncertain.any():
        rings = _predict_by_rings(known, lost, tables)
        for m in np.flatnonzero(lost):
            variance = _variance_by_neighbours(m, rings, edge_px[m])
            lost[m] = not _fill_marker(m, rings.xy_px[m], variance, xy, cov, size)
    for m in np.flatnonzero(lost):
        variance = _variance_by_cells(m, rings, implied[m], edge_px[m], size)
        lost[m] = not _fill_marker(m, implied[m], variance, xy, cov, size)
    if lost.any():  # the weaker and slower predictions, only for the remaining markers
        dense = lost & (rings.support >= MIN_CUBIC_NEIGHBOURS)
        by_cubic = cubic_variance(known, dense, tables.marker_mm, tables.neighbours)
        layer_xy, layer_variance = predict_by_layer(known, tables.layers)
        for m in np.flatnonzero(lost):
            variance = _variance_by_cubic(by_cubic[m], edge_px[m])
            if not _fill_marker(m, rings.xy_px[m], variance, xy, cov, size):
                status[m], variance = FITTED, _variance_by_layer(layer_variance[m], edge_px[m])
                _fill_marker(m, layer_xy[m], variance, xy, cov, size)
    for n in range(xy.shape[0]):
        if not (cov[n, 0, 0] >= 0.0 and is_inside_image(xy[n, 0], xy[n, 1], size)):
            xy[n], cov[n], status[n] = np.nan, np.nan, LOST
    return status


@compiled
def _merged_rows(selected, rows, other_rows):  # type: ignore[no-untyped-def]
    """``rows`` (n, ...) where selected (n,) bool, ``other_rows`` elsewhere."""
    out = other_rows.copy()
    for i in range(selected.shape[0]):
        if selected[i]:
            out[i] = rows[i]
    return out


@compiled
def _predict_by_rings(known, wanted, tables):  # type: ignore[no-untyped-def]
    """The ``RingPrediction`` of the wanted markers (M,) bool from the known places (M, 2)."""
    xy, variance, leverage, support = predict_markers(known, wanted, tables.marker_mm, tables.neighbours)
    inner = predict_markers(known, wanted, tables.marker_mm, tables.first_ring)
    return RingPrediction(xy, variance, leverage, support, inner[0])


@compiled
def _fill_marker(m, place, variance, xy, cov, size):  # type: ignore[no-untyped-def]
    """Write a marker's place and isotropic covariance; False if the variance is NaN or the place not in the image."""
    xy[m, 0], xy[m, 1] = place[0], place[1]
    cov[m, 0, 0], cov[m, 1, 1], cov[m, 0, 1], cov[m, 1, 0] = variance, variance, 0.0, 0.0
    return variance >= 0.0 and is_inside_image(place[0], place[1], size)


@compiled
def _variance_by_neighbours(m, rings, edge_px):  # type: ignore[no-untyped-def]
    """The variance of a lost marker's place by the two rings around it, px^2; NaN where the place is not safe."""
    variance, leverage, inner = rings.variance[m], rings.leverage[m], rings.inner_xy_px
    dx, dy = rings.xy_px[m, 0] - inner[m, 0], rings.xy_px[m, 1] - inner[m, 1]
    # where the inner ring alone predicts another place, the surface is too bent for both predictions
    unconfirmed = np.isnan(inner[m, 0])
    model_error = (OUTER_RING_ERROR * edge_px) ** 2 if unconfirmed else (dx * dx + dy * dy) / 4
    upper_bound = variance * (1 + leverage) + (MODEL_DEVIATION * edge_px) ** 2 + model_error
    if rings.support[m] < MILD_SUPPORT or not (
        leverage < MAX_LEVERAGE and upper_bound < (MAX_REPAIRED_DEVIATION * edge_px) ** 2
    ):
        return np.nan
    outer_error = 0.25 * (OUTER_RING_ERROR * edge_px) ** 2 if unconfirmed else 0.0
    return (MILD_ERROR * leverage) ** 2 * variance + outer_error


@compiled
def _variance_by_cubic(residual, edge_px):  # type: ignore[no-untyped-def]
    """The same where the surface is bent, but the rings are nearly whole, from the ``residual`` of a cubic, px^2."""
    variance = CUBIC_ERROR**2 * residual + (MODEL_DEVIATION * edge_px) ** 2
    return variance if variance < (MAX_REPAIRED_DEVIATION * edge_px) ** 2 else np.nan


@compiled
def _variance_by_layer(residual, edge_px):  # type: ignore[no-untyped-def]
    """The same by the quadratic through the marker's layer, from the variance of its ``residual``, px^2."""
    if not residual + (3 * MODEL_DEVIATION * edge_px) ** 2 < (MAX_FITTED_DEVIATION * edge_px) ** 2:
        return np.nan
    return HEAVY_ERROR * residual + (MODEL_DEVIATION * edge_px) ** 2


@compiled
def _variance_by_cells(m, rings, implied, edge_px, size):  # type: ignore[no-untyped-def]
    """The variance of the mean of the corners that a lost marker's cells imply (the article's eq. 6), px^2.

    NaN where the markers around predict another place, and at the image's border, which cuts cells. Where gridlines
    bend sharply, the prediction by markers is hardly better.
    """
    x, y = implied[0], implied[1]
    variance, leverage, predicted = rings.variance[m], rings.leverage[m], rings.xy_px
    distance2 = (x - predicted[m, 0]) ** 2 + (y - predicted[m, 1]) ** 2
    inside = min(x, y, size[0] - 1 - x, size[1] - 1 - y) > BORDER_WIDTH * edge_px
    limit2 = (MAX_IMPLIED_DISTANCE * edge_px) ** 2
    if not (inside and rings.support[m] >= MIN_RIM_SUPPORT and distance2 < limit2):
        return np.nan
    predicted_variance, own = variance * (1 + leverage), (IMPLIED_DEVIATION * edge_px) ** 2
    if not (
        leverage < MAX_RIM_LEVERAGE
        and predicted_variance < limit2
        and distance2 < 4 * (predicted_variance + own)
    ):
        return np.nan
    return 0.25 * distance2 + own
