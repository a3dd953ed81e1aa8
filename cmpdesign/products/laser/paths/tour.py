"""Short tours through cells with several entry points each.

A tour starts from the nearest-neighbour order, from rows, and from the given order. For each start, three operations
repeat until the tour gets no shorter:

1. 2-opt and Or-opt moves over each cell's nearest neighbours (Bentley 1992), between the current entry points;
2. the best entry points of all cells for this order (dynamic programming along the tour);
3. reinsertion of each cell at the place and the entry point that lengthen the tour least.

The beam leaves a closed loop where it entered the loop, so a cell is one point of the tour.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign._native import tour as native
from cmpdesign.libraries import extra
from cmpdesign.products.laser.paths.beam import Points

Ints = NDArray[np.int64]
# Nearest cells of each cell that moves are tried with.
NEIGHBOURS = 10
# Largest number of repetitions.
MAX_ROUNDS = 12
# Least reduction of the length for a move.
MIN_GAIN_MM = 1e-9


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
    starts = (native.nearest_neighbour_order(centre_mm), np.arange(count), np.lexsort(centre_mm.T))
    tours = [_shorten_tour(start.astype(np.int64), entries_mm, neighbours) for start in starts]
    return min(tours, key=lambda tour: tour_length_mm(entries_mm, *tour))


def _shorten_tour(order: Ints, entries_mm: Points, neighbours: Ints) -> tuple[Ints, Ints]:
    """A tour from a first order, at most as long as that order at its best entry points."""
    count = len(order)
    entry = best_entries(entries_mm, order)
    best = tour_length_mm(entries_mm, order, entry)
    trial = order.copy()
    native.update_order(trial, entries_mm.mean(axis=1), neighbours, MIN_GAIN_MM)
    trial_entry = best_entries(entries_mm, trial)
    if tour_length_mm(entries_mm, trial, trial_entry) < best:
        order, entry, best = trial, trial_entry, tour_length_mm(entries_mm, trial, trial_entry)
    for _ in range(MAX_ROUNDS):
        trial = order.copy()
        points = np.empty((count, 2))
        points[trial] = entries_mm[trial, entry]
        native.update_order(trial, points, neighbours, MIN_GAIN_MM)
        trial_entry = best_entries(entries_mm, trial)
        native.update_by_reinsertion(trial, trial_entry, entries_mm, neighbours, MIN_GAIN_MM)
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
    with extra("laser"):
        from scipy.spatial import cKDTree

    count = min(NEIGHBOURS + 1, len(centre_mm))
    _, nearest = cKDTree(centre_mm).query(centre_mm, k=count)
    return np.ascontiguousarray(nearest[:, 1:], dtype=np.int64)


def best_entries(entries_mm: Points, order: Ints) -> Ints:
    """(N,) the entry points with the shortest tour through the cells (N, K, 2) in this order (dynamic programming)."""
    return native.best_entries(entries_mm, order)
