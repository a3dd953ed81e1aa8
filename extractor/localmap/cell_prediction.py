"""Where the down-cells around numbered cells must be in the image: each is foreseen by the cells around it.

The three cells beside a place tell best. Those farther off are asked only about places that the nearer ones leave open,
and from which the pattern could begin at all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice import NEIGHBOUR_STEPS
from extractor.layout.lattice_tables import UNKNOWN_AXIAL
from extractor.numeric.compilation import compiled

MAX_OUTSIDE_SHARE = 0.02  # of a part's cells, where it is put into the layout
# The down-cells around a cell (q, r), as steps to their own (q, r), the nearest first: three touch its sides.
DOWN_CELL_STEPS = np.array([[q, r] for q in range(-4, 6) for r in range(-5, 5)], np.int32)
# From a cell's center to theirs, in axial steps, and in edges of an equilateral lattice.
MAX_STEP = 6
CENTER_VECTORS = DOWN_CELL_STEPS + np.array([-2 / 3, 1 / 3])
DISTANCES = np.sqrt((CENTER_VECTORS**2).sum(axis=1) + CENTER_VECTORS[:, 0] * CENTER_VECTORS[:, 1])
# How far from the nearest numbered cell the white one is looked for; farther only when it is not found nearer.
WHITE_REACHES = (0.7, 1.7, 2.7, 3.7)
REACH_CLASS = np.digitize(DISTANCES, WHITE_REACHES, right=True)
REACH_ORDER = np.argsort(REACH_CLASS, kind="stable")
DOWN_CELL_STEPS, CENTER_VECTORS = DOWN_CELL_STEPS[REACH_ORDER], CENTER_VECTORS[REACH_ORDER]
RING_STARTS = np.searchsorted(
    REACH_CLASS[REACH_ORDER], np.arange(len(WHITE_REACHES) + 1)
)  # where in these each reach begins


class AxialGrid(NamedTuple):
    """The axial places around a part of the mesh.

    Attributes:
        low_q, low_r: its least axial coordinates.
        holder: (Q, R) int32, which of the known cells stands at each place, -1 for none.
        closed: (Q, R) bool, the places not to be looked at.
    """

    low_q: int
    low_r: int
    cell_lookup: NDArray[np.int32]
    excluded: NDArray[np.bool_]


@compiled
def lattice_bases(center, at):  # type: ignore[no-untyped-def]
    """(K,) the cells with a place and neighbours that say which way the lattice runs, and (K, 2, 2) how: the image step
    per axial step, by least squares over the six neighbours of each."""
    reach, found = 1, 0
    for i in range(at.shape[0]):
        if at[i, 0] != UNKNOWN_AXIAL:
            reach = max(reach, abs(at[i, 0]) + 1, abs(at[i, 1]) + 1)
    side = 2 * reach + 1
    holder = np.full((side, side), -1, np.int32)
    for i in range(center.shape[0]):
        if at[i, 0] != UNKNOWN_AXIAL:
            holder[at[i, 0] + reach, at[i, 1] + reach] = i
    known, basis = np.empty(center.shape[0], np.int64), np.empty((center.shape[0], 2, 2))
    for i in range(center.shape[0]):
        if at[i, 0] == UNKNOWN_AXIAL:
            continue
        nqq, nqr, nrr = 0.0, 0.0, 0.0
        xq, xr, yq, yr = 0.0, 0.0, 0.0, 0.0
        for k in range(6):
            dq, dr = NEIGHBOUR_STEPS[k, 0], NEIGHBOUR_STEPS[k, 1]
            q, r = at[i, 0] + dq + reach, at[i, 1] + dr + reach
            if holder[q, r] < 0:
                continue
            dx = center[holder[q, r], 0] - center[i, 0]
            dy = center[holder[q, r], 1] - center[i, 1]
            nqq += dq * dq
            nqr += dq * dr
            nrr += dr * dr
            xq += dx * dq
            xr += dx * dr
            yq += dy * dq
            yr += dy * dr
        determinant = nqq * nrr - nqr * nqr
        if determinant > 0.5:
            basis[found, 0, 0] = (xq * nrr - xr * nqr) / determinant
            basis[found, 0, 1] = (xr * nqq - xq * nqr) / determinant
            basis[found, 1, 0] = (yq * nrr - yr * nqr) / determinant
            basis[found, 1, 1] = (yr * nqq - yq * nqr) / determinant
            known[found] = i
            found += 1
    return known[:found], basis[:found]


@compiled
def build_axial_grid(at, known, level):  # type: ignore[no-untyped-def]
    """The ``AxialGrid`` of the known cells (K,) at the axial places (N, 2), of which those with a ``level`` (K,) are
    asked;
    all places that these see are at least ``MAX_STEP`` from its ends."""
    low_q, low_r, high_q, high_r = 1 << 20, 1 << 20, -(1 << 20), -(1 << 20)
    for i in known:
        low_q, high_q = min(low_q, at[i, 0]), max(high_q, at[i, 0])
        low_r, high_r = min(low_r, at[i, 1]), max(high_r, at[i, 1])
    low_q, low_r = low_q - 2 * MAX_STEP, low_r - 2 * MAX_STEP
    holder = np.full((high_q - low_q + 2 * MAX_STEP + 1, high_r - low_r + 2 * MAX_STEP + 1), -1, np.int32)
    for n in range(known.shape[0]):
        if not np.isnan(level[n]):
            holder[at[known[n], 0] - low_q, at[known[n], 1] - low_r] = n
    return AxialGrid(low_q, low_r, holder, np.zeros(holder.shape, np.bool_))


@compiled
def update_excluded_places(grid, places):  # type: ignore[no-untyped-def]
    """Close places (P, 2), in place."""
    for n in range(places.shape[0]):
        grid.excluded[places[n, 0] - grid.low_q, places[n, 1] - grid.low_r] = True


@compiled
def update_excluded_misfits(grid, at, known, layers):  # type: ignore[no-untyped-def]
    """Close, in place, where the white cell would leave more of the known cells than may be beyond the layout along q,
    r or q + r, the three directions of its sides."""
    rows, columns = grid.cell_lookup.shape
    fits, below = np.zeros((3, rows + columns), np.bool_), np.zeros(rows + columns + 1, np.int64)
    allowed, reach = (
        MAX_OUTSIDE_SHARE * known.shape[0],
        layers + 1,
    )  # a side may be one step nearer, by the turn
    for axis in range(3):
        below[:] = 0
        for i in known:
            q, r = at[i, 0] - grid.low_q, at[i, 1] - grid.low_r
            below[(q, r, q + r)[axis] + 1] += 1
        for value in range(rows + columns):
            below[value + 1] += below[value]
        for value in range(rows + columns):
            low, high = max(value - reach, 0), min(value + reach + 1, rows + columns)
            fits[axis, value] = below[low] + known.shape[0] - below[high] <= allowed
    for q in range(rows):
        for r in range(columns):
            grid.excluded[q, r] |= not (fits[0, q] and fits[1, r] and fits[2, q + r])


@compiled
def predicted_places(center, seen, grid, ring):  # type: ignore[no-untyped-def]
    """(P, 2) int32 the axial places that any known cell sees in this ring around it and that are not closed, (P, 4)
    their x, y, radius and level as these cells have it, and (P,) how many tell."""
    known, basis, radius, level = seen
    rows, columns = grid.cell_lookup.shape
    count = np.count_nonzero(~grid.excluded)
    places, means = np.empty((count, 2), np.int32), np.zeros((count, 4))
    votes, found = np.zeros(count, np.int64), 0
    for q in range(MAX_STEP, rows - MAX_STEP):
        for r in range(MAX_STEP, columns - MAX_STEP):
            if grid.excluded[q, r]:
                continue
            for k in range(RING_STARTS[ring], RING_STARTS[ring + 1]):
                n = grid.cell_lookup[q - DOWN_CELL_STEPS[k, 0], r - DOWN_CELL_STEPS[k, 1]]
                if n >= 0:
                    i, along, across = known[n], CENTER_VECTORS[k, 0], CENTER_VECTORS[k, 1]
                    means[found, 0] += center[i, 0] + basis[n, 0, 0] * along + basis[n, 0, 1] * across
                    means[found, 1] += center[i, 1] + basis[n, 1, 0] * along + basis[n, 1, 1] * across
                    means[found, 2] += radius[n]
                    means[found, 3] += level[n]
                    votes[found] += 1
            if votes[found] > 0:
                places[found, 0], places[found, 1] = q + grid.low_q, r + grid.low_r
                for value in range(4):
                    means[found, value] /= votes[found]
                found += 1
    return places[:found], means[:found], votes[:found]
