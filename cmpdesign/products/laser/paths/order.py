"""The order in which the cells of a pass are carved, and where each is entered."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import Points

BurnOrder = Literal["travel", "heat", "given"]
Ints = NDArray[np.int64]
# Cells this many mean distances apart count as neighbours for the heat that they give each other.
NEIGHBOURHOOD = 2.2


def order_cells(entries_mm: Points, order: BurnOrder) -> tuple[Ints, Ints]:
    """The cells in burning order, and the entry point of each.

    Args:
        entries_mm: (N, K, 2) points where each cell can be entered.
        order: "travel" is short; "heat" lets every neighbourhood cool before it is burnt in again; "given"
            is the layout's.

    Returns:
        (N,) cells, and (N,) the number (0 to K - 1) of each one's entry point, in that order.
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

    Cells are colored so that no two in a neighbourhood share a color, and burnt color by color. Within a
    color they
    run in the same rows, so that two neighbours lie about a whole color's cells apart in the order.
    """
    from scipy.spatial import cKDTree

    if len(centre_mm) < 3:
        return np.arange(len(centre_mm))
    tree = cKDTree(centre_mm)
    nearest = tree.query(centre_mm, k=2)[0][:, 1]
    reach = NEIGHBOURHOOD * float(np.median(nearest))
    rows = _row_order(centre_mm, float(np.median(nearest)))
    color = _greedy_coloring(tree.query_ball_point(centre_mm, reach), rows)
    return rows[np.argsort(color[rows], kind="stable")]


def shortest_pause(order: Ints, centre_mm: Points, times_s: NDArray[np.float64]) -> float:
    """The shortest time in s between two neighbouring cells.

    Args:
        order: (N,) cells in burning order.
        centre_mm: (N, 2) of each cell.
        times_s: (N,) when each is begun, in burning order.
    """
    from scipy.spatial import cKDTree

    if len(order) < 2:
        return float("inf")
    tree = cKDTree(centre_mm)
    reach = 1.2 * float(np.median(tree.query(centre_mm, k=2)[0][:, 1]))
    pairs = tree.query_pairs(reach, output_type="ndarray")
    begun = np.empty(len(order))
    begun[order] = times_s
    return float(np.abs(begun[pairs[:, 0]] - begun[pairs[:, 1]]).min()) if len(pairs) else float("inf")


def _row_order(centre_mm: Points, height_mm: float) -> Ints:
    """Cells row by row, every second row backwards."""
    row = np.floor((centre_mm[:, 1] - centre_mm[:, 1].min()) / height_mm + 0.5).astype(np.int64)
    x = np.where(row % 2 == 0, centre_mm[:, 0], -centre_mm[:, 0])
    return np.lexsort([x, row])


def _greedy_coloring(near: list[list[int]], sequence: Ints) -> Ints:
    """The smallest color that no neighbour has, cell by cell in the given sequence."""
    color = np.full(len(near), -1)
    for cell in sequence.tolist():
        taken = set(color[near[cell]].tolist())
        color[cell] = next(shade for shade in range(len(near)) if shade not in taken)
    return color
