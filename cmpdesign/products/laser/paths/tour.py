"""Short tours through cells with several entry points each: compiled loops.

A tour starts from the nearest-neighbour order, from rows, and from the given order. For each start, three operations
repeat until the tour gets no shorter:

1. 2-opt and Or-opt moves over each cell's nearest neighbours (Bentley 1992), between the current entry points;
2. the best entry points of all cells for this order (dynamic programming along the tour);
3. reinsertion of each cell at the place and the entry point that lengthen the tour least.

The beam leaves a closed loop where it entered the loop, so a cell is one point of the tour.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import Points

Function = TypeVar("Function", bound=Callable[..., Any])
Ints = NDArray[np.int64]
# Nearest cells of each cell that moves are tried with.
NEIGHBOURS = 10
# Largest number of repetitions.
MAX_ROUNDS = 12
# Least reduction of the length for a move.
MIN_GAIN_MM = 1e-9


def _compiled(function: Function) -> Function:
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)  # type: ignore[return-value]


def find_short_tour(entries_mm: Points) -> tuple[Ints, Ints]:
    """Find a short tour.

    Args:
        entries_mm: (N, K, 2) possible entry points of each cell.

    Returns:
        (N,) the cells in order, and (N,) the entry points (0 to K - 1) of the cells in this order.
    """
    count = len(entries_mm)
    if count < 3:
        return np.arange(count), best_entries(entries_mm, np.arange(count))
    centre_mm = entries_mm.mean(axis=1)
    neighbours = _nearest_neighbours(centre_mm)
    starts = (_nearest_neighbour_order(centre_mm), np.arange(count), np.lexsort(centre_mm.T))
    tours = [_shorten_tour(start.astype(np.int64), entries_mm, neighbours) for start in starts]
    return min(tours, key=lambda tour: tour_length_mm(entries_mm, *tour))


def _shorten_tour(order: Ints, entries_mm: Points, neighbours: Ints) -> tuple[Ints, Ints]:
    """A tour from a first order, at most as long as that order at its best entry points."""
    count = len(order)
    entry = best_entries(entries_mm, order)
    best = tour_length_mm(entries_mm, order, entry)
    trial = order.copy()
    _update_order(trial, entries_mm.mean(axis=1), neighbours)
    trial_entry = best_entries(entries_mm, trial)
    if tour_length_mm(entries_mm, trial, trial_entry) < best:
        order, entry, best = trial, trial_entry, tour_length_mm(entries_mm, trial, trial_entry)
    for _ in range(MAX_ROUNDS):
        trial = order.copy()
        points = np.empty((count, 2))
        points[trial] = entries_mm[trial, entry]
        _update_order(trial, points, neighbours)
        trial_entry = best_entries(entries_mm, trial)
        _update_by_reinsertion(trial, trial_entry, entries_mm, neighbours)
        trial_entry = best_entries(entries_mm, trial)
        length = tour_length_mm(entries_mm, trial, trial_entry)
        if length > best - MIN_GAIN_MM:
            break
        order, entry, best = trial, trial_entry, length
    return order, entry


def tour_length_mm(entries_mm: Points, order: Ints, entry: Ints) -> float:
    """Length of the moves without beam from the first cell's entry point to the last cell's entry point."""
    moves = np.diff(entries_mm[order, entry], axis=0)
    return float(np.hypot(moves[:, 0], moves[:, 1]).sum())


def _nearest_neighbours(centre_mm: Points) -> Ints:
    """(N, n) the nearest cells of each cell, the nearest first."""
    from scipy.spatial import cKDTree

    count = min(NEIGHBOURS + 1, len(centre_mm))
    _, nearest = cKDTree(centre_mm).query(centre_mm, k=count)
    return np.ascontiguousarray(nearest[:, 1:], dtype=np.int64)


@_compiled
def _nearest_neighbour_order(centre: Points) -> Ints:
    """(N,) from cell 0, always the nearest of the remaining cells."""
    count = len(centre)
    order = np.empty(count, np.int64)
    remaining = np.arange(count)
    nearest = 0
    for i in range(count):
        order[i] = remaining[nearest]
        x, y = centre[remaining[nearest]]
        remaining[nearest] = remaining[count - 1 - i]
        shortest, nearest = np.inf, 0
        for j in range(count - 1 - i):
            d = (centre[remaining[j], 0] - x) ** 2 + (centre[remaining[j], 1] - y) ** 2
            if d < shortest:
                shortest, nearest = d, j
    return order


@_compiled
def _distance_or_zero(points: Points, a: int, b: int) -> float:
    """Distance of two cells' points; 0 if one cell is -1 (before the first or after the last cell)."""
    if a < 0 or b < 0:
        return 0.0
    return float(np.hypot(points[a, 0] - points[b, 0], points[a, 1] - points[b, 1]))


