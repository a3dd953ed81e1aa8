"""Predicts the image places of the down-cells around numbered cells.

The three cells next to a place predict it best. Cells farther away are used only for places that the nearer cells leave
open and that are possible origins of the pattern.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice import NEIGHBOUR_STEPS
from extractor.layout.lattice_tables import UNKNOWN_AXIAL
from extractor.numeric.compilation import compiled

MAX_OUTSIDE_SHARE = 0.02  # of a component's cells, outside the layout at an admissible origin
# The down-cells around a cell (q, r), as axial steps, the nearest first: three touch its sides.
DOWN_CELL_STEPS = np.array([[q, r] for q in range(-4, 6) for r in range(-5, 5)], np.int32)
MAX_STEP = 6  # largest axial step to a down-cell, and one more
# The vectors between the centers, in axial steps, and their lengths in edges of an equilateral lattice.
CENTER_VECTORS = DOWN_CELL_STEPS + np.array([-2 / 3, 1 / 3])
DISTANCES = np.sqrt((CENTER_VECTORS**2).sum(axis=1) + CENTER_VECTORS[:, 0] * CENTER_VECTORS[:, 1])
# Distances from the nearest numbered cell, in edges, within which the white cell is searched, ring by ring.
WHITE_REACHES = (0.7, 1.7, 2.7, 3.7)
REACH_CLASS = np.digitize(DISTANCES, WHITE_REACHES, right=True)
REACH_ORDER = np.argsort(REACH_CLASS, kind="stable")
DOWN_CELL_STEPS, CENTER_VECTORS = DOWN_CELL_STEPS[REACH_ORDER], CENTER_VECTORS[REACH_ORDER]
# The index of each ring's first step.
RING_STARTS = np.searchsorted(REACH_CLASS[REACH_ORDER], np.arange(len(WHITE_REACHES) + 1))


class AxialGrid(NamedTuple):
    """The axial places around a component of the cell mesh.

    Attributes:
        low_q, low_r: the least axial coordinates.
        cell_lookup: (Q, R) int32, the index of the known cell at each place, -1 for none.
        excluded: (Q, R) bool, the places not to be predicted.
    """

    low_q: int
    low_r: int
    cell_lookup: NDArray[np.int32]
    excluded: NDArray[np.bool_]


class KnownCells(NamedTuple):
    """The K cells that predict.

    Attributes:
        cells: (K,) int64, the cells of the image.
        basis: (K, 2, 2) float64, px per axial step.
        radius_px: (K,) float64, over which the cell's color is sampled.
        level: (K,) float64, the sum of its channels, NaN outside the image.
    """

    cells: NDArray[np.int64]
    basis: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    level: NDArray[np.float64]


class PredictedPlaces(NamedTuple):
    """P predicted down-cells.

    Attributes:
        axial: (P, 2) int32, the axial places.
        means: (P, 4) float64, the means of x and y, px, of ``radius_px`` and of ``level`` over the predicting cells.
        support_count: (P,) int64, the number of predicting cells.
    """

    axial: NDArray[np.int32]
    means: NDArray[np.float64]
    support_count: NDArray[np.int64]


@compiled
def lattice_bases(center, axial):  # type: ignore[no-untyped-def]
    """The local bases of the lattice, by least squares over the six neighbours of each cell.

    Args:
        center: (N, 2) px; axial: (N, 2) int32, ``UNKNOWN_AXIAL`` for unknown.

    Returns:
        (K,) int64, the cells with enough neighbours, and (K, 2, 2) float64, px per axial step at each.
    """
    reach, found = 1, 0
    for i in range(axial.shape[0]):
        if axial[i, 0] != UNKNOWN_AXIAL:
            reach = max(reach, abs(axial[i, 0]) + 1, abs(axial[i, 1]) + 1)
    side = 2 * reach + 1
    lookup = np.full((side, side), -1, np.int32)
    for i in range(center.shape[0]):
        if axial[i, 0] != UNKNOWN_AXIAL:
            lookup[axial[i, 0] + reach, axial[i, 1] + reach] = i
    known, basis = np.empty(center.shape[0], np.int64), np.empty((center.shape[0], 2, 2))
    for i in range(center.shape[0]):
        if axial[i, 0] == UNKNOWN_AXIAL:
            continue
        nqq, nqr, nrr = 0.0, 0.0, 0.0
        xq, xr, yq, yr = 0.0, 0.0, 0.0, 0.0
        for k in range(6):
            dq, dr = NEIGHBOUR_STEPS[k, 0], NEIGHBOUR_STEPS[k, 1]
            j = lookup[axial[i, 0] + dq + reach, axial[i, 1] + dr + reach]
            if j < 0:
                continue
            dx, dy = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
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
def build_axial_grid(axial, known, level):  # type: ignore[no-untyped-def]
    """The ``AxialGrid`` of the known cells (K,), with all places that they can predict.

    Every such place is at least ``MAX_STEP`` from the grid's border.

    Args:
        axial: (N, 2) int32.
        level: (K,) cells whose level is NaN predict nothing.
    """
    low_q, low_r, high_q, high_r = 1 << 20, 1 << 20, -(1 << 20), -(1 << 20)
    for i in known:
        low_q, high_q = min(low_q, axial[i, 0]), max(high_q, axial[i, 0])
        low_r, high_r = min(low_r, axial[i, 1]), max(high_r, axial[i, 1])
    low_q, low_r = low_q - 2 * MAX_STEP, low_r - 2 * MAX_STEP
    lookup = np.full((high_q - low_q + 2 * MAX_STEP + 1, high_r - low_r + 2 * MAX_STEP + 1), -1, np.int32)
    for n in range(known.shape[0]):
        if not np.isnan(level[n]):
            lookup[axial[known[n], 0] - low_q, axial[known[n], 1] - low_r] = n
    return AxialGrid(low_q, low_r, lookup, np.zeros(lookup.shape, np.bool_))


@compiled
def update_excluded_places(grid, places):  # type: ignore[no-untyped-def]
    """Exclude axial places (P, 2)."""
    for n in range(places.shape[0]):
        grid.excluded[places[n, 0] - grid.low_q, places[n, 1] - grid.low_r] = True


@compiled
def update_excluded_misfits(grid, axial, known, layers):  # type: ignore[no-untyped-def]
    """Exclude the places where the white cell would leave too many known cells outside the layout.

    The extents along q, r and q + r, the directions of the layout's sides, are compared.
    """
    rows, columns = grid.cell_lookup.shape
    fits, below = np.zeros((3, rows + columns), np.bool_), np.zeros(rows + columns + 1, np.int64)
    allowed = MAX_OUTSIDE_SHARE * known.shape[0]
    reach = layers + 1  # by the rotation, a side may be one step nearer
    for axis in range(3):
        below[:] = 0
        for i in known:
            q, r = axial[i, 0] - grid.low_q, axial[i, 1] - grid.low_r
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
def predicted_places(center, known, grid, ring):  # type: ignore[no-untyped-def]
    """The down-cells that are not excluded and have a known cell within one ring.

    Args:
        center: (N, 2) px.
        known: ``KnownCells``.
        grid: ``AxialGrid`` of these.
        ring: index into ``WHITE_REACHES``.

    Returns:
        ``PredictedPlaces``.
    """
    rows, columns = grid.cell_lookup.shape
    count = np.count_nonzero(~grid.excluded)
    places, means = np.empty((count, 2), np.int32), np.zeros((count, 4))
    support, found = np.zeros(count, np.int64), 0
    for q in range(MAX_STEP, rows - MAX_STEP):
        for r in range(MAX_STEP, columns - MAX_STEP):
            if grid.excluded[q, r]:
                continue
            for k in range(RING_STARTS[ring], RING_STARTS[ring + 1]):
                n = grid.cell_lookup[q - DOWN_CELL_STEPS[k, 0], r - DOWN_CELL_STEPS[k, 1]]
                if n >= 0:
                    i, dq, dr = known.cells[n], CENTER_VECTORS[k, 0], CENTER_VECTORS[k, 1]
                    means[found, 0] += center[i, 0] + known.basis[n, 0, 0] * dq + known.basis[n, 0, 1] * dr
                    means[found, 1] += center[i, 1] + known.basis[n, 1, 0] * dq + known.basis[n, 1, 1] * dr
                    means[found, 2] += known.radius_px[n]
                    means[found, 3] += known.level[n]
                    support[found] += 1
            if support[found] > 0:
                places[found, 0], places[found, 1] = q + grid.low_q, r + grid.low_r
                for value in range(4):
                    means[found, value] /= support[found]
                found += 1
    return PredictedPlaces(places[:found], means[:found], support[:found])
