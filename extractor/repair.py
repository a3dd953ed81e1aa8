"""Stage 8: markers that contradict their neighbours are dropped, and lost ones are repaired where that is safe.

Mild omission (the article's eq. 6): the triangles around a lost marker imply its place; here all markers of two rings
do, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers of the same layer and
sextant, read at equidistant places. What neither can tell within a tenth of an edge stays lost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .arcs import by_layer
from .engine import compiled
from .fit import Refined
from .neighbourhood import INNER, MIN_QUADRATIC, deviant, predict
from .placing import AGREED, Places
from .tables import Lattice
from .types import Status

ROUNDS = 40  # at most; each drops the worst of every neighbourhood, until none is left
MAX_DEVIATION = 0.15  # of a marker from where its neighbours put it, in edges
MAX_TOLERANCE = 0.18  # in edges, where the surface is so bent that
FRAYED = 0.12, 0.3  # in edges, of a marker of the outermost layer from where the others put it, and
MAX_MOVED = 0.12  # in edges, of such a marker by refinement, where
VAGUE = 0.02  # its standard deviation, or that of its gridlines' bending, is larger than that
BENT_SIGMAS = 10.0  # standard deviations in between
MAX_AGREED_ALONE = 0.14  # in edges, where two triangles agree and the drawing explains nothing
MAX_AGREED = 0.3  # in edges, where all triangles agree: only sharp bends explain that
MAX_IMPLIED = 0.1  # in edges, of what cells imply from what markers do
IMPLIED_SIGMA = 0.02  # in edges
BORDER = 0.25  # in edges, of the image, where cells that it cuts imply nothing
MAX_UNEXPLAINED = 0.06  # in edges, of a marker on which something lies
SIGMAS = 6.0  # standard deviations of the prediction are more than that
MAX_SIGMA = 0.08  # of a repaired marker, in edges: three of them stay below a quarter of an edge
MAX_FITTED_SIGMA = 0.05  # the same of a fitted one: a layer's quadratic is wrong where the surface is bent
MILD_SUPPORT = 10  # known neighbours of two rings that make an omission mild
RIM_SUPPORT = 6  # the same for what cells imply, too
MAX_LEVERAGE = 1.2
RIM_LEVERAGE = 2.0  # the same for what cells imply, too
UNSEEN = 0.04  # in edges, what the outer ring may hide where too few of the inner one are known to say so
MODEL_SIGMA = 0.012  # of an edge: what a smooth surface may hide from a quadratic map
# Errors of repaired markers against what their neighbours leave of the fit, from 300 rendered scenes with missing
# cells and dirt on flat, tilted, pressed and twisted patterns: deviation = MILD_ERROR * leverage * residual, as the
# surface hides the more from the map the farther this reaches. A layer's quadratic, which few markers carry, may seem
# to fit better than it does: its variance counts HEAVY_ERROR times, and never below that of the model.
MILD_ERROR = 2.0
HEAVY_ERROR = 1.4


@dataclass(frozen=True, eq=False)
class Repaired:
    """Markers after repair: (M, 2) places, (M, 2, 2) covariances, (M,) status; NaN and 0 where lost."""

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


def repair(refined: Refined, places: Places, lattice: Lattice, size: tuple[int, int]) -> Repaired:
    """Drop what contradicts its neighbours and repair what they imply.

    Args:
        refined: the markers as measured.
        places: the markers before refinement.
        size: width and height of the image; nothing is reported outside.
    """
    xy, cov = refined.xy_px.copy(), refined.cov_px2.copy()
    shortest = _shortest(xy, lattice.neighbours[:, INNER], places.edge_px)
    places = replace(places, edge_px=np.where(places.agreed, places.edge_px, shortest))
    _drop_outliers(xy, cov, places, refined.explained, lattice)
    _drop_frayed(xy, cov, places, refined.explained, lattice)
    _drop_slid(xy, cov, refined.free_px, places, lattice)
    measured, edge = xy.copy(), _filled(shortest, lattice)
    outside = ~_inside(xy, size)
    xy[outside], cov[outside] = np.nan, np.nan
    status = np.where(outside, Status.LOST, Status.MEASURED).astype(np.uint8)
    if status[lattice.present].all():
        return Repaired(xy, cov, status)
    for place, variance, kind in (
        (*_by_neighbours(measured, edge, lattice), Status.REPAIRED),
        (*_by_cells(measured, places, edge, lattice, size), Status.REPAIRED),
        (*_by_layer(measured, edge, lattice), Status.FITTED),
    ):
        use = (status == Status.LOST) & _inside(place, size) & lattice.present
        xy[use] = place[use]
        cov[use] = np.eye(2) * variance[use, None, None]
        status[use] = kind
    return Repaired(xy, cov, status)


def _inside(xy: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Places within the image, out to the edges of its pixels; NaN not."""
    return np.asarray((xy >= -0.5).all(axis=1) & (xy <= np.array(size) - 0.5).all(axis=1))


