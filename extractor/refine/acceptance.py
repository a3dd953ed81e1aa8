"""Which markers of a fit are sure, and what becomes of those on which something lies."""

from __future__ import annotations

import numpy as np

from extractor.numbering.marker_places import MAX_PLACE_ERROR
from extractor.numeric.compilation import compiled
from extractor.refine.measure.gridline_bending import BEND_TO_END_SHIFT, mean_at_markers
from extractor.refine.refinement_step import PRIOR_PX
from extractor.refine.solve.fisher_information import covariances

MAX_SHIFT = 0.25  # in units of the edges around the marker,
MAX_SHIFT_ALL_CELLS = 0.13  # and where all of its triangles agree: in steep views these lie so far off
MAX_DEVIATION = 0.03  # of what is measured, in the same units
MAX_SHIFT_UNEXPLAINED = (
    0.13  # likewise, that a marker may be moved by where the drawing explains nothing well
)
MAX_SHIFT_FROM_PREDICTION = (
    0.05  # likewise, of a marker that the image hardly shows, from where its neighbours put it
)
DOT_GAIN_FACTOR = 2.0  # times the swelling of the cells, that it may be moved by besides: corners swell most
# Where the drawing does not explain the image, dirt moves what is left to see, in units of the edges around the marker.
UNEXPLAINED_DEVIATION = 0.015
DIRT_DEVIATION = (
    0.01  # likewise, where the drawing does explain it, but none of the marker's gridlines is trusted
)
DISAGREEMENT_SCALE = 0.03  # where all triangles of a marker were found


@compiled
def accepted_markers(measured, diagonal, beside, loose, edges, spokes, start, edge, whole, which):  # type: ignore[no-untyped-def]
    """Markers and covariances, NaN where a marker lies far from its ``start``, is not sure, or not one of
    ``gridlines``."""
    xy, hidden = measured.copy(), mean_at_markers(loose, spokes)
    cov = covariances(diagonal, beside, edges, spokes, 4 * PRIOR_PX**-2, which)
    for m in range(xy.shape[0]):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        limit = (MAX_SHIFT_ALL_CELLS if whole[m] else MAX_SHIFT) * edge[m]
        cov[m, 0, 0] += BEND_TO_END_SHIFT**2 * hidden[m]
        cov[m, 1, 1] += BEND_TO_END_SHIFT**2 * hidden[m]
        spread = cov[m, 0, 0] + cov[m, 1, 1]
        if not (dx * dx + dy * dy < limit * limit and spread < (MAX_DEVIATION * edge[m]) ** 2):
            xy[m], cov[m] = np.nan, np.nan
    return xy, cov


@compiled
def add_dirt_variance(cov, use, spokes, edge):  # type: ignore[no-untyped-def]
    """Widen the covariances (M, 2, 2), in place, by how little the gridlines at each marker are trusted, by their use
    (E,), 0 where nothing was read: what lies on some of them moves the others, too."""
    for m in range(cov.shape[0]):
        hidden, count = 0.0, 0
        for e in spokes[m]:
            if e >= 0 and use[e] > 0.0:
                hidden += 1.0 - use[e]
                count += 1
        doubted = (DIRT_DEVIATION * edge[m] * hidden / max(count, 1)) ** 2
        cov[m, 0, 0] += doubted
        cov[m, 1, 1] += doubted


@compiled
def update_unaccepted_markers(xy, cov, guiding, start, edge, strange, swelling):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers that are known to start with but not sure, or that guide nothing; and whether there are
    any. Where all is ``is_outlier``, those that lie far from their ``start`` are made unsure, in place; cells have a
    ``dot_gain``, px.
    """
    out = np.zeros(xy.shape[0], np.bool_)
    for m in range(xy.shape[0]):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        if strange and np.sqrt(dx * dx + dy * dy) > MAX_SHIFT_UNEXPLAINED * edge[m] + DOT_GAIN_FACTOR * abs(
            swelling
        ):
            xy[m], cov[m] = np.nan, np.nan
        out[m] = (np.isnan(xy[m, 0]) or np.isnan(guiding[m, 0])) and np.isfinite(start[m, 0])
    return out, np.any(out)


@compiled
def update_lost_markers(xy, cov, unsure, put, start, edge):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers that are known to start with but not sure. Those ``unsure`` (M,) bool are made so, in
    place, where they do not lie where their neighbours ``put`` them (M, 2)."""
    out = np.zeros(xy.shape[0], np.bool_)
    for m in np.flatnonzero(unsure):
        dx, dy = xy[m, 0] - put[m, 0], xy[m, 1] - put[m, 1]
        if not dx * dx + dy * dy < (MAX_SHIFT_FROM_PREDICTION * edge[m]) ** 2:
            xy[m], cov[m] = np.nan, np.nan
        out[m] = np.isnan(xy[m, 0]) and np.isfinite(start[m, 0])
    return out


@compiled
def update_obstructed_markers(xy, cov, which, start, edge, whole):  # type: ignore[no-untyped-def]
    """Put markers on which something lies between what profiles and triangles (``start``) say, in place; NaN where
    these differ."""
    for m in np.flatnonzero(which):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        apart = np.sqrt(dx * dx + dy * dy)
        if not apart < MAX_PLACE_ERROR * edge[m]:
            xy[m], cov[m] = np.nan, np.nan
            continue
        # all triangles around a marker are seldom wrong together: the farther off, the more they count
        share = 0.5 / (1.0 + (apart / (DISAGREEMENT_SCALE * edge[m])) ** 2) if whole[m] else 0.5
        xy[m, 0], xy[m, 1] = start[m, 0] + share * dx, start[m, 1] + share * dy
        doubted = 0.25 * apart**2 + (UNEXPLAINED_DEVIATION * edge[m]) ** 2
        cov[m, 0, 0] += doubted
        cov[m, 1, 1] += doubted
