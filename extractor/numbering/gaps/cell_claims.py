"""Assigns cells without a number to free cells of the layout, those nearest to the numbered ones first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.localmap.quadratic_map import (
    MAX_SUPPORT_DISTANCE,
    SUPPORT_CELLS,
    allocate_map_buffers,
    fill_quadratic_map,
)
from extractor.numbering.gaps.corner_contact import equilateral_edge
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import BucketGrid, fill_nearest_points

JOINT_GAP = 1.7  # cells not farther than this from a numbered one, in cells, are numbered in one round,
JOINT_GAP_RATIO = 1.25  # and cells not farther than this many times the least gap
MAX_PLACE_MISFIT = 0.3  # in cells, between a cell's predicted place and the layout's cell
RIVAL_DISTANCE = 1.5  # in cells, between possible fragments of one cell; the next cell of the ink is at 1.7


class SupportCells(NamedTuple):
    """The numbered intact cells from which places in the layout are predicted.

    Attributes:
        cells: (K,) int64, the cells of the image.
        grid: the ``BucketGrid`` of their centers, px.
    """

    cells: NDArray[np.int64]
    grid: BucketGrid


class CellAssignments(NamedTuple):
    """Assignments of L cells without a number to U cells of the layout; updated in place.

    Attributes:
        candidate: (L,) int64, the cells of the image that have no number.
        place: (L,) int32, the cell of the layout that each would be, or -1.
        is_evaluated: (L,) bool, ``place`` is known, or need not be.
        gap: (L,) float64, the distance from the next numbered cell, in cells; infinite for a cell numbered meanwhile.
        support_radius2: (L,) float64, px^2, the squared distance of the farthest support cell of those evaluated: a
            nearer new number changes the assignment.
        candidate_count: (U,) int32, how many cells are assigned to each cell of the layout.
        nearest: (``SUPPORT_CELLS``,) int32 and squared_distance: (``SUPPORT_CELLS``,) float64, px^2, buffers for the
            support of one cell.
    """

    candidate: NDArray[np.int64]
    place: NDArray[np.int32]
    is_evaluated: NDArray[np.bool_]
    gap: NDArray[np.float64]
    support_radius2: NDArray[np.float64]
    candidate_count: NDArray[np.int32]
    nearest: NDArray[np.int32]
    squared_distance: NDArray[np.float64]


@compiled
def empty_assignments(candidate, places):  # type: ignore[no-untyped-def]
    """``CellAssignments`` of the cells ``candidate`` (L,) to ``places`` cells of the layout, before any evaluation."""
    count = candidate.shape[0]
    return CellAssignments(
        candidate,
        np.full(count, -1, np.int32),
        np.zeros(count, np.bool_),
        np.empty(count),
        np.empty(count),
        np.zeros(places, np.int32),
        np.empty(SUPPORT_CELLS, np.int32),
        np.empty(SUPPORT_CELLS),
    )


@compiled
def update_outdated_assignments(cells, new_cells, numbering, assignments):  # type: ignore[no-untyped-def]
    """Withdraw assignments to occupied cells of the layout, and those that newly numbered cells may change.

    Args:
        cells: ``CellArrays``.
        new_cells: the cells of the image numbered since the last update.
        numbering: ``PartialNumbering``.
        assignments: ``CellAssignments``, updated.
    """
    assignments.candidate_count[:] = 0
    for n in range(assignments.candidate.shape[0]):
        i, place = assignments.candidate[n], assignments.place[n]
        is_numbered = numbering.cell[i] >= 0
        if is_numbered or (place >= 0 and not numbering.free[place]):
            assignments.place[n] = -1
        was_evaluated, radius2 = assignments.is_evaluated[n], assignments.support_radius2[n]
        if not is_numbered and was_evaluated and _is_any_within(cells.center_px, i, new_cells, radius2):
            assignments.place[n], assignments.is_evaluated[n] = -1, False
        if assignments.place[n] >= 0:
            assignments.candidate_count[assignments.place[n]] += 1


@inlined_no_refcount
def _is_any_within(center, i, others, radius2):  # type: ignore[no-untyped-def]
    """Whether one of the other cells lies nearer to cell i than the root of ``radius2``, px^2."""
    for j in others:
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        if x * x + y * y < radius2:
            return True
    return False


@compiled
def _update_gaps(cells, support, cell, assignments):  # type: ignore[no-untyped-def]
    """Write the gaps; cells too far from the numbered ones for any map need no evaluation."""
    nearest, squares = assignments.nearest[:1], assignments.squared_distance[:1]
    for n in range(assignments.candidate.shape[0]):
        i = assignments.candidate[n]
        if cell[i] >= 0:
            assignments.gap[n], assignments.is_evaluated[n] = np.inf, True
            continue
        fill_nearest_points(support.grid, cells.center_px[i, 0], cells.center_px[i, 1], nearest, squares)
        assignments.gap[n] = np.sqrt(squares[0]) / equilateral_edge(cells.area_px[support.cells[nearest[0]]])
        if not assignments.is_evaluated[n] and not assignments.gap[n] < 2.0 * MAX_SUPPORT_DISTANCE:
            # to be evaluated again after any new number
            assignments.support_radius2[n], assignments.is_evaluated[n] = np.inf, True


@compiled
def update_assignments(cells, layout, support, numbering, assignments):  # type: ignore[no-untyped-def]
    """Assign the cells nearest to numbered ones, and their possible rivals, until it is clear which are numbered next.

    Args:
        cells: ``CellArrays``. layout: ``LayoutCells``.
        support: ``SupportCells``.
        numbering: ``PartialNumbering``.
        assignments: ``CellAssignments``, updated.

    Returns:
        The gap, in cells, up to which unique assignments become numbers in this round.
    """
    _update_gaps(cells, support, numbering.cell, assignments)
    free, buffers = np.flatnonzero(numbering.free), allocate_map_buffers()
    candidate, horizon = assignments.candidate, JOINT_GAP
    while True:
        for n in range(candidate.shape[0]):
            if not assignments.is_evaluated[n] and assignments.gap[n] <= horizon:
                _update_cell_assignment(cells, layout, n, support, numbering.cell, free, assignments, buffers)
        for n in range(candidate.shape[0]):
            if assignments.place[n] < 0 or assignments.gap[n] > horizon:
                continue
            for m in range(candidate.shape[0]):
                if not assignments.is_evaluated[m] and _is_possible_rival(cells, candidate[n], candidate[m]):
                    _update_cell_assignment(
                        cells, layout, m, support, numbering.cell, free, assignments, buffers
                    )
        limit, next_gap = _joint_gap_limit(assignments)
        if limit <= horizon or next_gap == np.inf:
            return limit
        horizon = min(limit, JOINT_GAP_RATIO * next_gap)


@inlined_no_refcount
def _is_possible_rival(cells, i, j):  # type: ignore[no-untyped-def]
    """Whether two cells of one ink are so close that both may be assigned to one cell of the layout."""
    if cells.ink[i] != cells.ink[j]:
        return False
    x = cells.center_px[j, 0] - cells.center_px[i, 0]
    y = cells.center_px[j, 1] - cells.center_px[i, 1]
    edge = equilateral_edge(max(cells.area_px[i], cells.area_px[j]))
    return x * x + y * y < (RIVAL_DISTANCE * edge) ** 2


@compiled
def _joint_gap_limit(assignments):  # type: ignore[no-untyped-def]
    """The gap up to which cells are numbered together, infinite without a unique assignment; and the least gap of the
    cells not evaluated."""
    least, next_gap = np.inf, np.inf
    for n in range(assignments.place.shape[0]):
        if not assignments.is_evaluated[n]:
            next_gap = min(next_gap, assignments.gap[n])
        elif assignments.place[n] >= 0 and assignments.candidate_count[assignments.place[n]] == 1:
            least = min(least, assignments.gap[n])
    return max(JOINT_GAP, JOINT_GAP_RATIO * least), next_gap


@inlined_no_refcount
def _update_cell_assignment(cells, layout, n, support, cell, free, assignments, buffers):  # type: ignore[no-untyped-def]
    """Assign candidate n to one of the cells of the layout ``free`` (F,), or to none."""
    center, nearest, squares = cells.center_px, assignments.nearest, assignments.squared_distance
    i = assignments.candidate[n]
    count = fill_nearest_points(support.grid, center[i, 0], center[i, 1], nearest, squares)
    predicted = fill_quadratic_map(center, i, support.cells, nearest[:count], squares, cell, layout, buffers)
    place = _nearest_place_of_ink(free, predicted, cells.ink[i], layout)
    assignments.support_radius2[n] = squares[count - 1] if count == SUPPORT_CELLS else np.inf
    assignments.place[n], assignments.is_evaluated[n] = place, True
    if place >= 0:
        assignments.candidate_count[place] += 1


@inlined_no_refcount
def _nearest_place_of_ink(free, predicted, ink, layout):  # type: ignore[no-untyped-def]
    """The free cell of the layout with this ink that is nearest to the predicted place, or -1 beyond the limit."""
    limit = MAX_PLACE_MISFIT * predicted.cell_size_mm
    best, least = -1, limit * limit
    if np.isnan(predicted.x_mm):
        return best
    for u in free:
        if layout.ink[u] == ink:
            dx, dy = layout.center_mm[u, 0] - predicted.x_mm, layout.center_mm[u, 1] - predicted.y_mm
            square = dx**2 + dy**2
            if square < least:
                best, least = u, square
    return best
