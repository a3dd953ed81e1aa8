"""Which of the layout's free places the cells without a number claim, the nearest to the numbered ones first."""

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
from extractor.numeric.nearest_points import fill_nearest_points

JOINT_GAP = 1.7  # what is not farther from a numbered cell, in cells, is numbered together,
JOINT_GAP_RATIO = 1.25  # and what is not so much farther than the nearest
MAX_PLACE_MISFIT = 0.3  # in cells, between where the map puts a cell and the layout's place for it
RIVAL_DISTANCE = (
    1.5  # in cells, how near to each other two may be what is left of one; the next of its ink is 1.7 away
)


class CellAssignments(NamedTuple):
    """What loose cells (L,) claim of the layout's places (U,).

    Attributes:
        place: (L,) int32, the place that a cell would take, or -1.
        asked: (L,) bool, the cells that were asked for it, and those that need not be.
        gap: (L,) how far each is from the next numbered one, in cells; infinite if it is one.
        reach2: (L,) px^2, the squared distance of the farthest witness of those asked: a nearer one changes the claim.
        takers: (U,) int32, how many cells claim each place.
        near, square: the witnesses of one cell and their squared distances, a buffer.
    """

    place: NDArray[np.int32]
    asked: NDArray[np.bool_]
    gap: NDArray[np.float64]
    support_radius2: NDArray[np.float64]
    candidate_count: NDArray[np.int32]
    near: NDArray[np.int32]
    squared_distance: NDArray[np.float64]


@compiled
def empty_assignments(cells, places):  # type: ignore[no-untyped-def]
    """``CellAssignments`` before anything is asked."""
    return CellAssignments(
        np.full(cells, -1, np.int32),
        np.zeros(cells, np.bool_),
        np.empty(cells),
        np.empty(cells),
        np.zeros(places, np.int32),
        np.empty(SUPPORT_CELLS, np.int32),
        np.empty(SUPPORT_CELLS),
    )


@compiled
def update_outdated_assignments(center, loose, fresh, cell, free, claims):  # type: ignore[no-untyped-def]
    """Forget the claims to places that are not free any more, and those that the fresh cells may change."""
    claims.candidate_count[:] = 0
    for n in range(loose.shape[0]):
        i, place = loose[n], claims.place[n]
        if cell[i] >= 0 or (place >= 0 and not free[place]):
            claims.place[n] = -1
        if cell[i] < 0 and claims.asked[n] and _is_any_within(center, i, fresh, claims.support_radius2[n]):
            claims.place[n], claims.asked[n] = -1, False
        if claims.place[n] >= 0:
            claims.candidate_count[claims.place[n]] += 1


@inlined_no_refcount
def _is_any_within(center, i, fresh, reach2):  # type: ignore[no-untyped-def]
    """Whether one of the fresh cells lies within reach of cell i."""
    for j in fresh:
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        if x * x + y * y < reach2:
            return True
    return False


@compiled
def _update_gaps(center, area, loose, known, xy, grid, cell, claims):  # type: ignore[no-untyped-def]
    """Write how far from the numbered cells the loose ones are; who is too far, whatever the map, need not be asked."""
    for n in range(loose.shape[0]):
        i = loose[n]
        if cell[i] >= 0:
            claims.gap[n], claims.asked[n] = np.inf, True
            continue
        fill_nearest_points(
            xy, grid, center[i, 0], center[i, 1], claims.near[:1], claims.squared_distance[:1]
        )
        claims.gap[n] = np.sqrt(claims.squared_distance[0]) / equilateral_edge(area[known[claims.near[0]]])
        if not claims.asked[n] and not claims.gap[n] < 2.0 * MAX_SUPPORT_DISTANCE:
            claims.support_radius2[n], claims.asked[n] = (
                np.inf,
                True,
            )  # asked anew when anything has been numbered


@compiled
def update_assignments(center, area, ink, loose, known, xy, grid, cell, free, plan, claims):  # type: ignore[no-untyped-def]
    """Let the loose cells that are the nearest to numbered ones claim places, and those beside them that might claim
    the same, until it is plain who is numbered; up to which gap these are.

    ``xy`` are the centers of the known cells, and ``grid`` their buckets.
    """
    _update_gaps(center, area, loose, known, xy, grid, cell, claims)
    places, room = np.flatnonzero(free), allocate_map_buffers()
    horizon = JOINT_GAP
    while True:
        for n in range(loose.shape[0]):
            if not claims.asked[n] and claims.gap[n] <= horizon:
                _update_cell_assignment(
                    center, ink, loose, n, known, xy, grid, cell, places, plan, claims, room
                )
        for n in range(loose.shape[0]):
            if claims.place[n] < 0 or claims.gap[n] > horizon:
                continue
            for m in range(loose.shape[0]):
                if not claims.asked[m] and _is_possible_rival(center, area, ink, loose[n], loose[m]):
                    _update_cell_assignment(
                        center, ink, loose, m, known, xy, grid, cell, places, plan, claims, room
                    )
        limit, beyond = _joint_gap_limit(claims)
        if limit <= horizon or beyond == np.inf:
            return limit
        horizon = min(limit, JOINT_GAP_RATIO * beyond)


@inlined_no_refcount
def _is_possible_rival(center, area, ink, i, j):  # type: ignore[no-untyped-def]
    """Whether two cells of one ink are so near to each other that both might be taken for one of the layout."""
    if ink[i] != ink[j]:
        return False
    x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
    return x * x + y * y < (RIVAL_DISTANCE * equilateral_edge(max(area[i], area[j]))) ** 2


@compiled
def _joint_gap_limit(claims):  # type: ignore[no-untyped-def]
    """Up to which gap cells are numbered together, infinite where none alone claims a place; and the least gap of those
    that were not asked."""
    least, beyond = np.inf, np.inf
    for n in range(claims.place.shape[0]):
        if not claims.asked[n]:
            beyond = min(beyond, claims.gap[n])
        elif claims.place[n] >= 0 and claims.candidate_count[claims.place[n]] == 1:
            least = min(least, claims.gap[n])
    return max(JOINT_GAP, JOINT_GAP_RATIO * least), beyond


@inlined_no_refcount
def _update_cell_assignment(center, ink, loose, n, known, xy, grid, cell, places, plan, claims, room):  # type: ignore[no-untyped-def]
    """Write which place a loose cell claims."""
    i, near, square = loose[n], claims.near, claims.squared_distance
    count = fill_nearest_points(xy, grid, center[i, 0], center[i, 1], near, square)
    x, y, size = fill_quadratic_map(center, i, known, near[:count], square, cell, plan, room)
    place = _nearest_place_of_ink(places, x, y, MAX_PLACE_MISFIT * size, ink[i], plan)
    claims.support_radius2[n] = square[count - 1] if count == SUPPORT_CELLS else np.inf
    claims.place[n], claims.asked[n] = place, True
    if place >= 0:
        claims.candidate_count[place] += 1


@inlined_no_refcount
def _nearest_place_of_ink(places, x, y, limit, ink, plan):  # type: ignore[no-untyped-def]
    """Which of the layout's places holds this ink within the limit of (x, y), or -1."""
    best, least = -1, limit * limit
    if np.isnan(x):
        return best
    for u in places:
        if plan.ink[u] == ink:
            apart = (plan.center_mm[u, 0] - x) ** 2 + (plan.center_mm[u, 1] - y) ** 2
            if apart < least:
                best, least = u, apart
    return best