@_compiled
def _update_reversed(order: Ints, position: Ints, start: int, end: int) -> None:
    """Reverse order[start..end]."""
    while start < end:
        order[start], order[end] = order[end], order[start]
        position[order[start]], position[order[end]] = start, end
        start, end = start + 1, end - 1


@_compiled
def _update_by_two_opt(order: Ints, position: Ints, points: Points, neighbours: Ints, a: int) -> bool:
    """Make one 2-opt move that joins cell a with a neighbour, on the side after or before a; False if none helps."""
    count = len(order)
    for forward in (True, False):
        i = position[a]
        j = i + 1 if forward else i - 1
        b = order[j] if 0 <= j < count else -1
        before = _distance_or_zero(points, a, b)
        for c in neighbours[a]:
            joined = _distance_or_zero(points, a, c)
            if b >= 0 and joined >= before:
                break
            k = position[c]
            m = k + 1 if forward else k - 1
            d = order[m] if 0 <= m < count else -1
            if (
                before + _distance_or_zero(points, c, d) - joined - _distance_or_zero(points, b, d)
                > MIN_GAIN_MM
            ):
                if forward:
                    _update_reversed(order, position, min(i, k) + 1, max(i, k))
                else:
                    _update_reversed(order, position, min(i, k), max(i, k) - 1)
                return True
    return False


@_compiled
def _update_by_or_opt(order: Ints, position: Ints, points: Points, neighbours: Ints, a: int) -> bool:
    """Make one Or-opt move: one to three cells from or to cell a move next to a neighbour; False if none helps."""
    count = len(order)
    for size in range(1, 4):
        for forward in (True, False):
            start = position[a] if forward else position[a] - size + 1
            end = start + size - 1
            if start < 0 or end >= count:
                continue
            far = order[end] if forward else order[start]
            before = order[start - 1] if start > 0 else -1
            after = order[end + 1] if end + 1 < count else -1
            removed = _distance_or_zero(points, before, order[start]) + _distance_or_zero(
                points, order[end], after
            )
            removed -= _distance_or_zero(points, before, after) if before >= 0 and after >= 0 else 0.0
            if removed <= MIN_GAIN_MM:
                continue
            for c in neighbours[a]:
                joined = _distance_or_zero(points, a, c)
                if joined >= removed:
                    break
                k = position[c]
                if start <= k <= end:
                    continue
                for side in (-1, 1):
                    m = k + side
                    if start <= m <= end:
                        m = end + 1 if side > 0 else start - 1
                    d = order[m] if 0 <= m < count else -1
                    added = joined + _distance_or_zero(points, far, d) - _distance_or_zero(points, c, d)
                    if removed - added > MIN_GAIN_MM:
                        _update_moved(order, position, start, end, k, side, forward)
                        return True
    return False


@_compiled
def _update_moved(
    order: Ints, position: Ints, start: int, end: int, k: int, side: int, a_first: bool
) -> None:
    """Move order[start..end] to position k, before (side -1) or after (side 1) the cell there.

    Cell a, the first or (not ``a_first``) the last of the moved cells, becomes the neighbour of the cell at k.
    """
    size = end - start + 1
    moved = order[start : end + 1].copy()
    # After position k, the cell next to k comes first.
    if a_first != (side > 0):
        moved = moved[::-1].copy()
    target = k + (1 if side > 0 else 0)
    if target > end:
        for i in range(start, target - size):
            order[i] = order[i + size]
        low, high, first = start, target, target - size
    else:
        for i in range(end, target + size - 1, -1):
            order[i] = order[i - size]
        low, high, first = target, end + 1, target
    for i in range(size):
        order[first + i] = moved[i]
    for i in range(low, high):
        position[order[i]] = i


