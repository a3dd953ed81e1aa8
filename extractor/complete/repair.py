"""Stage 8: markers that contradict their neighbours are dropped, and lost ones repaired where that is safe.

Mild omission (the article's eq. 6): the triangles around a lost marker imply its place; here all markers of two rings
do, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers of the same layer and
sextant, read at equidistant places. What neither can tell within a tenth of an edge stays lost.

A marker under dirt may be measured, but so vaguely that the rings know more of its place than it shows itself: it is
put between the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.complete.consistency_filter import MILD_SUPPORT, is_inside_image, reject_inconsistent_markers
from extractor.complete.layer_arcs import predict_by_layer
from extractor.complete.uncertain_markers import find_uncertain_markers, update_by_fusion
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.neighbour_prediction import MIN_CUBIC_NEIGHBOURS, cubic_variance, predict_markers
from extractor.numbering.marker_places import InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.refine.drawn_pattern import merged_rows
from extractor.refine.estimate import RefinedMarkers
from extractor.result import Status

MAX_IMPLIED_DISTANCE = 0.1  # in edges, of what cells imply from what markers do
IMPLIED_DEVIATION = 0.02  # in edges
BORDER_WIDTH = 0.25  # in edges, of the image, where cells that it cuts imply nothing
MAX_REPAIRED_DEVIATION = 0.08  # of a repaired marker, in edges: three of them stay below a quarter of an edge
MAX_FITTED_DEVIATION = (
    0.05  # the same of a fitted one: a layer's quadratic is wrong where the surface is bent
)
MIN_RIM_SUPPORT = 6  # the same for what cells imply, too
MAX_LEVERAGE = 1.2
MAX_RIM_LEVERAGE = 2.0  # the same for what cells imply, too
OUTER_RING_ERROR = (
    0.04  # in edges, what the outer ring may hide where too few of the inner one are known to say so
)
MODEL_DEVIATION = 0.012  # of an edge: what a smooth surface may hide from a quadratic map
# Errors of repaired markers against what their neighbours leave of the fit, from 300 rendered scenes with missing
# cells and dirt on flat, tilted, pressed and twisted patterns: deviation = MILD_ERROR * leverage * residual, as the
# surface hides the more from the map the farther this reaches. A layer's quadratic, which few markers carry, may seem
# to fit better than it does: its variance counts HEAVY_ERROR times, and never below that of the model.
MILD_ERROR = 1.6
HEAVY_ERROR = 2.0
# Likewise against what a cubic leaves in nearly whole rings, on the surfaces under balls, rings, ribs, wedges and cubes
# (their true markers, of which up to three around were taken away): 99 % of the errors stay below 1.5 such deviations.
CUBIC_ERROR = 1.6
LOST, MEASURED = np.uint8(Status.LOST), np.uint8(Status.MEASURED)
REPAIRED, FITTED = np.uint8(Status.REPAIRED), np.uint8(Status.FITTED)


@dataclass(frozen=True, eq=False)
class RepairedMarkers:
    """Markers after repair: (M, 2) places, (M, 2, 2) covariances, (M,) status; NaN and 0 where lost."""

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


def repair_markers(
    refined: RefinedMarkers, places: InitialMarkers, lattice: Lattice, size: tuple[int, int]
) -> RepairedMarkers:
    """Drop what contradicts its neighbours, repair what they imply, and let them say what is vague.

    Args:
        refined: the markers as measured.
        places: the markers before refinement.
        size: width and height of the image; nothing is reported outside.
    """
    xy, cov, edge_px, sound = reject_inconsistent_markers(refined, places, lattice, size)
    vague, some = find_uncertain_markers(cov, edge_px)
    if sound and not some:
        return RepairedMarkers(xy, cov, np.isfinite(xy[:, 0]) * MEASURED)
    tables = lattice.marker_mm, lattice.neighbours, lattice.first_ring, lattice.present, lattice.layers
    return RepairedMarkers(xy, cov, _fill_lost_markers(xy, cov, vague, edge_px, places.xy_px, *tables, size))


@compiled
def _interpolated_edges(edge, table):  # type: ignore[no-untyped-def]
    """(M,) the edges at each marker; where none was seen, the mean of its neighbours', or NaN."""
    out = edge.copy()
    for m in np.flatnonzero(np.isnan(edge)):
        total, count = 0.0, 0
        for n in table[m]:
            if n >= 0 and not np.isnan(edge[n]):
                total += edge[n]
                count += 1
        out[m] = total / count if count > 0 else np.nan
    return out


