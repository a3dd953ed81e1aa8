"""Markers that stray: dirt that looks like a gridline has led them away from where the pattern can be.

Two things that do not depend on each other tell: their gridlines do not look as the pattern does, and most gridlines
through them say that the map would be smooth were they moved by the same vector. They start anew from there. What is
bent sharply, at the rim of an object or where it slips, moves from one gridline to the next by other vectors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .bending import third_difference
from .engine import compiled
from .fit import Fit
from .gridlines import FIRST_RING
from .placing import MAX_APART, Places
from .sight import Sight
from .step import completed
from .topology import Topology

DOUBTED = 0.55  # mean trust in the gridlines read at a marker, below which it is doubted
# To stray, a marker must have to move by so many times what those around it must, if doubted, and if not;
UNUSUAL = 3.0, 6.0
LEAST = 0.02, 0.03  # and by so much of an edge.
# Its gridlines agree on a move if more than this share of them, and no fewer than so many,
MOST, FEWEST = 0.7, 3
ALIKE = 0.5  # ask for one that differs by less than this share of it.
RINGS = 2  # of strays that the markers around are continued to
ROUNDS = 6  # one marker that strays hides what is wrong with its neighbours
# The share of a third difference that is the error of one of its two inner markers; all of it is, of an outer one.
PART = 1.0 / 3.0


def collected(
    view: Sight, mesh: Topology, fit: Fit, trusted: NDArray[np.float64], places: Places
) -> tuple[Fit, Places]:
    """The fit and the places (of the full image), those that dirt has led astray put where their neighbours say;
    ``trusted`` (E,) is how far gridlines look as they should."""
    known = np.where(fit.beyond[:, None], np.nan, fit.guiding)
    strays, doubted = astray(mesh, fit, known, trusted, places.edge_px / view.scale)
    led = strays | (doubted & ~places.agreed)
    if not led.any():
        return fit, places
    xy = np.where(led[:, None], np.nan, known)
    for _ in range(RINGS):
        xy = completed(mesh, xy)[0]
    led &= np.isfinite(xy[:, 0])
    at = led[:, None]
    fit = fit._replace(measured=np.where(at, xy, fit.measured), guiding=np.where(at, xy, fit.guiding))
    here = np.where(at, view.full(xy), places.xy_px)
    with np.errstate(invalid="ignore"):
        apart = np.linalg.norm(here - places.xy_px, axis=1) > MAX_APART * places.edge_px
    return fit, replace(places, xy_px=here, agreed=places.agreed & ~apart, whole=places.whole & ~led)


def astray(
    mesh: Topology,
    fit: Fit,
    xy: NDArray[np.float64],
    trusted: NDArray[np.float64],
    edge_px: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(M,) which of the markers ``xy`` (M, 2) strayed, and (M,) which have gridlines that look unlike the pattern;
    without any of these, none strayed."""
    assert fit.reading is not None
    doubted, some = doubted_ones(trusted, fit.reading.use > 0.0, mesh.spokes)
    if not some:
        return doubted, doubted
    lattice = mesh.edges, mesh.ahead, mesh.third, mesh.spokes, mesh.onward, mesh.near
    return straying(xy, fit.maps, doubted, edge_px, *lattice), doubted


@compiled
def doubted_ones(use, read, spokes):  # type: ignore[no-untyped-def]
    """(M,) bool: markers whose gridlines, of those that were ``read`` (E,), are little trusted (``use``); and whether
    there are any."""
    out = np.zeros(spokes.shape[0], np.bool_)
    for m in range(spokes.shape[0]):
        total, count = 0.0, 0
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and read[e]:
                total += use[e]
                count += 1
        out[m] = total < DOUBTED * count
    return out, np.any(out)


