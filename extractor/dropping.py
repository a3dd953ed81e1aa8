"""Stage 8, its first half: markers that contradict their neighbours are dropped.

Three rules: a marker must lie where its two rings put it; one of the outermost layer where the layers inside do; and
one of the rim that refinement took far from its triangles must have come nearer to where its neighbours are for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .fit import Refined
from .neighbourhood import MIN_QUADRATIC, deviant, predict, predicted, strays
from .placing import AGREED, Places
from .sampling import clamp
from .tables import Lattice

ROUNDS = 40  # at most; each drops the worst of every neighbourhood, until none is left
MAX_DEVIATION = 0.15  # of a marker from where its neighbours put it, in edges
MAX_TOLERANCE = 0.18  # in edges, where the surface is so bent that
SIGMAS = 6.0  # standard deviations of the prediction are more than that
FRAYED = 0.12, 0.3  # in edges, of a marker of the outermost layer from where the others put it, and
BENT_SIGMAS = 10.0  # standard deviations in between;
MAX_FRAYED = 0.35  # of the shortest edge there, in any case
MAX_MOVED = 0.12  # in edges, of such a marker by refinement, where
VAGUE = 0.02  # its gridlines may bend by more than that, and
MAX_MOVED_UNSURE = 0.065  # where
UNSURE = 0.018  # its own deviation is larger than that
MAX_AGREED_ALONE = 0.14  # in edges, where two triangles agree and the drawing explains nothing
MAX_AGREED = 0.3  # in edges, where all triangles agree: only sharp bends explain that
MAX_VAGUE = 0.12  # in edges, deviation of what neighbours say of a marker that only two triangles vouch for
MAX_UNEXPLAINED = 0.06  # in edges, of a marker on which something lies
MILD_SUPPORT = 10  # known neighbours of two rings that make an omission mild


class Believable(NamedTuple):
    """Markers that do not contradict each other.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2), NaN where lost or dropped.
        edge_px: (M,) the edges at each marker.
        sound: every marker of the pattern is known, and none was dropped.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    sound: bool


def believable(refined: Refined, places: Places, lattice: Lattice, size: tuple[int, int]) -> Believable:
    """The markers without those that contradict their neighbours.

    Args:
        refined: the markers as measured.
        places: the markers before refinement.
        size: width and height of the image, px.
    """
    xy, cov = refined.xy_px.copy(), refined.cov_px2.copy()
    edge_px = _edges(xy, lattice.ring, places.edge_px, places.agreed)
    near = edge_px * np.where(refined.explained, MAX_DEVIATION, MAX_AGREED_ALONE * places.agreed)
    slide = cov, refined.free_px, places.xy_px, edge_px, lattice.rim
    rings = lattice.ring_weights, lattice.neighbours
    if _sound(xy, near, slide, rings, (lattice.inner_weights, lattice.inner), lattice.present, size):
        return Believable(xy, cov, edge_px, True)
    places = replace(places, edge_px=edge_px)
    kinds = refined.explained | places.agreed, refined.explained, places.whole, places.agreed
    _drop_outliers(xy, cov, edge_px, near, kinds, *rings, lattice.marker_mm)
    _drop_frayed(xy, cov, places, lattice)
    _drop_slid(xy, cov, refined.free_px, places, lattice)
    return Believable(xy, cov, edge_px, False)


@compiled
def _edges(xy, ring, edge, agreed):  # type: ignore[no-untyped-def]
    """(M,) the edges at each marker; where no triangles agree, the way to the nearest of its known neighbours, if that
    is shorter: a share of a longer edge may reach half-way to another marker."""
    out = edge.copy()
    for m in range(xy.shape[0]):
        if agreed[m]:
            continue
        for n in ring[m]:
            if n >= 0:
                apart = np.hypot(xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1])
                if apart < out[m]:
                    out[m] = apart
    return out


@compiled
def _sound(xy, near, slide, rings, inner_rings, present, size):  # type: ignore[no-untyped-def]
    """Whether every marker of the pattern is known and none of the rules below could drop it: as a rule, all are."""
    cov, free, start, edge, rim = slide
    weights, table = rings
    inner_weights, inner = inner_rings
    for m in range(xy.shape[0]):
        x, y = xy[m]
        if np.isnan(x):
            if present[m]:
                return False
            continue
        if not inside(x, y, size):
            return False
        if strays(xy, m, near[m], weights, table):
            return False
        if inner[m, 0] >= 0 and strays(xy, m, FRAYED[0] * edge[m], inner_weights, inner):
            return False
        if rim[m] and _slides(xy, m, cov, free, start, edge):
            return False
    return True


@compiled
def inside(x, y, size):  # type: ignore[no-untyped-def]
    """Whether a place is within the image, out to the edges of its pixels; NaN is not."""
    return x >= -0.5 and y >= -0.5 and x <= size[0] - 0.5 and y <= size[1] - 0.5