@compiled
def _fill_lost_markers(xy, cov, vague, edge, implied, marker_mm, table, ring, present, layers, size):  # type: ignore[no-untyped-def]
    """Write the places and covariances of the lost markers that can be told, NaN for those outside the image, and put
    the ``vague`` ones (M,) bool nearer to where others have them; (M,) uint8 the status of all."""
    lost, edge = np.isnan(xy[:, 0]), _interpolated_edges(edge, table)
    status = np.where(lost, LOST, MEASURED)
    lost &= present
    tables = marker_mm, table, ring
    clear = merged_rows(vague, np.full(xy.shape, np.nan), xy)
    near, nearer = _predict_by_rings(clear, lost | vague, *tables)
    for m in np.flatnonzero(lost | vague):
        variance = _variance_by_neighbours(m, near, nearer, edge[m])
        if lost[m]:
            lost[m], status[m] = not _fill_marker(m, near[0][m], variance, xy, cov, size), REPAIRED
        elif variance >= 0.0:
            update_by_fusion(xy[m], cov[m], near[0][m], variance)
    known = merged_rows(vague, xy, clear)
    if lost.any() and vague.any():
        near, nearer = _predict_by_rings(known, lost, *tables)
        for m in np.flatnonzero(lost):
            variance = _variance_by_neighbours(m, near, nearer, edge[m])
            lost[m] = not _fill_marker(m, near[0][m], variance, xy, cov, size)
    for m in np.flatnonzero(lost):
        lost[m] = not _fill_marker(
            m, implied[m], _variance_by_cells(m, near, implied, edge[m], size), xy, cov, size
        )
    if lost.any():  # what says less, and takes longer, is asked only of these
        bent = cubic_variance(known, lost & (near[3] >= MIN_CUBIC_NEIGHBOURS), marker_mm, table)
        along, doubt = predict_by_layer(known, layers)
        for m in np.flatnonzero(lost):
            if not _fill_marker(m, near[0][m], _variance_by_cubic(bent[m], edge[m]), xy, cov, size):
                status[m] = FITTED
                _fill_marker(m, along[m], _variance_by_layer(doubt[m], edge[m]), xy, cov, size)
    for n in range(xy.shape[0]):
        if not (cov[n, 0, 0] >= 0.0 and is_inside_image(xy[n, 0], xy[n, 1], size)):
            xy[n], cov[n], status[n] = np.nan, np.nan, LOST
    return status


@compiled
def _predict_by_rings(known, wanted, marker_mm, table, ring):  # type: ignore[no-untyped-def]
    """All that ``predict_markers`` says of the wanted markers by two rings, and where the inner one alone puts them."""
    return predict_markers(known, wanted, marker_mm, table), predict_markers(known, wanted, marker_mm, ring)[
        0
    ]


@compiled
def _fill_marker(m, place, variance, xy, cov, size):  # type: ignore[no-untyped-def]
    """Put a marker there, as sure along as across; False where that is not known, or not in the image."""
    xy[m, 0], xy[m, 1] = place[0], place[1]
    cov[m, 0, 0], cov[m, 1, 1], cov[m, 0, 1], cov[m, 1, 0] = variance, variance, 0.0, 0.0
    return variance >= 0.0 and is_inside_image(place[0], place[1], size)


@compiled
def _variance_by_neighbours(m, near, nearer, edge):  # type: ignore[no-untyped-def]
    """The variance of a lost marker's place by the two rings around it; NaN where that is not safe."""
    place, spread, leverage, support = near
    dx, dy = place[m, 0] - nearer[m, 0], place[m, 1] - nearer[m, 1]
    # where the inner ring alone says something else, the surface is too bent for either to be believed
    alone = np.isnan(nearer[m, 0])
    doubt = (OUTER_RING_ERROR * edge) ** 2 if alone else (dx * dx + dy * dy) / 4
    at_most = spread[m] * (1 + leverage[m]) + (MODEL_DEVIATION * edge) ** 2 + doubt
    if support[m] < MILD_SUPPORT or not (
        leverage[m] < MAX_LEVERAGE and at_most < (MAX_REPAIRED_DEVIATION * edge) ** 2
    ):
        return np.nan
    hidden = 0.25 * (OUTER_RING_ERROR * edge) ** 2 if alone else 0.0
    return (MILD_ERROR * leverage[m]) ** 2 * spread[m] + hidden


@compiled
def _variance_by_cubic(left, edge):  # type: ignore[no-untyped-def]
    """The same where the surface is bent, but the rings are nearly whole, by what a cubic has ``left`` in them."""
    variance = CUBIC_ERROR**2 * left + (MODEL_DEVIATION * edge) ** 2
    return variance if variance < (MAX_REPAIRED_DEVIATION * edge) ** 2 else np.nan


@compiled
def _variance_by_layer(doubt, edge):  # type: ignore[no-untyped-def]
    """The same by the quadratic through its layer, which leaves so much ``doubt``."""
    if not doubt + (3 * MODEL_DEVIATION * edge) ** 2 < (MAX_FITTED_DEVIATION * edge) ** 2:
        return np.nan
    return HEAVY_ERROR * doubt + (MODEL_DEVIATION * edge) ** 2


@compiled
def _variance_by_cells(m, near, implied, edge, size):  # type: ignore[no-untyped-def]
    """The variance of the corners that the cells around a lost marker imply, averaged (the article's eq. 6); NaN where
    the markers around say something else, and at the image's border, which cuts cells.

    Where gridlines bend sharply, the markers around tell little more than that.
    """
    expected, spread, leverage, support = near
    x, y = implied[m]
    square = (x - expected[m, 0]) ** 2 + (y - expected[m, 1]) ** 2
    deep = min(x, y, size[0] - 1 - x, size[1] - 1 - y) > BORDER_WIDTH * edge
    if not (deep and support[m] >= MIN_RIM_SUPPORT and square < (MAX_IMPLIED_DISTANCE * edge) ** 2):
        return np.nan
    known, own = spread[m] * (1 + leverage[m]), (IMPLIED_DEVIATION * edge) ** 2
    if not (
        leverage[m] < MAX_RIM_LEVERAGE
        and known < (MAX_IMPLIED_DISTANCE * edge) ** 2
        and square < 4 * (known + own)
    ):
        return np.nan
    return 0.25 * square + own