@compiled
def straying(xy, maps, doubted, edge, edges, ahead, third, spokes, onward, near):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers that strayed.

    ``doubted``: (M,) bool. ``edge``: (M,) px, the length of the edges at each. ``xy``: NaN where nothing is known.
    """
    count = xy.shape[0]
    out, strays, anew = xy.copy(), np.zeros(count, np.bool_), np.ones(count, np.bool_)
    move, far, alike = np.zeros((count, 2)), np.full(count, np.nan), np.zeros(count, np.bool_)
    bent = np.empty((edges.shape[0], 2))
    for _ in range(ROUNDS):
        _third_differences(out, maps, edges, ahead, third, bent)
        _ask(bent, anew, edges, ahead, spokes, onward, move, far, alike)
        anew[:] = False
        for m in range(count):
            unusual, least = (UNUSUAL[0], LEAST[0]) if doubted[m] else (UNUSUAL[1], LEAST[1])
            if not (alike[m] and far[m] > least * edge[m]):
                continue
            first = True  # of its neighbours in how far it would have to move
            for k in range(FIRST_RING):
                n = near[m, k]
                first = first and not (n >= 0 and far[n] > far[m])
            if first and far[m] > unusual * _usual(far, near[m]):
                out[m, 0] -= move[m, 0]
                out[m, 1] -= move[m, 1]
                strays[m] = anew[m] = True
                for k in range(near.shape[1]):
                    n = near[m, k]
                    anew[n if n >= 0 else m] = True
        if not np.any(anew):
            break
    return strays


@compiled
def _third_differences(xy, maps, edges, ahead, third, out):  # type: ignore[no-untyped-def]
    """Fill in (E, 2) px, NaN where one of the four markers along a gridline is not known."""
    for e in range(edges.shape[0]):
        out[e, 0], out[e, 1] = np.nan, np.nan
        if ahead[e, 0] >= 0 and ahead[e, 1] >= 0:
            out[e, 0], out[e, 1] = third_difference(xy, maps, edges, ahead, third, e)


@compiled
def _ask(bent, anew, edges, ahead, spokes, onward, move, far, alike):  # type: ignore[no-untyped-def]
    """Fill in, of the markers that are ``anew``: ``move`` (M, 2), the error that the gridlines through each agree on
    (their median, by their third differences ``bent``), ``far`` (M,), how large it is, NaN where fewer than three are
    known, and whether they are alike."""
    said, column = np.empty((spokes.shape[1], 2)), np.empty(spokes.shape[1])
    for m in range(anew.shape[0]):
        if not anew[m]:
            continue
        known = 0
        for spoke in range(spokes.shape[1]):
            # where no gridline goes on behind the marker, it is the last of the next four
            for e, part in ((spokes[m, spoke], PART), (onward[m, spoke], 1.0)):
                if e >= 0 and np.isfinite(bent[e, 0]):
                    part = part if edges[e, 1] == m or ahead[e, 0] == m else -part
                    said[known, 0], said[known, 1] = part * bent[e, 0], part * bent[e, 1]
                    known += 1
                    break
        if known < FEWEST:
            continue
        for axis in range(2):
            for k in range(known):
                column[k] = said[k, axis]
            move[m, axis] = _median(column, known)
        square = move[m, 0] ** 2 + move[m, 1] ** 2
        far[m] = np.sqrt(square)
        like = 0
        for k in range(known):
            dx, dy = said[k, 0] - move[m, 0], said[k, 1] - move[m, 1]
            like += dx * dx + dy * dy < ALIKE**2 * square
        alike[m] = like >= FEWEST and like > MOST * known


@compiled
def _usual(far, near):  # type: ignore[no-untyped-def]
    """The median of how far the markers around would have to move."""
    kept, count = np.empty(near.shape[0]), 0
    for n in near:
        if n >= 0 and np.isfinite(far[n]):
            kept[count] = far[n]
            count += 1
    return _median(kept, count) if count > 0 else np.inf


@compiled
def _median(column, count):  # type: ignore[no-untyped-def]
    """The median of the first few numbers, which are sorted in place."""
    for i in range(1, count):
        own, k = column[i], i
        while k > 0 and column[k - 1] > own:
            column[k] = column[k - 1]
            k -= 1
        column[k] = own
    return 0.5 * (column[(count - 1) // 2] + column[count // 2])
