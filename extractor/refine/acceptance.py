"""The final tests of markers, and the treatment of those that are covered."""

from __future__ import annotations

import numpy as np

from extractor.numbering.marker_places import MAX_PLACE_ERROR
from extractor.numeric.compilation import compiled
from extractor.refine.measure.gridline_bending import BEND_TO_END_SHIFT, mean_at_markers
from extractor.refine.refinement_step import PRIOR_PX
from extractor.refine.solve.fisher_information import covariances

# All in units of the edges around the marker, except the last but one:
MAX_SHIFT = 0.25  # from the start place,
MAX_SHIFT_ALL_CELLS = 0.13  # and where all triangles agree on that: in steep views these lie so far off
MAX_DEVIATION = 0.03  # of what is measured
MAX_SHIFT_UNEXPLAINED = 0.13  # from the start place, where the drawing explains nothing well
MAX_SHIFT_FROM_PREDICTION = 0.05  # from where the neighbours put an unaccepted marker
DOT_GAIN_FACTOR = 2.0  # times the dot gain, added to MAX_SHIFT_UNEXPLAINED: corners move most
UNEXPLAINED_DEVIATION = 0.015  # by dirt, of the visible part where the drawing does not explain the image
DIRT_DEVIATION = 0.01  # by dirt, where it does, but no gridline of the marker has any weight
DISAGREEMENT_SCALE = 0.03  # of profiles and triangles, where all triangles of a marker were found


@compiled
def accepted_markers(measured, information, bend_variance, edges, spokes, places, selected):  # type: ignore[no-untyped-def]
    """The markers that lie near their start place with a small deviation.

    Args:
        measured: (M, 2) px.
        information: ``Information`` about them.
        bend_variance: (E,) px^2.
        edges, spokes: (E, 2) and (M, 6).
        places: ``StartPlaces``.
        selected: (M,) bool, the markers to test; no other is accepted.

    Returns:
        (M, 2) px and (M, 2, 2) px^2: markers and covariances, NaN where not accepted.
    """
    xy, bending = measured.copy(), mean_at_markers(bend_variance, spokes)
    blocks = information.diagonal, information.off_diagonal
    cov = covariances(blocks[0], blocks[1], edges, spokes, 4 * PRIOR_PX**-2, selected)
    start, edge = places.xy_px, places.edge_px
    for m in range(xy.shape[0]):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        limit = (MAX_SHIFT_ALL_CELLS if places.is_intact[m] else MAX_SHIFT) * edge[m]
        cov[m, 0, 0] += BEND_TO_END_SHIFT**2 * bending[m]
        cov[m, 1, 1] += BEND_TO_END_SHIFT**2 * bending[m]
        spread = cov[m, 0, 0] + cov[m, 1, 1]
        if not (dx * dx + dy * dy < limit * limit and spread < (MAX_DEVIATION * edge[m]) ** 2):
            xy[m], cov[m] = np.nan, np.nan
    return xy, cov


@compiled
def add_dirt_variance(cov, weight, spokes, edge):  # type: ignore[no-untyped-def]
    """Add the variance by dirt to the covariances: dirt on some gridlines moves the others, too.

    Args:
        cov: (M, 2, 2) px^2, written.
        weight: (E,) 0 to 1, of the gridlines; 0 where nothing was measured.
        spokes: (M, 6) the gridlines at each marker.
        edge: (M,) px, the length of the edges at each marker.
    """
    for m in range(cov.shape[0]):
        missing, count = 0.0, 0
        for e in spokes[m]:
            if e >= 0 and weight[e] > 0.0:
                missing += 1.0 - weight[e]
                count += 1
        variance = (DIRT_DEVIATION * edge[m] * missing / max(count, 1)) ** 2
        cov[m, 0, 0] += variance
        cov[m, 1, 1] += variance


@compiled
def update_unaccepted_markers(xy, cov, reliable, start, edge, unexplained, dot_gain):  # type: ignore[no-untyped-def]
    """The markers that are neither accepted nor reliable.

    Args:
        xy, cov: (M, 2) px and (M, 2, 2) px^2, NaN where not accepted. Where all is ``unexplained``, markers far from
            their start become NaN.
        reliable: (M, 2) px, NaN where the image shows a marker little.
        start, edge: (M, 2) px, (M,) px, as in ``StartPlaces``.
        unexplained: the drawing does not explain the image.
        dot_gain: px.

    Returns:
        (M,) bool, the markers with a start that are not accepted or not reliable; and whether there are any.
    """
    out = np.zeros(xy.shape[0], np.bool_)
    for m in range(xy.shape[0]):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        limit = MAX_SHIFT_UNEXPLAINED * edge[m] + DOT_GAIN_FACTOR * abs(dot_gain)
        if unexplained and np.sqrt(dx * dx + dy * dy) > limit:
            xy[m], cov[m] = np.nan, np.nan
        out[m] = (np.isnan(xy[m, 0]) or np.isnan(reliable[m, 0])) and np.isfinite(start[m, 0])
    return out, np.any(out)


@compiled
def update_lost_markers(xy, cov, unaccepted, predicted, start, edge):  # type: ignore[no-untyped-def]
    """The markers that are lost.

    Args:
        xy, cov: (M, 2) px and (M, 2, 2) px^2; unaccepted markers far from where they are predicted become NaN.
        unaccepted: (M,) bool.
        predicted: (M, 2) px, where the neighbours put the markers.
        start, edge: (M, 2) px, (M,) px, as in ``StartPlaces``.

    Returns:
        (M,) bool, the markers with a start that are not accepted.
    """
    out = np.zeros(xy.shape[0], np.bool_)
    for m in np.flatnonzero(unaccepted):
        dx, dy = xy[m, 0] - predicted[m, 0], xy[m, 1] - predicted[m, 1]
        if not dx * dx + dy * dy < (MAX_SHIFT_FROM_PREDICTION * edge[m]) ** 2:
            xy[m], cov[m] = np.nan, np.nan
        out[m] = np.isnan(xy[m, 0]) and np.isfinite(start[m, 0])
    return out


@compiled
def update_obstructed_markers(xy, cov, selected, places):  # type: ignore[no-untyped-def]
    """Put covered markers between the places by profiles and by triangles; NaN where these differ much.

    Args:
        xy, cov: (M, 2) px and (M, 2, 2) px^2 by profiles, written.
        selected: (M,) bool, the covered markers.
        places: ``StartPlaces``, by triangles.
    """
    start, edge = places.xy_px, places.edge_px
    for m in np.flatnonzero(selected):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        distance = np.sqrt(dx * dx + dy * dy)
        if not distance < MAX_PLACE_ERROR * edge[m]:
            xy[m], cov[m] = np.nan, np.nan
            continue
        # all triangles around a marker are seldom wrong together: the larger the distance, the more they count
        ratio = distance / (DISAGREEMENT_SCALE * edge[m])
        share = 0.5 / (1.0 + ratio**2) if places.is_intact[m] else 0.5
        xy[m, 0], xy[m, 1] = start[m, 0] + share * dx, start[m, 1] + share * dy
        variance = 0.25 * distance**2 + (UNEXPLAINED_DEVIATION * edge[m]) ** 2
        cov[m, 0, 0] += variance
        cov[m, 1, 1] += variance