@_compiled
def _update_order(order: Ints, points: Points, neighbours: Ints) -> None:
    """Make 2-opt and Or-opt moves until no move shortens the tour.

    Args:
        order: (N,) cells in order; updated.
        points: (N, 2) entry point of each cell.
        neighbours: (N, n) nearest cells of each cell.
    """
    count = len(order)
    position = np.empty(count, np.int64)
    for i in range(count):
        position[order[i]] = i
    changed = True
    while changed:
        changed = False
        for i in range(count):
            a = order[i]
            while _update_by_two_opt(order, position, points, neighbours, a) or _update_by_or_opt(
                order, position, points, neighbours, a
            ):
                changed = True


@_compiled
def best_entries(entries: Points, order: Ints) -> Ints:
    """(N,) the entry points with the shortest tour through the cells in this order (dynamic programming)."""
    count, corners = len(order), entries.shape[1]
    predecessor = np.zeros((count, corners), np.int64)
    cost = np.zeros(corners)
    for i in range(1, count):
        here, last = entries[order[i]], entries[order[i - 1]]
        reached = np.full(corners, np.inf)
        for k in range(corners):
            for j in range(corners):
                d = cost[j] + np.hypot(here[k, 0] - last[j, 0], here[k, 1] - last[j, 1])
                if d < reached[k]:
                    reached[k], predecessor[i, k] = d, j
        cost = reached
    entry = np.empty(count, np.int64)
    corner = np.argmin(cost) if count else 0
    for i in range(count - 1, -1, -1):
        entry[i] = corner
        corner = predecessor[i, corner]
    return entry


@_compiled
def _entry_distance(entries: Points, a: int, i: int, b: int, j: int) -> float:
    """Distance from entry point i of cell a to entry point j of cell b."""
    return float(np.hypot(entries[a, i, 0] - entries[b, j, 0], entries[a, i, 1] - entries[b, j, 1]))


@_compiled
def _update_by_reinsertion(order: Ints, entry: Ints, entries: Points, neighbours: Ints) -> None:
    """Move each cell to the place and the entry point that lengthen the tour least.

    Args:
        order, entry: (N,) cells in order and their entry points; updated.
        entries: (N, K, 2) possible entry points of each cell.
        neighbours: (N, n) nearest cells of each cell.
    """
    count, corners = len(order), entries.shape[1]
    position = np.empty(count, np.int64)
    at = np.empty(count, np.int64)  # entry point of each cell
    for i in range(count):
        position[order[i]], at[order[i]] = i, entry[i]
    for a in range(count):
        i = position[a]
        before = order[i - 1] if i > 0 else -1
        after = order[i + 1] if i + 1 < count else -1
        removed = 0.0
        if before >= 0:
            removed += _entry_distance(entries, before, at[before], a, at[a])
        if after >= 0:
            removed += _entry_distance(entries, a, at[a], after, at[after])
        if before >= 0 and after >= 0:
            removed -= _entry_distance(entries, before, at[before], after, at[after])
        best, best_k, best_side, best_corner = removed - MIN_GAIN_MM, -1, 0, 0
        for c in neighbours[a]:
            for side in (-1, 1):
                m = position[c] + side
                d = order[m] if 0 <= m < count else -1
                if d == a:
                    continue
                joint = _entry_distance(entries, c, at[c], d, at[d]) if d >= 0 else 0.0
                for corner in range(corners):
                    added = _entry_distance(entries, c, at[c], a, corner) - joint
                    if d >= 0:
                        added += _entry_distance(entries, a, corner, d, at[d])
                    if added < best:
                        best, best_k, best_side, best_corner = added, position[c], side, corner
        if best_k >= 0:
            _update_moved(order, position, i, i, best_k, best_side, True)
            at[a] = best_corner
    for i in range(count):
        entry[i] = at[order[i]]
