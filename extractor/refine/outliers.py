"""Markers that stray: dirt that looks like a gridline has led them away from where the pattern can be.

Two things that do not depend on each other tell: their gridlines do not look as the pattern does, and most gridlines
through them say that the map would be smooth were they moved by the same vector. They start anew from there. What is
bent sharply, at the rim of an object or where it slips, moves from one gridline to the next by other vectors.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import MAX_PLACE_ERROR, InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.numeric.median import median_of
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import third_difference
from extractor.refine.synthesis.gridlines import FIRST_RING, extrapolate_rings

MIN_MEAN_WEIGHT = 0.55  # mean trust in the gridlines read at a marker, below which it is doubted
# To stray, a marker must have to move by so many times what those around it must, if doubted, and if not;
OUTLIER_RATIOS = 3.0, 6.0
MIN_OUTLIER_SHIFTS = 0.02, 0.03  # and by so much of an edge.
# Its gridlines agree on a move if more than this share of them, and no fewer than so many,
MIN_AGREEING_SHARE, MIN_AGREEING_GRIDLINES = 0.7, 3
AGREEMENT_TOLERANCE = 0.5  # ask for one that differs by less than this share of it.
EXTRAPOLATED_RINGS = 2  # of strays that the markers around are continued to
MAX_ROUNDS = 6  # one marker that strays hides what is wrong with its neighbours
# The share of a third difference that is the error of one of its two inner markers; all of it is, of an outer one.
INNER_MARKER_SHARE = 1.0 / 3.0


def correct_outliers(
    view: PyramidLevel, mesh: Topology, fit: Estimate, trusted: NDArray[np.float64], places: InitialMarkers
) -> tuple[Estimate, InitialMarkers]:
    """The fit and the places (of the full image), those that dirt has led astray put where their neighbours say;
    ``trusted`` (E,) is how far gridlines look as they should."""
    assert fit.reading is not None
    of_fit = fit.measured, fit.reliable, fit.beyond, fit.maps
    of_places = places.xy_px, places.edge_px, places.agreed, places.whole
    doubted, some = suspect_markers(trusted, fit.reading.weight, mesh.spokes)
    if not some:
        return fit, places
    led, measured, guiding, xy, agreed, whole = _correct_outliers(
        of_fit,
        of_places,
        doubted,
        view.scale,
        _topology_tables(mesh),
        mesh.ring_vectors,
        mesh.derivative_stencil,
    )
    if not led:
        return fit, places
    fit = fit._replace(measured=measured, reliable=guiding)
    return fit, replace(places, xy_px=xy, agreed=agreed, whole=whole)


@compiled
def _correct_outliers(of_fit, of_places, doubted, scale, lattice, offset, stencil):  # type: ignore[no-untyped-def]
    """Whether any markers were led astray; ``measured`` and ``reliable`` of the fit and ``xy_px``, ``agreed`` and
    ``whole`` of the places, those put where their neighbours say."""
    measured, guiding, beyond, maps = of_fit
    start, edge, agreed, whole = of_places
    known = guiding.copy()
    known[beyond] = np.nan
    led = outlier_markers(known, maps, doubted, edge / scale, *lattice)
    led |= doubted & ~agreed
    if not np.any(led):
        return False, measured, guiding, start, agreed, whole
    measured, guiding, start = measured.copy(), guiding.copy(), start.copy()
    agreed, whole = agreed.copy(), whole.copy()
    known[led] = np.nan
    xy = extrapolate_rings(known, lattice[-1], offset, stencil, EXTRAPOLATED_RINGS)
    for m in np.flatnonzero(led):
        if not np.isfinite(xy[m, 0]):
            continue
        measured[m], guiding[m] = xy[m], xy[m]
        x, y = (xy[m, 0] + 0.5) * scale - 0.5, (xy[m, 1] + 0.5) * scale - 0.5
        apart = np.sqrt((x - start[m, 0]) ** 2 + (y - start[m, 1]) ** 2)
        agreed[m] &= not apart > MAX_PLACE_ERROR * edge[m]
        whole[m] = False
        start[m, 0], start[m, 1] = x, y
    return True, measured, guiding, start, agreed, whole


def find_outliers(
    mesh: Topology,
    fit: Estimate,
    xy: NDArray[np.float64],
    trusted: NDArray[np.float64],
    edge_px: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(M,) which of the markers ``xy`` (M, 2) strayed, and (M,) which have gridlines that look unlike the pattern;
    without any of these, none strayed."""
    assert fit.reading is not None
    doubted, some = suspect_markers(trusted, fit.reading.weight, mesh.spokes)
    if not some:
        return doubted, doubted
    return outlier_markers(xy, fit.maps, doubted, edge_px, *_topology_tables(mesh)), doubted


