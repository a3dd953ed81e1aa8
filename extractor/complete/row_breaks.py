"""Breaks of the image along a row: torn frames, lost rows, and rows that a rolling shutter took at different times.

A surface is smooth, and its unevenness has no preferred direction of the image; a camera reads row by row. Along a
gridline through four markers, a third of the third difference is the jump between the two in the middle. Where the
image is broken, all gridlines that cross a row show the same jump. Jumps along rows, less their disagreement, are
compared with the jumps along columns of the same picture, which the surface and the errors of the markers make alone:
the largest one, and the mean of all. Markers count that contradict their neighbours, as a break makes them do so.

Where a frame is torn so far that markers at the tear, or the whole other part, are not numbered, most markers along a
row are lost across the whole pattern, and along no column.

Markers beside a break have a covariance that covers the jump, or are lost where the jump is a large part of an edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native
from extractor.complete.repair import RepairedMarkers
from extractor.layout.topology import Topology
from extractor.refine.extrapolated_pattern import extrapolate_pattern
from extractor.result import Status

Points = NDArray[np.float64]


class RowBreakLimits(NamedTuple):
    """Limits of breaks. Lengths are in median edges, unless stated otherwise.

    Attributes:
        spread, concentrated: a tear has this share of the squared jumps within that distance of their centre; else it
            is a rolling shutter. Chosen.
        beside: from the break, within which markers are not trusted. Chosen.
        repaired_beside: the same for markers that are repaired or fitted. Chosen.
        lost_jump: above which markers beside a break are lost. Chosen.
        rolling_share: of the jump around, that is the deviation of a marker under a rolling shutter. Chosen.
        min_lost, lost_share, lost_reach: at a tear, at least so many markers, and this share of all within the reach of
            a row, are lost. Chosen.
        cover_edges, most_apart: where both sides of lost rows, extrapolated by so many edges, differ by less than
            that, the markers are covered and nothing is torn. Chosen.
    """

    spread: float = 2.0
    concentrated: float = 0.7
    beside: float = 0.75
    repaired_beside: float = 1.5
    lost_jump: float = 0.1
    rolling_share: float = 0.05
    min_lost: int = 7
    lost_share: float = 0.75
    lost_reach: float = 0.4
    cover_edges: int = 2
    most_apart: float = 0.2


LIMITS = RowBreakLimits()


class StripJumps(NamedTuple):
    """The jumps of gridlines, px, by strips of the image.

    Attributes:
        edge_px: the median edge, 0 with few edges.
        rows_px: (B,) the length of the median jump of each strip of rows, beyond the disagreement of its gridlines; NaN
            with few gridlines.
        largest_px: the largest one; NaN without any.
        is_broken: rows jump more than columns do.
    """

    edge_px: float
    rows_px: Points
    largest_px: float
    is_broken: bool


class RowBreak(NamedTuple):
    """A break of the image.

    Attributes:
        fault: "torn" or "rolling shutter"; "" without a break.
        jump_px: the largest jump.
        rows_px, jumps_px: (B,) the middles of the strips, and the length of the jump at each.
        edge_px: the median edge.
    """

    fault: str
    jump_px: float
    rows_px: Points
    jumps_px: Points
    edge_px: float


NO_BREAK = RowBreak("", 0.0, np.empty(0), np.empty(0), 0.0)


def find_row_break(
    topology: Topology, jumps: StripJumps, markers: RepairedMarkers, size_px: tuple[int, int]
) -> RowBreak:
    """The break of an image along its rows.

    Args:
        topology: of the layout.
        jumps, markers: of the image.
        size_px: width and height of the image.
    """
    edge, largest = jumps.edge_px, jumps.largest_px
    if not jumps.is_broken:
        return NO_BREAK if edge == 0 else _lost_along_a_row(topology, markers, size_px, edge)
    rows = np.nan_to_num(jumps.rows_px)
    middle, squares = (np.arange(len(rows), dtype=np.float64) + 0.5) * native.STRIP_EDGES * edge, rows**2
    near = np.abs(middle - np.average(middle, weights=squares)) < LIMITS.spread * edge
    if squares[near].sum() < LIMITS.concentrated * squares.sum():
        return RowBreak("rolling shutter", largest, middle, rows, edge)
    row = float(np.average(middle[near], weights=squares[near]))
    # the markers beside a large tear are off themselves, and show less of it
    shown = largest if largest < LIMITS.lost_jump * edge / 2 else max(largest, LIMITS.lost_jump * edge)
    return RowBreak("torn", shown, np.array([row]), np.array([shown]), edge)


def beside_row_break(found: RowBreak, markers: RepairedMarkers) -> RepairedMarkers:
    """The markers, with those beside a break lost or less certain.

    Args:
        found: by ``find_row_break``.
        markers: of the image.
    """
    if not found.fault:
        return markers
    xy, cov, status = markers.xy_px.copy(), markers.cov_px2.copy(), markers.status.copy()
    if found.fault == "rolling shutter":
        away = np.abs(xy[:, 1, None] - found.rows_px)
        around = np.where(away < found.edge_px, found.jumps_px, 0.0).max(axis=1, initial=0.0)
        around = np.maximum(around, np.sqrt(np.mean(found.jumps_px**2)))  # at the rim no strip tells
        cov += (LIMITS.rolling_share * around)[:, None, None] ** 2 * np.eye(2)
        guessed = (status > Status.MEASURED) & (found.jump_px > LIMITS.lost_jump * found.edge_px)
        xy[guessed], cov[guessed], status[guessed] = np.nan, np.nan, Status.LOST
        return RepairedMarkers(xy, cov, status)
    distance = np.abs(xy[:, 1, None] - found.rows_px).min(axis=1)
    reach = np.where(status == Status.MEASURED, LIMITS.beside, LIMITS.repaired_beside) * found.edge_px
    beside = (status != Status.LOST) & (distance < reach)
    if found.jump_px < LIMITS.lost_jump * found.edge_px:
        cov[beside] += found.jump_px**2 * np.eye(2)
        return RepairedMarkers(xy, cov, status)
    xy[beside], cov[beside], status[beside] = np.nan, np.nan, Status.LOST
    return RepairedMarkers(xy, cov, status)


def _lost_along_a_row(
    topology: Topology, markers: RepairedMarkers, size_px: tuple[int, int], edge: float
) -> RowBreak:
    """A tear beside which no marker is reported, across the whole pattern; nothing is lost so along a column."""
    known = markers.status == Status.MEASURED.value
    if len(known) - np.count_nonzero(known) < LIMITS.min_lost:
        return NO_BREAK
    xy = np.where(known[:, None], markers.xy_px, np.nan)
    place = np.where(known[:, None], xy, extrapolate_pattern(xy, topology).xy)
    inside = np.all((place >= 0) & (place < size_px), axis=1)
    inside &= np.all(topology.spokes >= 0, axis=1)  # the rim is lost along a row under blur, too
    place, known = place[inside], known[inside]
    rows, columns = (_lost_lines(place[:, axis], known, edge) for axis in (1, 0))
    if len(rows) == 0 or len(columns) or _goes_on_across(topology, xy, rows, edge):
        return NO_BREAK
    return RowBreak("torn", edge, rows, np.full(len(rows), edge), edge)


def _goes_on_across(topology: Topology, xy: Points, rows_px: Points, edge: float) -> bool:
    """Whether the markers above and below the rows predict the same places between: they are covered, not torn."""
    row = float(np.mean(rows_px))
    above, below = (np.where(side[:, None], xy, np.nan) for side in (xy[:, 1] < row, xy[:, 1] > row))
    for _ in range(LIMITS.cover_edges):
        above, below = (extrapolate_pattern(part, topology).xy for part in (above, below))
    apart = np.hypot(*(above - below)[~np.isfinite(xy[:, 0])].T)
    apart = apart[np.isfinite(apart)]
    return len(apart) >= native.MIN_STRIP_GRIDLINES and bool(np.median(apart) < LIMITS.most_apart * edge)


def _lost_lines(place: Points, known: NDArray[np.bool_], edge: float) -> Points:
    """(B,) px, the lines around which most of at least ``min_lost`` markers are lost."""
    lines = np.arange(0.0, place.max(initial=0.0) + edge, native.STRIP_EDGES * edge)
    around = np.abs(place - lines[:, None]) < LIMITS.lost_reach * edge
    lost = np.count_nonzero(around & ~known, axis=1)
    share = lost / np.maximum(np.count_nonzero(around, axis=1), 1)
    return np.asarray(lines[(lost >= LIMITS.min_lost) & (share > LIMITS.lost_share)], np.float64)
