"""Stage 8, its first half: markers that contradict their neighbours are dropped.

Three rules: a marker must lie where its two rings put it; one of the outermost layer where the layers inside do; and
one of the rim that refinement took far from its triangles must have come nearer to where its neighbours are for it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice_tables import Lattice
from extractor.layout.neighbour_tables import MIN_QUADRATIC_NEIGHBOURS
from extractor.localmap.neighbour_prediction import is_neighbour_outlier, predict_markers
from extractor.numbering.marker_places import AGREED_DEVIATION, InitialMarkers
from extractor.numeric.bilinear import clamp
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.refine.estimate import RefinedMarkers

MAX_ROUNDS = 40  # at most; each drops the worst of every neighbourhood, until none is left
MAX_DISTANCE = 0.15  # of a marker from where its neighbours put it, in edges
MAX_TOLERANCE = 0.18  # in edges, where the surface is so bent that
TOLERANCE_SIGMAS = 6.0  # standard deviations of the prediction are more than that
OUTER_TOLERANCE = 0.12, 0.3  # in edges, of a marker of the outermost layer from where the others put it, and
OUTER_TOLERANCE_SIGMAS = 10.0  # standard deviations in between;
MAX_OUTER_DISTANCE = 0.35  # of the shortest edge there, in any case
MAX_REFINEMENT_SHIFT = 0.12  # in edges, of such a marker by refinement, where
MAX_GRIDLINE_BEND = 0.02  # its gridlines may bend by more than that, and
MAX_UNCERTAIN_SHIFT = 0.065  # where
UNCERTAIN_DEVIATION = 0.018  # its own deviation is larger than that
MAX_AGREED_UNEXPLAINED_DISTANCE = 0.14  # in edges, where two triangles agree and the drawing explains nothing
MAX_AGREED_DISTANCE = 0.3  # in edges, where all triangles agree: only sharp bends explain that
MAX_PREDICTED_DEVIATION = (
    0.12  # in edges, deviation of what neighbours say of a marker that only two triangles vouch for
)
MAX_UNEXPLAINED_DISTANCE = 0.06  # in edges, of a marker on which something lies
MILD_SUPPORT = 10  # known neighbours of two rings that make an omission mild


class ConsistentMarkers(NamedTuple):
    """Markers that do not contradict each other.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2), NaN where lost or dropped.
        edge_px: (M,) the edges at each marker.
        sound: every marker of the pattern is known, and none was dropped.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    is_complete: bool


def reject_inconsistent_markers(
    refined: RefinedMarkers, places: InitialMarkers, lattice: Lattice, size: tuple[int, int]
) -> ConsistentMarkers:
    """The markers without those that contradict their neighbours.

    Args:
        refined: the markers as measured.
        places: the markers before refinement.
        size: width and height of the image, px.
    """
    xy, cov = refined.xy_px.copy(), refined.cov_px2.copy()
    seen = (
        refined.explained,
        refined.bend_deviation_px,
        places.xy_px,
        places.edge_px,
        places.agreed,
        places.whole,
    )
    rings = (
        lattice.ring_weights,
        lattice.neighbours,
        lattice.inward_weights,
        lattice.inward_neighbours,
        lattice.first_ring,
    )
    edge_px, sound = _update_rejecting_inconsistent(
        xy, cov, seen, rings, lattice.marker_mm, lattice.present, lattice.is_rim, size
    )
    return ConsistentMarkers(xy, cov, edge_px, sound)


@compiled
def _update_rejecting_inconsistent(xy, cov, seen, rings, marker_mm, present, rim, size):  # type: ignore[no-untyped-def]
    """Set to NaN what contradicts its neighbours; (M,) the edges at each marker, and whether all are sound."""
    explained, free, start, edge, agreed, whole = seen
    weights, table, inner_weights, inner, ring = rings
    edge, near = edge.copy(), np.zeros(xy.shape[0])
    for m in range(xy.shape[0]):
        if not agreed[m]:
            edge[m] = _shortest_edge(xy, m, ring, edge[m])
        near[m] = edge[m] * (MAX_DISTANCE if explained[m] else MAX_AGREED_UNEXPLAINED_DISTANCE * agreed[m])
    slide = cov, free, start, edge, rim
    if _is_consistent(xy, near, slide, (weights, table), (inner_weights, inner), present, size):
        return edge, True
    _update_rejecting_outliers(xy, cov, edge, near, (explained, whole, agreed), weights, table, marker_mm)
    _update_rejecting_outer_outliers(xy, cov, edge, inner_weights, inner, ring, marker_mm)
    _update_shifted_markers(
        xy,
        cov,
        _shifted_rim_markers(xy, cov, free, start, edge, rim),
        start,
        edge,
        agreed,
        table,
        inner,
        marker_mm,
    )
    return edge, False