def _topology_tables(mesh: Topology) -> tuple[NDArray[Any], ...]:
    """What ``outlier_markers`` needs of the mesh."""
    return (
        mesh.edges,
        mesh.next_markers,
        mesh.third_differences,
        mesh.spokes,
        mesh.next_edges,
        mesh.ring_markers,
    )


@compiled
def suspect_markers(trusted, use, spokes):  # type: ignore[no-untyped-def]
    """(M,) bool: markers whose gridlines, of those in ``weight`` (E,), are little ``trusted`` (E,); and whether
    there are
    any."""
    out = np.zeros(spokes.shape[0], np.bool_)
    for m in range(spokes.shape[0]):
        total, count = 0.0, 0
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and use[e] > 0.0:
                total += trusted[e]
                count += 1
        out[m] = total < MIN_MEAN_WEIGHT * count
    return out, np.any(out)


@compiled
def outlier_markers(xy, maps, doubted, edge, edges, ahead, third, spokes, onward, near):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers that strayed.

    ``doubted``: (M,) bool. ``edge``: (M,) px, the length of the edges at each. ``xy``: NaN where nothing is known.
    """
    count = xy.shape[0]
    out, strays, anew = xy.copy(), np.zeros(count, np.bool_), np.ones(count, np.bool_)
    move, far, alike = np.zeros((count, 2)), np.full(count, np.nan), np.zeros(count, np.bool_)
    least = np.where(doubted, MIN_OUTLIER_SHIFTS[0], MIN_OUTLIER_SHIFTS[1]) * edge
    # few markers could have to move at all; only these, and those around them, are asked
    moving, asked, bent = np.zeros(count, np.bool_), np.zeros(count, np.bool_), np.empty((edges.shape[0], 2))
    for _ in range(MAX_ROUNDS):
        _update_third_differences(out, anew, maps, edges, ahead, third, bent)
        _update_candidates(anew, least, bent, spokes, onward, moving, asked)
        _update_agreed_shifts(moving, bent, edges, ahead, spokes, onward, asked, move, far, alike)
        moving &= alike & (far > least)
        _update_agreed_shifts(
            _within_two_rings(moving, near), bent, edges, ahead, spokes, onward, asked, move, far, alike
        )
        anew[:] = False
        for m in np.flatnonzero(moving):
            first = True  # of its neighbours in how far it would have to move
            for k in range(FIRST_RING):
                n = near[m, k]
                first = first and not (n >= 0 and far[n] > far[m])
            if first and far[m] > OUTLIER_RATIOS[0 if doubted[m] else 1] * _median_shift(far, near[m]):
                out[m, 0] -= move[m, 0]
                out[m, 1] -= move[m, 1]
                strays[m] = anew[m] = True
        if not np.any(anew):
            break
        anew |= _within_two_rings(anew, near)
    return strays


@compiled
def _within_two_rings(which, near):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers in the two rings of ``gridlines`` (M,)."""
    out = np.zeros(which.shape[0], np.bool_)
    for m in np.flatnonzero(which):
        for n in near[m]:
            out[n if n >= 0 else m] = True
    return out