@compiled
def _shortest(xy, around, edge):  # type: ignore[no-untyped-def]
    """(M,) the way from each marker to the nearest of its known neighbours, or its edge where that is shorter: what
    lies off by a share of a longer one is another's."""
    out = edge.copy()
    for m in range(xy.shape[0]):
        for n in around[m]:
            if n >= 0:
                apart = np.hypot(xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1])
                if apart < out[m]:
                    out[m] = apart
    return out


def _drop_outliers(
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
    places: Places,
    explained: NDArray[np.bool_],
    lattice: Lattice,
) -> None:
    """Set to NaN, the worst of each neighbourhood first, what lies where its neighbours say it cannot.

    What the drawing does not explain must lie nearer, and have neighbours that say so; what all triangles agree on may
    lie farther off.
    """
    table, edge, believed = lattice.neighbours, places.edge_px, explained | places.agreed
    limit = np.where(explained, MAX_DEVIATION, MAX_AGREED_ALONE) * edge * believed
    for _ in range(ROUNDS):
        known = np.isfinite(xy[:, 0])
        # only what may be too far is looked at closely
        doubtful = deviant(xy, limit, lattice.ring_weights, table)
        if not doubtful.any():
            break
        place, variance, leverage, support = predict(xy, doubtful, lattice.marker_mm, table)
        sigma = np.sqrt(variance * (1 + leverage))
        apart = xy - place
        deviation = np.hypot(apart[:, 0], apart[:, 1])
        with np.errstate(invalid="ignore"):
            allowed = np.where(support >= MILD_SUPPORT, SIGMAS * sigma / edge, 0.0)
            usual = np.clip(allowed, MAX_DEVIATION, MAX_TOLERANCE)
            allowed = np.where(believed, usual, MAX_UNEXPLAINED)
            allowed = np.where(believed & ~explained, np.minimum(allowed, MAX_AGREED_ALONE), allowed)
            allowed = np.where(places.whole, MAX_AGREED, allowed)
            excess = deviation / (edge * allowed)
        excess[~np.isfinite(excess)] = 0.0
        with np.errstate(invalid="ignore"):
            vouched = sigma < MAX_UNEXPLAINED * edge
        excess[known & ~believed & ~vouched & doubtful] = np.inf
        if not (excess > 1.0).any():
            break
        around = np.where(table >= 0, excess[table], 0.0).max(axis=1)
        bad = (excess > 1.0) & (excess >= around)
        xy[bad] = np.nan
        cov[bad] = np.nan


def _drop_frayed(
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
    places: Places,
    explained: NDArray[np.bool_],
    lattice: Lattice,
) -> None:
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
            bad = (apart > allowed * edge) & (support >= MIN_QUADRATIC)
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
    neighbours say something else.

    Where two gridlines end that may bend, the corner between them slides along both.
    """
    slid = _slid(
        xy, cov, free_px, places.xy_px, places.edge_px, lattice.neighbours[:, INNER], lattice.present
    )
    if not slid.any():
        return
    expected, _, _, support = predict(xy, slid, lattice.marker_mm, lattice.neighbours)
    # at the corners of the rim two rings hold fewer than a quadratic takes, but the layers inside do not
    few = slid & (support < MIN_QUADRATIC)
    if few.any():
        inside, _, _, known = predict(xy, few, lattice.marker_mm, lattice.inner)
        expected[few], support[few] = inside[few], known[few]
    after, before = (np.hypot(*(start - expected).T) for start in (xy, places.xy_px))
    with np.errstate(invalid="ignore"):
        near, enough = MAX_DEVIATION * places.edge_px, support >= MIN_QUADRATIC
        stays = (after < before) & (after < near) & enough
        back = slid & ~stays & (before < near) & enough & places.agreed
    bad = slid & ~stays & ~back
    xy[bad], cov[bad] = np.nan, np.nan
    xy[back] = places.xy_px[back]
    cov[back] = ((AGREED * places.edge_px[back]) ** 2)[:, None, None] * np.eye(2)


@compiled
def _slid(xy, cov, free, start, edge, around, present):  # type: ignore[no-untyped-def]
    """(M,) bool: markers of the rim that lie far from their ``start`` and are not sure, or their gridlines bend
    (``free``, px)."""
    out = np.zeros(xy.shape[0], np.bool_)
    for m in range(xy.shape[0]):
        inside = True
        for n in around[m]:
            inside = inside and n >= 0 and present[n]
        limit = VAGUE * edge[m]
        if not inside and (cov[m, 0, 0] + cov[m, 1, 1] > limit**2 or free[m] > limit):
            dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
            out[m] = dx * dx + dy * dy > (MAX_MOVED * edge[m]) ** 2
    return out


def _filled(edge: NDArray[np.float64], lattice: Lattice) -> NDArray[np.float64]:
    """The edges at each marker; where none was seen, the mean of its neighbours'."""
    around = np.where(lattice.neighbours >= 0, edge[lattice.neighbours], np.nan)
    count = np.isfinite(around).sum(axis=1)
    mean = np.nansum(around, axis=1) / np.maximum(count, 1)
    return np.where(np.isfinite(edge), edge, np.where(count > 0, mean, np.nan))