@inlined_no_refcount
def _shortest_edge(xy, m, ring, edge):  # type: ignore[no-untyped-def]
    """The edge at marker m, or the way to the nearest of its known neighbours, if that is shorter: a share of a longer
    edge may reach half-way to another marker."""
    for k in range(ring.shape[1]):
        n = ring[m, k]
        if n >= 0:
            apart = np.hypot(xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1])
            if apart < edge:
                edge = apart
    return edge


@compiled
def _is_consistent(xy, near, slide, rings, inner_rings, present, size):  # type: ignore[no-untyped-def]
    """Whether every marker of the pattern is known and none of the rules below could drop it: as a rule, all are."""
    cov, free, start, edge, rim = slide
    weights, table = rings
    inner_weights, inner = inner_rings
    for m in range(xy.shape[0]):
        x, y = xy[m, 0], xy[m, 1]
        if np.isnan(x):
            if present[m]:
                return False
            continue
        if not is_inside_image(x, y, size):
            return False
        if is_neighbour_outlier(xy, m, near[m], weights, table):
            return False
        if inner[m, 0] >= 0 and is_neighbour_outlier(
            xy, m, OUTER_TOLERANCE[0] * edge[m], inner_weights, inner
        ):
            return False
        if rim[m] and _is_shifted(xy, m, cov, free, start, edge):
            return False
    return True


@compiled
def is_inside_image(x, y, size):  # type: ignore[no-untyped-def]
    """Whether a place is within the image, out to the edges of its pixels; NaN is not."""
    return x >= -0.5 and y >= -0.5 and x <= size[0] - 0.5 and y <= size[1] - 0.5


@compiled
def _update_rejecting_outliers(xy, cov, edge, near, kinds, weights, table, marker_mm):  # type: ignore[no-untyped-def]
    """Set to NaN, the worst of each neighbourhood first, what lies where its neighbours say it cannot."""
    excess, doubtful = np.zeros(edge.shape[0]), np.zeros(edge.shape[0], np.bool_)
    stale = np.arange(edge.shape[0])
    for _ in range(MAX_ROUNDS):
        # only what may be too far is looked at closely, and again where a neighbour has been dropped
        doubtful[:] = False
        for m in stale:
            excess[m] = 0.0
            doubtful[m] = not np.isnan(xy[m, 0]) and is_neighbour_outlier(xy, m, near[m], weights, table)
        place, variance, leverage, support = predict_markers(xy, doubtful, marker_mm, table)
        for m in np.flatnonzero(doubtful):
            apart = np.hypot(xy[m, 0] - place[m, 0], xy[m, 1] - place[m, 1])
            sigma = np.sqrt(variance[m] * (1 + leverage[m]))
            excess[m] = _misfit_ratio(m, apart, sigma, support[m], edge[m], kinds)
        worst = np.zeros(edge.shape[0], np.bool_)
        for m in np.flatnonzero(excess > 1.0):
            worst[m] = True
            for n in table[m]:
                worst[m] = worst[m] and (n < 0 or excess[m] >= excess[n])
        if not worst.any():
            break
        again = worst.copy()
        for m in np.flatnonzero(worst):
            xy[m], cov[m] = np.nan, np.nan
            for n in table[m]:
                if n >= 0:
                    again[n] = True
        stale = np.flatnonzero(again)


@compiled
def _misfit_ratio(m, apart, sigma, support, edge, kinds):  # type: ignore[no-untyped-def]
    """How far a marker lies from where its neighbours put it, over what is allowed; infinite where nobody vouches for
    it: neither triangles nor neighbours, or these do not know themselves.

    What the drawing does not explain must lie nearer, and have neighbours that say so; what triangles do not agree on
    must have some. What all triangles agree on may lie farther off.
    """
    explained, whole, agreed = kinds
    believed, allowed = explained[m] or agreed[m], MAX_DISTANCE
    if whole[m]:
        allowed = MAX_AGREED_DISTANCE
    elif not believed:
        allowed = MAX_UNEXPLAINED_DISTANCE
    elif not explained[m]:
        allowed = MAX_AGREED_UNEXPLAINED_DISTANCE
    elif support >= MILD_SUPPORT:
        allowed = clamp(TOLERANCE_SIGMAS * sigma / edge, MAX_DISTANCE, MAX_TOLERANCE)
    vague = MAX_PREDICTED_DEVIATION if believed else MAX_UNEXPLAINED_DISTANCE
    if not (explained[m] or whole[m] or sigma < vague * edge):
        return np.inf
    excess = apart / (edge * allowed)
    if np.isfinite(excess):
        return excess
    return 0.0 if agreed[m] else np.inf