@compiled
def _update_third_differences(xy, anew, maps, edges, ahead, third, out):  # type: ignore[no-untyped-def]
    """Fill in (E, 2) px along the gridlines with an end that is ``anew`` (M,), NaN where one of the four markers along
    a gridline is not known."""
    for e in range(edges.shape[0]):
        if anew[edges[e, 0]] or anew[edges[e, 1]]:
            out[e, 0], out[e, 1] = np.nan, np.nan
            if ahead[e, 0] >= 0 and ahead[e, 1] >= 0:
                out[e, 0], out[e, 1] = third_difference(xy, maps, edges, ahead, third, e)


@compiled
def _update_candidates(anew, least, bent, spokes, onward, moving, asked):  # type: ignore[no-untyped-def]
    """Of the markers that are ``anew``: none is ``asked`` yet, and those are ``moving`` whose gridlines could agree on
    a move by more than ``min_places`` px: by no more than what the largest third differences ask for in x and in y."""
    for m in range(anew.shape[0]):
        if not anew[m]:
            continue
        x, y, known = 0.0, 0.0, 0
        for k in range(spokes.shape[1]):
            e, part = spokes[m, k], INNER_MARKER_SHARE
            if e < 0 or not np.isfinite(bent[e, 0]):
                e, part = onward[m, k], 1.0
            if e >= 0 and np.isfinite(bent[e, 0]):
                x, y = max(x, part * abs(bent[e, 0])), max(y, part * abs(bent[e, 1]))
                known += 1
        asked[m] = False
        moving[m] = (
            known >= MIN_AGREEING_GRIDLINES and x * x + y * y > 0.99 * least[m] ** 2
        )  # rounding left aside


@compiled
def _update_agreed_shifts(which, bent, edges, ahead, spokes, onward, asked, move, far, alike):  # type: ignore[no-untyped-def]
    """Fill in, of the markers ``gridlines`` (M,) that are not ``asked`` yet: ``move`` (M, 2), the error that the
    gridlines
    through each agree on (their median, by their third differences ``bent``), ``far`` (M,), how large it is, NaN where
    fewer than three are known, and whether they are ``alike`` (M,)."""
    said, column = np.empty((spokes.shape[1], 2)), np.empty(spokes.shape[1])
    for m in range(which.shape[0]):
        if asked[m] or not which[m]:
            continue
        asked[m], known = True, 0
        for k in range(spokes.shape[1]):
            e, part = spokes[m, k], INNER_MARKER_SHARE
            if e < 0 or not np.isfinite(bent[e, 0]):
                # where no gridline goes on behind the marker, it is the last of the next four
                e, part = onward[m, k], 1.0
            if e >= 0 and np.isfinite(bent[e, 0]):
                part = part if edges[e, 1] == m or ahead[e, 0] == m else -part
                said[known, 0], said[known, 1] = part * bent[e, 0], part * bent[e, 1]
                known += 1
        if known < MIN_AGREEING_GRIDLINES:
            continue
        for axis in range(2):
            for k in range(known):
                column[k] = said[k, axis]
            move[m, axis] = median_of(column, known)
        square = move[m, 0] ** 2 + move[m, 1] ** 2
        far[m] = np.sqrt(square)
        like = 0
        for k in range(known):
            dx, dy = said[k, 0] - move[m, 0], said[k, 1] - move[m, 1]
            like += dx * dx + dy * dy < AGREEMENT_TOLERANCE**2 * square
        alike[m] = like >= MIN_AGREEING_GRIDLINES and like > MIN_AGREEING_SHARE * known


@compiled
def _median_shift(far, near):  # type: ignore[no-untyped-def]
    """The median of how far the markers around would have to move."""
    kept, count = np.empty(near.shape[0]), 0
    for n in near:
        if n >= 0 and np.isfinite(far[n]):
            kept[count] = far[n]
            count += 1
    return median_of(kept, count) if count > 0 else np.inf
