"""Short tours through cells that can each be entered at several points: compiled loops.

A tour is found in three steps, which repeat until nothing gets shorter:

1. from nearest neighbours, from rows and from the given order: 2-opt and Or-opt moves over each cell's nearest
   neighbours (Bentley 1992), between the points where the cells are entered now;
2. the best entry point of every cell for this order, all at once (dynamic programming along the tour);
3. each cell is taken out and put where it lengthens the way least, at its best entry point.

Closed loops are left where they were entered, so a cell is one point of the way.
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
NEIGHBOURS = 10
MAX_ROUNDS = 12
MIN_GAIN_MM = 1e-9


def _compiled(function: Function) -> Function:
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)  # type: ignore[return-value]


def find_short_tour(entries_mm: Points) -> tuple[Ints, Ints]:
    """An order of the cells and the entry point of each.

    Args:
        entries_mm: (N, K, 2) points where each cell can be entered.

    Returns:
        (N,) the cells in order, and (N,) each one's entry point, 0 to K - 1, in that order.
    """
    count = len(entries_mm)
    if count < 3:
        return np.arange(count), best_entries(entries_mm, np.arange(count))
    centre_mm = entries_mm.mean(axis=1)
    near = _nearest_neighbours(centre_mm)
    starts = (_nearest_neighbour_order(centre_mm), np.arange(count), np.lexsort(centre_mm.T))
    tours = [_shorten_tour(start.astype(np.int64), entries_mm, near) for start in starts]
    return min(tours, key=lambda tour: tour_length_mm(entries_mm, *tour))


def _shorten_tour(order: Ints, entries_mm: Points, near: Ints) -> tuple[Ints, Ints]:
    """A tour from a first order: never longer than that order at its best entry points."""
    count = len(order)
    entry = best_entries(entries_mm, order)
    best = tour_length_mm(entries_mm, order, entry)
    trial = order.copy()
    _update_order(trial, entries_mm.mean(axis=1), near)
    trial_entry = best_entries(entries_mm, trial)
    if tour_length_mm(entries_mm, trial, trial_entry) < best:
        order, entry, best = trial, trial_entry, tour_length_mm(entries_mm, trial, trial_entry)
    for _ in range(MAX_ROUNDS):
        trial = order.copy()
        points = np.empty((count, 2))
        points[trial] = entries_mm[trial, entry]
        _update_order(trial, points, near)
        trial_entry = best_entries(entries_mm, trial)
        _update_by_reinsertion(trial, trial_entry, entries_mm, near)
        trial_entry = best_entries(entries_mm, trial)
        found = tour_length_mm(entries_mm, trial, trial_entry)
        if found > best - MIN_GAIN_MM:
            break
        order, entry, best = trial, trial_entry, found
    return order, entry


def tour_length_mm(entries_mm: Points, order: Ints, entry: Ints) -> float:
    """Length of the dark way from the first cell's entry point to the last one's."""
    way = np.diff(entries_mm[order, entry], axis=0)
    return float(np.hypot(way[:, 0], way[:, 1]).sum())


def _nearest_neighbours(centre_mm: Points) -> Ints:
    """(N, n) the nearest cells of each, the nearest first."""
    from scipy.spatial import cKDTree

    wanted = min(NEIGHBOURS + 1, len(centre_mm))
    _, near = cKDTree(centre_mm).query(centre_mm, k=wanted)
    return np.ascontiguousarray(near[:, 1:], dtype=np.int64)


@_compiled
def _nearest_neighbour_order(centre: Points) -> Ints:
    count = len(centre)
    order = np.empty(count, np.int64)
    left = np.arange(count)
    at = 0
    for i in range(count):
        order[i] = left[at]
        x, y = centre[left[at]]
        left[at] = left[count - 1 - i]
        shortest, at = np.inf, 0
        for j in range(count - 1 - i):
            d = (centre[left[j], 0] - x) ** 2 + (centre[left[j], 1] - y) ** 2
            if d < shortest:
                shortest, at = d, j
    return order


@_compiled
def _distance_or_zero(points: Points, a: int, b: int) -> float:
    """Distance of two cells' points; nothing where there is no cell (-1), before the first and after the
    last."""
    if a < 0 or b < 0:
        return 0.0
    return float(np.hypot(points[a, 0] - points[b, 0], points[a, 1] - points[b, 1]))


@_compiled
def _update_reversed(order: Ints, place: Ints, start: int, end: int) -> None:
    while start < end:
        order[start], order[end] = order[end], order[start]
        place[order[start]], place[order[end]] = start, end
        start, end = start + 1, end - 1


@_compiled
def _update_by_two_opt(order: Ints, place: Ints, points: Points, near: Ints, a: int) -> bool:
    """Join a with a near cell by reversing what lies between; for the way after a, and the one before it."""
    count = len(order)
    for forward in (True, False):
        i = place[a]
        j = i + 1 if forward else i - 1
        b = order[j] if 0 <= j < count else -1
        before = _distance_or_zero(points, a, b)
        for c in near[a]:
            joined = _distance_or_zero(points, a, c)
            if b >= 0 and joined >= before:
                break
            k = place[c]
            m = k + 1 if forward else k - 1
            d = order[m] if 0 <= m < count else -1
            if (
                before + _distance_or_zero(points, c, d) - joined - _distance_or_zero(points, b, d)
                > MIN_GAIN_MM
            ):
                if forward:
                    _update_reversed(order, place, min(i, k) + 1, max(i, k))
                else:
                    _update_reversed(order, place, min(i, k), max(i, k) - 1)
                return True
    return False


@_compiled
def _update_by_or_opt(order: Ints, place: Ints, points: Points, near: Ints, a: int) -> bool:
    """Move one to three cells that start or end with a to between two others, near a, either way round."""
    count = len(order)
    for size in range(1, 4):
        for forward in (True, False):
            start = place[a] if forward else place[a] - size + 1
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
            for c in near[a]:
                joined = _distance_or_zero(points, a, c)
                if joined >= removed:
                    break
                k = place[c]
                if start <= k <= end:
                    continue
                for side in (-1, 1):
                    m = k + side
                    if start <= m <= end:
                        m = end + 1 if side > 0 else start - 1
                    d = order[m] if 0 <= m < count else -1
                    added = joined + _distance_or_zero(points, far, d) - _distance_or_zero(points, c, d)
                    if removed - added > MIN_GAIN_MM:
                        _update_moved(order, place, start, end, k, side, forward)
                        return True
    return False


@_compiled
def _update_moved(order: Ints, place: Ints, start: int, end: int, k: int, side: int, a_first: bool) -> None:
    """Put order[start..end] beside position k (after it: side 1), its end "a" next to the cell there."""
    size = end - start + 1
    piece = order[start : end + 1].copy()
    # After k, the cell next to k comes first.
    if a_first != (side > 0):
        piece = piece[::-1].copy()
    target = k + (1 if side > 0 else 0)
    if target > end:
        for i in range(start, target - size):
            order[i] = order[i + size]
        low, high, at = start, target, target - size
    else:
        for i in range(end, target + size - 1, -1):
            order[i] = order[i - size]
        low, high, at = target, end + 1, target
    for i in range(size):
        order[at + i] = piece[i]
    for i in range(low, high):
        place[order[i]] = i


@_compiled
def _update_order(order: Ints, points: Points, near: Ints) -> None:
    """2-opt and Or-opt in place, until no cell has a move that shortens the way."""
    count = len(order)
    place = np.empty(count, np.int64)
    for i in range(count):
        place[order[i]] = i
    changed = True
    while changed:
        changed = False
        for i in range(count):
            a = order[i]
            while _update_by_two_opt(order, place, points, near, a) or _update_by_or_opt(
                order, place, points, near, a
            ):
                changed = True


@_compiled
def best_entries(entries: Points, order: Ints) -> Ints:
    """The entry points that make the way through the cells in this order shortest."""
    count, corners = len(order), entries.shape[1]
    came = np.zeros((count, corners), np.int64)
    cost = np.zeros(corners)
    for i in range(1, count):
        here, last = entries[order[i]], entries[order[i - 1]]
        reached = np.full(corners, np.inf)
        for k in range(corners):
            for j in range(corners):
                d = cost[j] + np.hypot(here[k, 0] - last[j, 0], here[k, 1] - last[j, 1])
                if d < reached[k]:
                    reached[k], came[i, k] = d, j
        cost = reached
    entry = np.empty(count, np.int64)
    at = np.argmin(cost) if count else 0
    for i in range(count - 1, -1, -1):
        entry[i] = at
        at = came[i, at]
    return entry


@_compiled
def _entry_distance(entries: Points, a: int, i: int, b: int, j: int) -> float:
    return float(np.hypot(entries[a, i, 0] - entries[b, j, 0], entries[a, i, 1] - entries[b, j, 1]))


@_compiled
def _update_by_reinsertion(order: Ints, entry: Ints, entries: Points, near: Ints) -> None:
    """Take each cell out and put it where, at its best entry point, it lengthens the way least; in place."""
    count, corners = len(order), entries.shape[1]
    place = np.empty(count, np.int64)
    at = np.empty(count, np.int64)
    for i in range(count):
        place[order[i]], at[order[i]] = i, entry[i]
    for a in range(count):
        i = place[a]
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
        for c in near[a]:
            for side in (-1, 1):
                m = place[c] + side
                d = order[m] if 0 <= m < count else -1
                if d == a:
                    continue
                joint = _entry_distance(entries, c, at[c], d, at[d]) if d >= 0 else 0.0
                for corner in range(corners):
                    added = _entry_distance(entries, c, at[c], a, corner) - joint
                    if d >= 0:
                        added += _entry_distance(entries, a, corner, d, at[d])
                    if added < best:
                        best, best_k, best_side, best_corner = added, place[c], side, corner
        if best_k >= 0:
            _update_moved(order, place, i, i, best_k, best_side, True)
            at[a] = best_corner
    for i in range(count):
        entry[i] = at[order[i]]