@compiled
def _drop_outliers(xy, cov, edge, near, kinds, weights, table, marker_mm):  # type: ignore[no-untyped-def]
    """Set to NaN, the worst of each neighbourhood first, what lies where its neighbours say it cannot.

    What the drawing does not explain must lie nearer, and have neighbours that say so; what triangles do not agree on
    must have some. What all triangles agree on may lie farther off.
    """
    believed, explained, whole, agreed = kinds
    excess, stale = np.zeros(edge.shape[0]), np.ones(edge.shape[0], np.bool_)
    for _ in range(ROUNDS):
        # only what may be too far is looked at closely, and again where a neighbour has been dropped
        doubtful = deviant(xy, near, weights, table) & stale
        place, variance, leverage, support = predicted(xy, doubtful, marker_mm, table)
        for m in np.flatnonzero(stale):
            excess[m] = 0.0
            if not doubtful[m]:
                continue
            sigma = np.sqrt(variance[m] * (1 + leverage[m]))
            allowed = MAX_DEVIATION
            if whole[m]:
                allowed = MAX_AGREED
            elif not believed[m]:
                allowed = MAX_UNEXPLAINED
            elif not explained[m]:
                allowed = MAX_AGREED_ALONE
            elif support[m] >= MILD_SUPPORT:
                allowed = clamp(SIGMAS * sigma / edge[m], MAX_DEVIATION, MAX_TOLERANCE)
            apart = np.hypot(xy[m, 0] - place[m, 0], xy[m, 1] - place[m, 1])
            if np.isfinite(apart / (edge[m] * allowed)):
                excess[m] = apart / (edge[m] * allowed)
            elif not agreed[m]:  # nobody vouches for it: neither triangles nor neighbours
                excess[m] = np.inf
            vague = MAX_VAGUE if believed[m] else MAX_UNEXPLAINED
            if not (explained[m] or whole[m] or sigma < vague * edge[m]):  # they do not know themselves
                excess[m] = np.inf
        worst = np.flatnonzero(excess > 1.0)
        if worst.shape[0] == 0:
            break
        stale[:] = False
        for m in worst:
            largest = True
            for n in table[m]:
                largest = largest and (n < 0 or excess[m] >= excess[n])
            stale[m] = largest
        for m in np.flatnonzero(stale):
            xy[m], cov[m] = np.nan, np.nan
            for n in table[m]:
                if n >= 0:
                    stale[n] = True


def _drop_frayed(xy: NDArray[np.float64], cov: NDArray[np.float64], places: Places, lattice: Lattice) -> None:
    """Set to NaN the markers of the outermost layer that do not lie where the layers inside put them.

    An acute corner there belongs to few cells, and ink that ran out moves it and its neighbours alike.
    """
    edge, inner = places.edge_px, lattice.inner
    # only what may be too far is looked at closely
    doubtful = deviant(xy, FRAYED[0] * edge, lattice.inner_weights, inner) & (inner[:, 0] >= 0)
    if doubtful.any():
        place, variance, _, support = predict(xy, doubtful, lattice.marker_mm, inner)
        with np.errstate(invalid="ignore"):
            # the worse a quadratic fits the layers inside, the less it tells beyond them
            allowed = np.clip(BENT_SIGMAS * np.sqrt(variance) / edge, *FRAYED)
            apart = np.hypot(*(xy - place).T)
            shortest = _edges(xy, lattice.ring, edge, np.zeros(len(edge), np.bool_))
            bad = (apart > np.minimum(allowed * edge, MAX_FRAYED * shortest)) & (support >= MIN_QUADRATIC)
        xy[bad], cov[bad] = np.nan, np.nan


def _drop_slid(
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
    free_px: NDArray[np.float64],
    places: Places,
    lattice: Lattice,
) -> None:
    """The markers of the pattern's rim that refinement took far from their triangles and is not sure of stay only where
    it took them nearer to where the neighbours put them; else they return to their triangles, or are NaN where the
    neighbours say something else. Where no triangles agree, there was only a guess to be far from: such a marker stays
    near to where the neighbours put it, with that much doubt.

    Where two gridlines end that may bend, the corner between them slides along both.
    """
    slid = _slid(xy, cov, free_px, places.xy_px, places.edge_px, lattice.rim)
    if not slid.any():
        return
    expected, _, _, support = predict(xy, slid, lattice.marker_mm, lattice.neighbours)
    # at the corners of the rim two rings hold fewer than a quadratic takes, but the layers inside do not
    few = slid & (support < MIN_QUADRATIC)
    if few.any():
        inside, _, _, enough = predict(xy, few, lattice.marker_mm, lattice.inner)
        expected[few], support[few] = inside[few], enough[few]
    after, before = (np.hypot(*(start - expected).T) for start in (xy, places.xy_px))
    with np.errstate(invalid="ignore"):
        near, known = MAX_DEVIATION * places.edge_px, support >= MIN_QUADRATIC
        nearer = after < before
        stays = (nearer | ~places.agreed) & (after < near) & known
        back = slid & ~stays & (before < near) & known & places.agreed
    bad, guessed = slid & ~stays & ~back, slid & stays & ~nearer
    xy[bad], cov[bad] = np.nan, np.nan
    cov[guessed] += (0.25 * after[guessed] ** 2)[:, None, None] * np.eye(2)
    xy[back] = places.xy_px[back]
    cov[back] = ((AGREED * places.edge_px[back]) ** 2)[:, None, None] * np.eye(2)


@compiled
def _slides(xy, m, cov, free, start, edge):  # type: ignore[no-untyped-def]
    """Whether a marker lies far from its ``start`` and is not sure, or its gridlines bend (``free``, px)."""
    spread = cov[m, 0, 0] + cov[m, 1, 1]
    if spread > (UNSURE * edge[m]) ** 2:
        limit = MAX_MOVED_UNSURE
    elif free[m] > VAGUE * edge[m]:
        limit = MAX_MOVED
    else:
        return False
    dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
    return dx * dx + dy * dy > (limit * edge[m]) ** 2


@compiled
def _slid(xy, cov, free, start, edge, rim):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers of the rim that slide."""
    out = np.zeros(xy.shape[0], np.bool_)
    for m in range(xy.shape[0]):
        out[m] = rim[m] and _slides(xy, m, cov, free, start, edge)
    return out
