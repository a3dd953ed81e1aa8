"""Markers that contradict their neighbours: dirt that looks like a gridline has moved them.

Two independent signs must agree: the gridlines of the marker do not look like the pattern, and most gridlines through
it show that the map would be smooth if the marker were moved by one vector. The marker then starts again from there.
Sharp bends, at the rim of an object or where it slips, ask for vectors that differ from one gridline to the next.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import MAX_PLACE_ERROR, InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.numeric.median import median_of
from extractor.refine.estimate import Estimate, StartPlaces, start_places
from extractor.refine.measure.gridline_bending import third_difference
from extractor.refine.synthesis.gridlines import FIRST_RING, extrapolate_rings

MIN_MEAN_WEIGHT = 0.55  # of the gridlines measured at a marker, below which the marker is suspect
# Shift of an outlier over that of the markers around, of a suspect marker and of any other;
OUTLIER_RATIOS = 3.0, 6.0
MIN_OUTLIER_SHIFTS = 0.02, 0.03  # and that shift in edges.
# The gridlines of a marker agree on a shift if more than this share of them, and no fewer than so many,
MIN_AGREEING_SHARE, MIN_AGREEING_GRIDLINES = 0.7, 3
AGREEMENT_TOLERANCE = 0.5  # ask for one that differs by less than this share of the shift.
EXTRAPOLATED_RINGS = 2  # of outliers that the markers around are continued to
MAX_ROUNDS = 6  # an outlier hides the errors of its neighbours
# Share of a third difference that is the error of one of its two inner markers; all of it is, of an outer one.
INNER_MARKER_SHARE = 1.0 / 3.0


class OutlierCorrection(NamedTuple):
    """Markers with the outliers put where their neighbours predict them.

    Attributes:
        found: there are outliers.
        measured, reliable: (M, 2) px, as in ``Estimate``.
        places: ``StartPlaces`` of the full image.
    """

    found: bool
    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    places: StartPlaces


class AgreedShifts(NamedTuple):
    """The shifts that the gridlines through each marker agree on.

    Attributes:
        known: (M,) bool, the marker was asked for.
        shift: (M, 2) px, the median of the shifts by the single gridlines.
        length: (M,) px, NaN where fewer than three gridlines are known.
        agreeing: (M,) bool, enough gridlines agree.
    """

    known: NDArray[np.bool_]
    shift: NDArray[np.float64]
    length: NDArray[np.float64]
    agreeing: NDArray[np.bool_]


def correct_outliers(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    profile_weight: NDArray[np.float64],
    places: InitialMarkers,
) -> tuple[Estimate, InitialMarkers]:
    """The estimate and the places, outliers put where their neighbours predict them.

    Args:
        view: the image.
        topology: of the layout.
        estimate: after the first round of profiles.
        profile_weight: (E,) 0 to 1, how well gridlines look like the pattern.
        places: of the full image.
    """
    assert estimate.reading is not None
    suspect, some = suspect_markers(profile_weight, estimate.reading.weight, topology.spokes)
    if not some:
        return estimate, places
    markers = estimate.measured, estimate.reliable, estimate.hidden, estimate.maps
    corrected = _correct_outliers(topology, *markers, start_places(places), suspect, view.scale)
    if not corrected.found:
        return estimate, places
    xy, _, agreed, is_intact = corrected.places
    estimate = estimate._replace(measured=corrected.measured, reliable=corrected.reliable)
    return estimate, replace(places, xy_px=xy, agreed=agreed, is_intact=is_intact)


@compiled
def _correct_outliers(topology, measured, reliable, hidden, maps, places, suspect, scale):  # type: ignore[no-untyped-def]
    """``OutlierCorrection``; the markers are px of the image reduced by ``scale``, ``suspect`` is (M,) bool."""
    known = reliable.copy()
    known[hidden] = np.nan
    outliers = outlier_markers(known, maps, suspect, places.edge_px / scale, topology)
    outliers |= suspect & ~places.agreed
    if not np.any(outliers):
        return OutlierCorrection(False, measured, reliable, places)
    measured, reliable, start = measured.copy(), reliable.copy(), places.xy_px.copy()
    agreed, is_intact = places.agreed.copy(), places.is_intact.copy()
    known[outliers] = np.nan
    stencil = topology.derivative_stencil
    xy = extrapolate_rings(known, topology.ring_markers, topology.ring_vectors, stencil, EXTRAPOLATED_RINGS)
    for m in np.flatnonzero(outliers):
        if not np.isfinite(xy[m, 0]):
            continue
        measured[m], reliable[m] = xy[m], xy[m]
        x, y = (xy[m, 0] + 0.5) * scale - 0.5, (xy[m, 1] + 0.5) * scale - 0.5
        distance = np.sqrt((x - start[m, 0]) ** 2 + (y - start[m, 1]) ** 2)
        agreed[m] &= not distance > MAX_PLACE_ERROR * places.edge_px[m]
        is_intact[m] = False
        start[m, 0], start[m, 1] = x, y
    return OutlierCorrection(True, measured, reliable, StartPlaces(start, places.edge_px, agreed, is_intact))


def find_outliers(
    topology: Topology,
    estimate: Estimate,
    xy: NDArray[np.float64],
    profile_weight: NDArray[np.float64],
    edge_px: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Outliers and suspect markers.

    Args:
        topology: of the layout.
        estimate: after a round of profiles.
        xy: (M, 2) px, NaN where unknown.
        profile_weight: (E,) 0 to 1, how well gridlines look like the pattern.
        edge_px: (M,) the length of the edges at each marker.

    Returns:
        (M,) bool, the outliers, and (M,) bool, the markers whose gridlines look unlike the pattern. Without any of the
        latter there are no outliers.
    """
    assert estimate.reading is not None
    suspect, some = suspect_markers(profile_weight, estimate.reading.weight, topology.spokes)
    if not some:
        return suspect, suspect
    return outlier_markers(xy, estimate.maps, suspect, edge_px, topology), suspect