@compiled
def _update_rejecting_outer_outliers(xy, cov, edge, weights, table, ring, marker_mm):  # type: ignore[no-untyped-def]
    """Set to NaN the markers of the outermost layer that do not lie where the layers inside put them.

    An acute corner there belongs to few cells, and ink that ran out moves it and its neighbours alike.
    """
    frayed = np.zeros(edge.shape[0], np.bool_)
    for m in np.flatnonzero((table[:, 0] >= 0) & ~np.isnan(xy[:, 0])):
        # only what may be too far is looked at closely
        frayed[m] = is_neighbour_outlier(xy, m, OUTER_TOLERANCE[0] * edge[m], weights, table)
    if not frayed.any():
        return
    place, variance, _, support = predict_markers(xy, frayed, marker_mm, table)
    for m in np.flatnonzero(frayed):
        # the worse a quadratic fits the layers inside, the less it tells beyond them
        allowed = (
            clamp(
                OUTER_TOLERANCE_SIGMAS * np.sqrt(variance[m]) / edge[m],
                OUTER_TOLERANCE[0],
                OUTER_TOLERANCE[1],
            )
            * edge[m]
        )
        limit = min(allowed, MAX_OUTER_DISTANCE * _shortest_edge(xy, m, ring, edge[m]))
        apart = np.hypot(xy[m, 0] - place[m, 0], xy[m, 1] - place[m, 1])
        frayed[m] = apart > limit and support[m] >= MIN_QUADRATIC_NEIGHBOURS
    xy[frayed], cov[frayed] = np.nan, np.nan


@compiled
def _update_shifted_markers(xy, cov, slid, start, edge, agreed, table, inner, marker_mm):  # type: ignore[no-untyped-def]
    """The markers of the pattern's rim that refinement took far from their triangles and is not sure of (``slid``) stay
    only where it took them nearer to where the neighbours put them; else they return to their triangles, or are NaN
    where the neighbours say something else. Where no triangles agree, there was only a guess to be far from: such a
    marker stays near to where the neighbours put it, with that much doubt.

    Where two gridlines end that may bend, the corner between them slides along both.
    """
    if not slid.any():
        return
    place, _, _, support = predict_markers(xy, slid, marker_mm, table)
    # at the corners of the rim two rings hold fewer than a quadratic takes, but the layers inside do not
    few = slid & (support < MIN_QUADRATIC_NEIGHBOURS)
    if few.any():
        inside, _, _, enough = predict_markers(xy, few, marker_mm, inner)
        for m in np.flatnonzero(few):
            place[m], support[m] = inside[m], enough[m]
    for m in np.flatnonzero(slid):
        after = np.hypot(xy[m, 0] - place[m, 0], xy[m, 1] - place[m, 1])
        before = np.hypot(start[m, 0] - place[m, 0], start[m, 1] - place[m, 1])
        near, known = MAX_DISTANCE * edge[m], support[m] >= MIN_QUADRATIC_NEIGHBOURS
        if known and after < near and (after < before or not agreed[m]):
            if not after < before:
                cov[m, 0, 0] += 0.25 * after**2
                cov[m, 1, 1] += 0.25 * after**2
        elif known and before < near and agreed[m]:
            xy[m] = start[m]
            cov[m] = np.eye(2) * (AGREED_DEVIATION * edge[m]) ** 2
        else:
            xy[m], cov[m] = np.nan, np.nan


@inlined_no_refcount
def _is_shifted(xy, m, cov, free, start, edge):  # type: ignore[no-untyped-def]
    """Whether a marker lies far from its ``start`` and is not sure, or its gridlines bend (``free``, px)."""
    spread = cov[m, 0, 0] + cov[m, 1, 1]
    if spread > (UNCERTAIN_DEVIATION * edge[m]) ** 2:
        limit = MAX_UNCERTAIN_SHIFT
    elif free[m] > MAX_GRIDLINE_BEND * edge[m]:
        limit = MAX_REFINEMENT_SHIFT
    else:
        return False
    dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
    return dx * dx + dy * dy > (limit * edge[m]) ** 2


@compiled
def _shifted_rim_markers(xy, cov, free, start, edge, rim):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers of the rim that slide."""
    out = np.zeros(xy.shape[0], np.bool_)
    for m in range(xy.shape[0]):
        out[m] = rim[m] and _is_shifted(xy, m, cov, free, start, edge)
    return out
