"""Breaks of the image along a row: torn frames, lost rows, and rows that a rolling shutter took at different times.

A surface is smooth, and its unevenness has no preferred direction of the image; a camera reads row by row. Along a
gridline through four markers, a third of the third difference is the jump between the two in the middle. Where the
image is broken, all gridlines that cross a row show the same jump. Jumps along rows are compared with the jumps along
columns of the same picture, which the surface and the errors of the markers make alone.

Where a frame is torn so far that markers at the tear, or the whole other part, are not numbered, most markers along a
row are lost across the whole pattern, and along no column.

Markers beside a break have a covariance that covers the jump, or are lost where the jump is a large part of an edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.complete.repair import RepairedMarkers
from extractor.layout.topology import Topology
from extractor.refine.refinement_step import extrapolate_pattern
from extractor.result import Status

Points = NDArray[np.float64]


class RowBreakLimits(NamedTuple):
    """Limits of breaks. Lengths are in median edges, unless stated otherwise.

    Attributes:
        bin: height of the strips of rows. Chosen.
        min_gridlines: that cross a strip. Chosen.
        most_of_layout: a third of the layout's own third difference, for a gridline to count. Chosen: a tilted view
            maps it a tenth wrong.
        min_rise: of a gridline across the rows, to count. Chosen.
        min_jump: of a strip, for a break. Chosen: 0.4 px where an edge has 20.
        ratio: of the largest jump along rows and that along columns. Chosen: pressed and twisted patterns have less
            than 2.
        agreement, agreeing_share: gridlines agree on a jump if this share of them differ from it by less than that part
            of it. Chosen.
        min_agreed_jump, min_strips: a break, too, are so many strips whose gridlines agree on such jumps. Chosen.
        spread, concentrated: a tear has this share of the squared jumps within that distance of their centre; else it
            is a rolling shutter. Chosen.
        beside: from the break, within which markers are not trusted. Chosen.
        repaired_beside: the same for markers that are repaired or fitted. Chosen.
        lost_jump: above which markers beside a break are lost. Chosen.
        rolling_share: of the jump around, that is the deviation of a marker under a rolling shutter. Chosen.
        min_lost, lost_share, lost_reach: at a tear, at least so many markers, and this share of all within the reach of
            a row, are lost. Chosen.
    """

    bin: float = 1 / 3
    min_gridlines: int = 5
    most_of_layout: float = 0.06
    min_rise: float = 0.6
    min_jump: float = 0.02
    ratio: float = 3.0
    agreement: float = 0.4
    agreeing_share: float = 0.6
    min_agreed_jump: float = 0.01
    min_strips: int = 4
    spread: float = 2.0
    concentrated: float = 0.7
    beside: float = 0.75
    repaired_beside: float = 1.5
    lost_jump: float = 0.1
    rolling_share: float = 0.05
    min_lost: int = 7
    lost_share: float = 0.75
    lost_reach: float = 0.4


LIMITS = RowBreakLimits()


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


def find_row_break(topology: Topology, markers: RepairedMarkers, size_px: tuple[int, int]) -> RowBreak:
    """The break of an image along its rows.

    Args:
        topology: of the layout.
        markers: of the image.
        size_px: width and height of the image.
    """
    xy = np.where((markers.status == Status.MEASURED)[:, None], markers.xy_px, np.nan)
    edges = xy[topology.edges]
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    lengths = lengths[np.isfinite(lengths)]
    if len(lengths) < LIMITS.min_gridlines:
        return NO_BREAK
    edge = float(np.median(lengths))
    jumps = _jumps(topology, xy)
    found = _along_rows(jumps.strips(1, edge), jumps.strips(0, edge), edge)
    if found.fault:
        return found
    return _lost_along_a_row(topology, xy, size_px, edge)


def _along_rows(rows: _Strips, columns: _Strips, edge: float) -> RowBreak:
    """A break by the jumps along rows, against those along columns."""
    least = max(LIMITS.min_jump * edge, LIMITS.ratio * columns.jump.max(initial=0.0))
    agreed = np.where(rows.is_agreed, rows.jump, 0.0)
    least_agreed = LIMITS.ratio * np.where(columns.is_agreed, columns.jump, 0.0).max(initial=0.0)
    are_agreed = agreed > max(LIMITS.min_agreed_jump * edge, least_agreed)
    largest = float(rows.jump.max(initial=0.0))
    if largest <= least and np.count_nonzero(are_agreed) < LIMITS.min_strips:
        return NO_BREAK
    squares = rows.jump**2
    centre = float(np.average(rows.middle, weights=squares))
    near = np.abs(rows.middle - centre) < LIMITS.spread * edge
    if squares[near].sum() < LIMITS.concentrated * squares.sum():
        return RowBreak("rolling shutter", largest, rows.middle, rows.jump, edge)
    row = float(np.average(rows.middle[near], weights=squares[near]))
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


class _Strips(NamedTuple):
    """(B,) strips of rows or columns: their middles and median jumps, px, and whether their gridlines agree."""

    middle: Points
    jump: Points
    is_agreed: NDArray[np.bool_]


class _Jumps(NamedTuple):
    """(G, 2) jumps of gridlines, the later row or column less the earlier one; (G, 2) their middles and rises, px."""

    jump: tuple[Points, Points]
    middle: Points
    rise: Points

    def strips(self, axis: int, edge: float) -> _Strips:
        """The strips along an axis."""
        use = (np.abs(self.rise[:, axis]) > LIMITS.min_rise * edge) & (self.middle[:, axis] >= 0)
        strip: NDArray[np.intp] = (self.middle[use, axis] / (LIMITS.bin * edge)).astype(np.intp)
        jump = np.clip(self.jump[axis][use], -edge, edge)
        count = np.bincount(strip)
        middle = np.stack([_medians(strip, count, jump[:, k]) for k in (0, 1)], axis=1)
        length = np.where(count >= LIMITS.min_gridlines, np.hypot(*middle.T), 0.0)
        is_near = np.hypot(*(jump - middle[strip]).T) < LIMITS.agreement * length[strip]
        is_agreed = np.bincount(strip, is_near) >= LIMITS.agreeing_share * np.maximum(count, 1)
        rows = np.asarray((np.arange(len(count)) + 0.5) * LIMITS.bin * edge, np.float64)
        return _Strips(rows, length, is_agreed & (length > 0))


def _medians(strip: NDArray[np.intp], count: NDArray[np.intp], values: Points) -> Points:
    """(B,) the medians of the values of each strip; 0 of a strip without any."""
    ordered = values[np.lexsort((values, strip))]
    start = np.cumsum(count) - count
    low = np.minimum(start + np.maximum(count - 1, 0) // 2, max(len(ordered) - 1, 0))
    high = np.minimum(start + count // 2, max(len(ordered) - 1, 0))
    return np.where(count > 0, (ordered[low] + ordered[high]) / 2, 0.0) if len(ordered) else np.zeros(0)


def _jumps(topology: Topology, xy: Points) -> _Jumps:
    outer, inner = xy[topology.next_markers], xy[topology.edges]
    known = (topology.next_markers >= 0).all(axis=1) & np.isfinite(outer + inner).all(axis=(1, 2))
    known &= np.hypot(*topology.third_differences.T) < 3 * LIMITS.most_of_layout
    outer, inner = outer[known], inner[known]
    rise = inner[:, 1] - inner[:, 0]
    # round and elliptical layouts have third differences themselves
    vectors = topology.edge_vectors[known]
    image_from_layout = np.linalg.lstsq(vectors, rise, rcond=None)[0] if len(rise) > 1 else np.zeros((2, 2))
    own = topology.third_differences[known] @ image_from_layout
    jump = rise - (outer[:, 1] - outer[:, 0] + own) / 3  # of the image, less that of the layout
    by_axis = (jump * np.sign(rise[:, :1]), jump * np.sign(rise[:, 1:]))
    return _Jumps(by_axis, inner.mean(axis=1), rise)


def _lost_along_a_row(topology: Topology, xy: Points, size_px: tuple[int, int], edge: float) -> RowBreak:
    """A tear beside which no marker is reported, across the whole pattern; nothing is lost so along a column."""
    known = np.isfinite(xy[:, 0])
    if np.count_nonzero(~known) < LIMITS.min_lost:
        return NO_BREAK
    place = np.where(known[:, None], xy, extrapolate_pattern(xy, topology).xy)
    inside = np.all((place >= 0) & (place < size_px), axis=1)
    place, known = place[inside], known[inside]
    rows, columns = (_lost_lines(place[:, axis], known, edge) for axis in (1, 0))
    if len(rows) == 0 or len(columns):
        return NO_BREAK
    return RowBreak("torn", edge, rows, np.full(len(rows), edge), edge)


def _lost_lines(place: Points, known: NDArray[np.bool_], edge: float) -> Points:
    """(B,) px, the lines around which most of at least ``min_lost`` markers are lost."""
    lines = np.arange(0.0, place.max(initial=0.0) + edge, LIMITS.bin * edge)
    around = np.abs(place - lines[:, None]) < LIMITS.lost_reach * edge
    lost = np.count_nonzero(around & ~known, axis=1)
    share = lost / np.maximum(np.count_nonzero(around, axis=1), 1)
    return np.asarray(lines[(lost >= LIMITS.min_lost) & (share > LIMITS.lost_share)], np.float64)
