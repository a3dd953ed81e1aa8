"""The burning order of a pass' cells, and the entry point of each cell."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.products.laser.paths.beam import Points

BurnOrder = Literal["travel", "heat", "given"]
Ints = NDArray[np.int64]
# Cells up to this many nearest distances apart (median) count as neighbours that heat each other.
NEIGHBOURHOOD = 2.2


def order_cells(entries_mm: Points, order: BurnOrder) -> tuple[Ints, Ints]:
    """Find the burning order of cells and the entry point of each cell.

    Args:
        entries_mm: (N, K, 2) possible entry points of each cell.
        order: "travel": short moves; "heat": neighbours are burnt far apart in time; "given": order of the layout.

    Returns:
        (N,) cells in burning order, and (N,) the entry points (0 to K - 1) of the cells in this order.
    """
    from cmpdesign.products.laser.paths.tour import best_entries, find_short_tour

    if order == "travel":
        return find_short_tour(entries_mm)
    cells = np.arange(len(entries_mm))
    if order == "heat":
        cells = spread_order(entries_mm.mean(axis=1))
    return cells, best_entries(entries_mm, cells)


def spread_order(centre_mm: Points) -> Ints:
    """(N,) an order in which neighbours are burnt far apart in time.

    The cells form groups such that no two cells of a neighbourhood share a group. The groups are burnt one after the
    other, each in the same rows, so that two neighbours are about a whole group apart in the order.
    """
    with extra("laser"):
        from scipy.spatial import cKDTree

    if len(centre_mm) < 3:
        return np.arange(len(centre_mm))
    tree = cKDTree(centre_mm)
    nearest = tree.query(centre_mm, k=2)[0][:, 1]
    reach = NEIGHBOURHOOD * float(np.median(nearest))
    rows = _row_order(centre_mm, float(np.median(nearest)))
    group = _greedy_groups(tree.query_ball_point(centre_mm, reach), rows)
    return rows[np.argsort(group[rows], kind="stable")]


def shortest_pause(order: Ints, centre_mm: Points, times_s: NDArray[np.float64]) -> float:
    """The shortest time in s between the starts of two neighbouring cells; infinite without neighbours.

    Args:
        order: (N,) cells in burning order.
        centre_mm: (N, 2) centre of each cell.
        times_s: (N,) start time of each cell, in burning order.
    """
    with extra("laser"):
        from scipy.spatial import cKDTree

    if len(order) < 2:
        return float("inf")
    tree = cKDTree(centre_mm)
    reach = 1.2 * float(np.median(tree.query(centre_mm, k=2)[0][:, 1]))
    pairs = tree.query_pairs(reach, output_type="ndarray")
    begin_s = np.empty(len(order))
    begin_s[order] = times_s
    return float(np.abs(begin_s[pairs[:, 0]] - begin_s[pairs[:, 1]]).min()) if len(pairs) else float("inf")


def _row_order(centre_mm: Points, height_mm: float) -> Ints:
    """Cells row by row, every second row backwards."""
    row = np.floor((centre_mm[:, 1] - centre_mm[:, 1].min()) / height_mm + 0.5).astype(np.int64)
    x = np.where(row % 2 == 0, centre_mm[:, 0], -centre_mm[:, 0])
    return np.lexsort([x, row])


def _greedy_groups(neighbours: list[list[int]], sequence: Ints) -> Ints:
    """(N,) the smallest group that no neighbour has, assigned cell by cell in the given sequence."""
    group = np.full(len(neighbours), -1)
    for cell in sequence.tolist():
        used = set(group[neighbours[cell]].tolist())
        group[cell] = next(number for number in range(len(neighbours)) if number not in used)
    return group