def _by_neighbours(
    xy: NDArray[np.float64], edge: NDArray[np.float64], lattice: Lattice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(M, 2) places by the two rings around each lost marker, NaN where not safe, and their (M,) variances."""
    lost = np.isnan(xy[:, 0])
    place, variance, leverage, support = predict(xy, lost, lattice.marker_mm, lattice.neighbours)
    nearer = predict(xy, lost, lattice.marker_mm, lattice.neighbours[:, INNER])[0]
    with np.errstate(invalid="ignore"):
        # where the inner ring alone says something else, the surface is too bent for either to be believed
        alone = np.isnan(nearer[:, 0])
        doubt = np.where(alone, (UNSEEN * edge) ** 2, ((place - nearer) ** 2).sum(axis=1) / 4)
        at_most = variance * (1 + leverage) + (MODEL_SIGMA * edge) ** 2 + doubt
        safe = (support >= MILD_SUPPORT) & (leverage < MAX_LEVERAGE) & (at_most < (MAX_SIGMA * edge) ** 2)
    hidden = np.where(alone, 0.25 * (UNSEEN * edge) ** 2, 0.0)
    return np.where(safe[:, None], place, np.nan), (MILD_ERROR * leverage) ** 2 * variance + hidden


def _by_cells(
    xy: NDArray[np.float64],
    places: Places,
    edge: NDArray[np.float64],
    lattice: Lattice,
    size: tuple[int, int],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(M, 2) the corners that the cells around each lost marker imply, averaged (the article's eq. 6), and their (M,)
    variance; NaN where the markers around say something else, and at the image's border, which cuts cells.

    Where gridlines bend sharply, the markers around tell little more than that.
    """
    lost = np.isnan(xy[:, 0])
    expected, spread, leverage, support = predict(xy, lost, lattice.marker_mm, lattice.neighbours)
    apart = places.xy_px - expected
    squares = (apart**2).sum(axis=1)
    with np.errstate(invalid="ignore"):
        deep = np.minimum(places.xy_px, np.array(size) - 1 - places.xy_px).min(axis=1) > BORDER * edge
        use = lost & deep & (support >= RIM_SUPPORT) & (squares < (MAX_IMPLIED * edge) ** 2)
        known = spread * (1 + leverage)
        use &= (
            (leverage < RIM_LEVERAGE)
            & (known < (MAX_IMPLIED * edge) ** 2)
            & (squares < 4 * (known + (IMPLIED_SIGMA * edge) ** 2))
        )
    variance = 0.25 * squares + (IMPLIED_SIGMA * edge) ** 2
    return np.where(use[:, None], places.xy_px, np.nan), np.where(use, variance, np.nan)


def _by_layer(
    xy: NDArray[np.float64], edge: NDArray[np.float64], lattice: Lattice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(M, 2) places by the markers of each lost marker's layer, NaN where not safe, and their (M,) variances."""
    place, variance = by_layer(xy, lattice.layers)
    with np.errstate(invalid="ignore"):
        safe = variance + (3 * MODEL_SIGMA * edge) ** 2 < (MAX_FITTED_SIGMA * edge) ** 2
    return np.where(safe[:, None], place, np.nan), HEAVY_ERROR * variance + (MODEL_SIGMA * edge) ** 2