@compiled
def suspect_markers(profile_weight, weight, spokes):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers whose gridlines with a positive ``weight`` (E,) have little ``profile_weight`` (E,); and
    whether there are any."""
    out = np.zeros(spokes.shape[0], np.bool_)
    for m in range(spokes.shape[0]):
        total, count = 0.0, 0
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and weight[e] > 0.0:
                total += profile_weight[e]
                count += 1
        out[m] = total < MIN_MEAN_WEIGHT * count
    return out, np.any(out)


@compiled
def outlier_markers(xy, maps, suspect, edge, topology):  # type: ignore[no-untyped-def]
    """The outliers.

    Args:
        xy: (M, 2) px, NaN where unknown.
        maps: (M, 2, 5), as ``local_maps`` gives them.
        suspect: (M,) bool.
        edge: (M,) px, the length of the edges at each marker.
        topology: ``Topology``.

    Returns:
        (M,) bool.
    """
    count, near = xy.shape[0], topology.ring_markers
    out, outliers, changed = xy.copy(), np.zeros(count, np.bool_), np.ones(count, np.bool_)
    shifts = AgreedShifts(
        np.zeros(count, np.bool_), np.zeros((count, 2)), np.full(count, np.nan), np.zeros(count, np.bool_)
    )
    least = np.where(suspect, MIN_OUTLIER_SHIFTS[0], MIN_OUTLIER_SHIFTS[1]) * edge
    # few markers could have to move at all; shifts are made only for these and those around them
    moving, differences = np.zeros(count, np.bool_), np.empty((len(topology.edges), 2))
    for _ in range(MAX_ROUNDS):
        _fill_third_differences(out, changed, maps, topology, differences)
        _update_candidates(changed, least, differences, topology, moving, shifts.known)
        _update_agreed_shifts(moving, differences, topology, shifts)
        moving &= shifts.agreeing & (shifts.length > least)
        _update_agreed_shifts(_within_two_rings(moving, near), differences, topology, shifts)
        changed[:] = False
        for m in np.flatnonzero(moving):
            length, largest = shifts.length[m], True
            for k in range(FIRST_RING):
                n = near[m, k]
                largest = largest and not (n >= 0 and shifts.length[n] > length)
            ratio = OUTLIER_RATIOS[0 if suspect[m] else 1]
            if largest and length > ratio * _median_shift(shifts.length, near[m]):
                out[m, 0] -= shifts.shift[m, 0]
                out[m, 1] -= shifts.shift[m, 1]
                outliers[m] = changed[m] = True
        if not np.any(changed):
            break
        changed |= _within_two_rings(changed, near)
    return outliers


@compiled
def _within_two_rings(selected, near):  # type: ignore[no-untyped-def]
    """(M,) bool, the selected markers (M,) and those in their two rings ``near`` (M, 18)."""
    out = np.zeros(selected.shape[0], np.bool_)
    for m in np.flatnonzero(selected):
        for n in near[m]:
            out[n if n >= 0 else m] = True
    return out


@compiled
def _fill_third_differences(xy, changed, maps, topology, out):  # type: ignore[no-untyped-def]
    """Fill in (E, 2) px along the gridlines with a ``changed`` end (M,), NaN where one of the four markers along a
    gridline is not known."""
    edges, ahead, third = topology.edges, topology.next_markers, topology.third_differences
    for e in range(edges.shape[0]):
        if changed[edges[e, 0]] or changed[edges[e, 1]]:
            out[e, 0], out[e, 1] = np.nan, np.nan
            if ahead[e, 0] >= 0 and ahead[e, 1] >= 0:
                out[e, 0], out[e, 1] = third_difference(xy, maps, edges, ahead, third, e)


@compiled
def _update_candidates(changed, least, differences, topology, moving, known):  # type: ignore[no-untyped-def]
    """Of the ``changed`` markers: set ``known`` to False, and ``moving`` to whether gridlines could agree on a shift of
    more than ``least`` px, by the largest third differences (E, 2) in x and in y."""
    spokes, onward = topology.spokes, topology.next_edges
    for m in range(changed.shape[0]):
        if not changed[m]:
            continue
        x, y, count = 0.0, 0.0, 0
        for k in range(spokes.shape[1]):
            e, part = spokes[m, k], INNER_MARKER_SHARE
            if e < 0 or not np.isfinite(differences[e, 0]):
                e, part = onward[m, k], 1.0
            if e >= 0 and np.isfinite(differences[e, 0]):
                x, y = max(x, part * abs(differences[e, 0])), max(y, part * abs(differences[e, 1]))
                count += 1
        known[m] = False
        # 0.99 allows for rounding
        moving[m] = count >= MIN_AGREEING_GRIDLINES and x * x + y * y > 0.99 * least[m] ** 2


@compiled
def _update_agreed_shifts(selected, differences, topology, shifts):  # type: ignore[no-untyped-def]
    """Make the ``AgreedShifts`` of the selected markers (M,) that are not known yet, from the third differences."""
    edges, ahead = topology.edges, topology.next_markers
    spokes, onward = topology.spokes, topology.next_edges
    single, column = np.empty((spokes.shape[1], 2)), np.empty(spokes.shape[1])
    for m in range(selected.shape[0]):
        if shifts.known[m] or not selected[m]:
            continue
        shifts.known[m], count = True, 0
        for k in range(spokes.shape[1]):
            e, part = spokes[m, k], INNER_MARKER_SHARE
            if e < 0 or not np.isfinite(differences[e, 0]):
                # where no gridline goes on behind the marker, the marker is the last of the next four
                e, part = onward[m, k], 1.0
            if e >= 0 and np.isfinite(differences[e, 0]):
                part = part if edges[e, 1] == m or ahead[e, 0] == m else -part
                single[count, 0], single[count, 1] = part * differences[e, 0], part * differences[e, 1]
                count += 1
        if count < MIN_AGREEING_GRIDLINES:
            continue
        for axis in range(2):
            for k in range(count):
                column[k] = single[k, axis]
            shifts.shift[m, axis] = median_of(column, count)
        x, y = shifts.shift[m, 0], shifts.shift[m, 1]
        square = x**2 + y**2
        shifts.length[m] = np.sqrt(square)
        agreeing = 0
        for k in range(count):
            dx, dy = single[k, 0] - x, single[k, 1] - y
            agreeing += dx * dx + dy * dy < AGREEMENT_TOLERANCE**2 * square
        shifts.agreeing[m] = agreeing >= MIN_AGREEING_GRIDLINES and agreeing > MIN_AGREEING_SHARE * count


@compiled
def _median_shift(length, near):  # type: ignore[no-untyped-def]
    """px, the median length of the known shifts of the markers ``near`` (18,); infinite without any."""
    column, count = np.empty(near.shape[0]), 0
    for n in near:
        if n >= 0 and np.isfinite(length[n]):
            column[count] = length[n]
            count += 1
    return median_of(column, count) if count > 0 else np.inf
