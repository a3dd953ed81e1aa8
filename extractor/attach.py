"""Cells that stand apart (behind a scratch, amid missing ones) are numbered by prediction and color, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .algebra import cholesky_solve
from .bridge import held_in
from .cells import Cells
from .engine import compiled, vectorized
from .gradients import seen_as, slopes
from .near import bucketed, nearest
from .numbering import Numbering
from .tables import Lattice
from .touch import UNTURNED, edge_of, spread, touch, touching, turn_like
from .types import Origin

ROUNDS = 40
NEAR = 1.7  # what is not farther from a numbered cell, in cells, is numbered together,
FARTHER = 1.25  # and what is not so much farther than the nearest
WITNESSES = 20  # numbered cells through which a quadratic map to the layout is laid
MIN_WITNESSES = 8
REACH = 4.5  # how far from the nearest of them a cell may stand, in cells
MAX_MISFIT = 0.3  # in cells, between where the map puts a cell and the layout's place for it
MAX_SIGMA = 0.12  # of the map there, in cells
ROBUST_ROUNDS = 4  # what dirt has cut is among the witnesses, too
EXACT = 0.02  # of a cell: witnesses that fit so well are not judged
RIDGE = 1e-3  # holds the curvature of the map where the witnesses lie in a row
MIN_PIVOT = 1e-7  # of the normal matrix against its largest entry: below, they do lie in a row
TERMS = 6  # 1, x, y, xx, xy, yy
# A witness's products: of the terms with each other, those of one power together, and with its place in the layout.
PRODUCT = np.array([[0, 1, 2, 3, 4, 5], [1, 3, 4, 6, 7, 8], [2, 4, 5, 7, 8, 9]])
PRODUCT = np.concatenate([PRODUCT, [[3, 6, 7, 10, 11, 12], [4, 7, 8, 11, 12, 13], [5, 8, 9, 12, 13, 14]]])
PLACE_X, PLACE_Y, CLOSENESS, PRODUCTS = 15, 21, 27, 32


def attach(cells: Cells, numbering: Numbering, lattice: Lattice) -> Numbering:
    """Number what is not connected with the reference by any face of the mesh.

    Cells that share a corner with a numbered one are its neighbours. For the others, the numbered cells around must map
    the cell near a free place of the layout that holds its ink, with little doubt, and no other cell may claim it; the
    nearest come first. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 leaves no choice. What does not fit
    across the gap, or across damaged cells by which the mesh hung together, loses its number.
    """
    if np.count_nonzero(numbering.cell >= 0) == len(lattice.ink):
        return numbering
    white = numbering.white_px if numbering.origin is Origin.WHITE else np.full(2, np.nan)
    seen = cells.center_px, cells.corner_px, cells.area_px, cells.whole
    step = 1 if numbering.mirrored else 2
    return replace(numbering, cell=_attach(seen, cells.ink, numbering.cell, white, lattice.plan, step))


@compiled
def _attach(seen, ink, cell, white, plan, step):  # type: ignore[no-untyped-def]
    """The numbers of the cells with those that could be attached, without those that hang in nothing."""
    center, corner, area, whole = seen
    beside = touching(center, corner, area, whole, cell, seen_as(cell, plan.ink.shape[0]), plan, step)
    held = held_in(center, corner, area, whole, cell, white, beside, plan, step)
    cell, gone = _without(cell, held, beside)
    free, candidates = _candidates(ink, cell, plan.ink)
    if not candidates.any():
        return cell
    more = _attached(center, corner, area, whole, ink, candidates, cell, free, plan, step)
    fresh = more != cell
    if gone == 0 and not fresh.any():
        return cell
    touch(fresh, center, corner, area, whole, more, seen_as(more, plan.ink.shape[0]), plan, step, beside)
    return _without(more, held_in(center, corner, area, whole, more, white, beside, plan, step), beside)[0]


@compiled
def _without(cell, held, beside):  # type: ignore[no-untyped-def]
    """The numbers of the cells without those that are not ``held``, which no cell is ``beside`` any more (in place);
    and how many these are."""
    out, gone = cell.copy(), np.flatnonzero((cell >= 0) & ~held)
    for i in gone:
        out[i] = -1
        for k in range(6):
            if beside[i, k] >= 0:
                beside[beside[i, k], (k + 3) % 6] = -1
                beside[i, k] = -1
    return out, gone.shape[0]


@compiled
def _candidates(ink, cell, ink_of):  # type: ignore[no-untyped-def]
    """(U,) bool the free places of the layout, and (N,) bool the cells without a number whose ink some of them hold."""
    free = np.ones(ink_of.shape[0], np.bool_)
    for i in range(cell.shape[0]):
        if cell[i] >= 0:
            free[cell[i]] = False
    wanted = np.zeros(256, np.bool_)
    for u in range(ink_of.shape[0]):
        if free[u]:
            wanted[ink_of[u]] = True
    candidates = np.zeros(cell.shape[0], np.bool_)
    for i in range(cell.shape[0]):
        candidates[i] = cell[i] < 0 and wanted[ink[i]]
    return free, candidates


@compiled
def _attached(center, corner, area, whole, ink, candidates, cell, free, plan, step):  # type: ignore[no-untyped-def]
    """The numbers of the cells with those of the candidates, round by round outward from the numbered ones; what is
    ``free`` is so no more."""
    cell = cell.copy()
    loose = np.flatnonzero(candidates)
    shaped = np.flatnonzero(candidates & whole & np.isfinite(corner[:, 0, 0]))
    claim = np.full(loose.shape[0], -1, np.int32)  # the place of the layout that a loose cell would take
    gap = np.full(loose.shape[0], np.inf)  # how far it is from the next numbered one, in cells
    # the squared distance of its farthest witness: a nearer one changes it
    reach2 = np.full(loose.shape[0], np.inf)
    fresh = np.flatnonzero((cell >= 0) & whole)
    turn, maps = np.full(cell.shape[0], UNTURNED, np.int64), np.empty((cell.shape[0], 2, 2))
    slope = slopes(center, cell, seen_as(cell, plan.ink.shape[0]), plan.center_mm, plan.beside)
    claims = np.zeros(free.shape[0], np.int32)
    index, square, rows = np.empty(WITNESSES, np.int32), np.empty(WITNESSES), np.zeros((WITNESSES, PRODUCTS))
    room = _room()
    for _ in range(ROUNDS):
        touched = spread(center, corner, area, ink, shaped, cell, free, turn, maps, slope, fresh, plan, step)
        fresh = np.concatenate((fresh, touched))
        known = np.flatnonzero((cell >= 0) & whole)
        if known.shape[0] < MIN_WITNESSES or np.all(cell[loose] >= 0):
            break
        xy, places = center[known], np.flatnonzero(free)
        grid = bucketed(xy)
        claims[:] = 0
        for n in range(loose.shape[0]):
            i = loose[n]
            if cell[i] >= 0:
                claim[n] = -1
                continue
            if claim[n] >= 0 and not free[claim[n]]:
                claim[n] = -1
            if _touched(center, i, fresh, reach2[n]):
                count = nearest(xy, grid, center[i, 0], center[i, 1], index, square)
                reach2[n] = square[count - 1] if count == WITNESSES else np.inf
                claim[n], gap[n] = -1, np.sqrt(square[0]) / edge_of(area[known[index[0]]])
                # far beyond reach, whatever the map
                if gap[n] < 2.0 * REACH:
                    x, y, size = _predicted(center, i, known, index[:count], square, cell, plan, rows, room)
                    claim[n] = _nearest_of(places, x, y, MAX_MISFIT * size, ink[i], plan)
            if claim[n] >= 0:
                claims[claim[n]] += 1
        fresh = _numbered(loose, claim, gap, claims, cell, free)
        if fresh.shape[0] == 0:
            break
        fresh = fresh[whole[fresh]]
        for i in fresh:
            count = nearest(xy, grid, center[i, 0], center[i, 1], index, square)
            turn[i] = _turn_near(center, corner, i, known, index[:count], cell, turn, maps, slope, plan, step)
    return cell


@compiled
def _room():  # type: ignore[no-untyped-def]
    """What ``_robust`` needs for its numbers: weights, squares and ranks of the witnesses, a system and its sums."""
    of_witnesses = np.empty(WITNESSES), np.empty(WITNESSES), np.empty(WITNESSES, np.int64)
    return *of_witnesses, np.empty((TERMS, TERMS)), np.empty((3, TERMS)), np.empty(PRODUCTS)


@compiled
def _turn_near(center, corner, i, known, near, cell, turn, maps, slope, plan, step):  # type: ignore[no-untyped-def]
    """From which corner cell i is counted, by the nearest of the known cells that is counted from any; -1 unknown."""
    for k in near:
        j = known[k]
        if turn[j] == UNTURNED:
            turn[j] = turn_like(center, corner, j, plan.arms_mm, cell[j], step, slope[j], maps[j])
        if turn[j] >= 0:
            return turn_like(center, corner, i, plan.arms_mm, cell[i], step, maps[j], maps[i])
    return -1


@compiled
def _touched(center_px, i, fresh, reach2):  # type: ignore[no-untyped-def]
    """Whether one of the fresh cells lies within reach of cell i."""
    for j in fresh:
        if (center_px[j, 0] - center_px[i, 0]) ** 2 + (center_px[j, 1] - center_px[i, 1]) ** 2 < reach2:
            return True
    return False


@compiled
def _numbered(loose, claim, gap, claims, cell, free):  # type: ignore[no-untyped-def]
    """Number the nearest of the loose cells that alone claim a place, in place; the cells that were."""
    limit = np.inf
    for n in range(loose.shape[0]):
        if claim[n] >= 0 and claims[claim[n]] == 1:
            limit = min(limit, gap[n])
    limit = max(NEAR, FARTHER * limit)
    fresh, count = np.empty(loose.shape[0], np.int64), 0
    for n in range(loose.shape[0]):
        if claim[n] >= 0 and claims[claim[n]] == 1 and gap[n] <= limit:
            cell[loose[n]] = claim[n]
            free[claim[n]] = False
            fresh[count] = loose[n]
            count += 1
    return fresh[:count]


@compiled
def _nearest_of(places, x, y, limit, ink, plan):  # type: ignore[no-untyped-def]
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


@compiled
def _predicted(center, i, known, near, square, cell, plan, rows, room):  # type: ignore[no-untyped-def]
    """Where cell i lies in the layout by its witnesses (the nearest first), NaN where that is doubtful, and the size of
    a cell there, mm.

    In units of the witnesses' mean distance, with the cell at the origin, so that the map's first term is the place.
    ``rows`` and ``room`` are buffers.
    """
    count = near.shape[0]
    scale, size, middle_x, middle_y = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        u = cell[known[near[k]]]
        scale += np.sqrt(square[k]) / count
        size += plan.size_mm[u] / count
        middle_x += plan.center_mm[u, 0] / count
        middle_y += plan.center_mm[u, 1] / count
    for k in range(count):
        j = known[near[k]]
        x, y, u = (center[j, 0] - center[i, 0]) / scale, (center[j, 1] - center[i, 1]) / scale, cell[j]
        _lay(rows[k], x, y, plan.center_mm[u, 0] - middle_x, plan.center_mm[u, 1] - middle_y)
        rows[k, CLOSENESS] = 1.0 / (0.3 + square[k] / scale**2)
    rows[count:, CLOSENESS] = 0.0
    terms, variance, leverage = _robust(rows, count, (EXACT * size) ** 2, room)
    slope = np.sqrt(abs(terms[0, 1] * terms[1, 2] - terms[0, 2] * terms[1, 1])) / scale
    sure = (
        np.sqrt(square[0]) * slope < REACH * size and np.sqrt(variance * (1.0 + leverage)) < MAX_SIGMA * size
    )
    if not sure:
        return np.nan, np.nan, size
    return middle_x + terms[0, 0], middle_y + terms[1, 0], size


@compiled
def _lay(row, x, y, u, v):  # type: ignore[no-untyped-def]
    """Write the products of a witness's terms with each other and with its place (u, v)."""
    row[0], row[1], row[2], row[3], row[4], row[5] = 1.0, x, y, x * x, x * y, y * y
    row[6], row[7], row[8], row[9] = x * row[3], x * row[4], x * row[5], y * row[5]
    row[10], row[11], row[12] = row[3] * row[3], row[3] * row[4], row[3] * row[5]
    row[13], row[14] = row[4] * row[5], row[5] * row[5]
    for a in range(TERMS):
        row[PLACE_X + a], row[PLACE_Y + a] = row[a] * u, row[a] * v


@vectorized
def _sums(rows, weight, out):  # type: ignore[no-untyped-def]
    """Write the weighted sums of the witnesses' products, four witnesses at once."""
    for m in range(PRODUCTS):
        out[m] = 0.0
    for k in range(0, WITNESSES, 4):
        a, b, c, d = weight[k], weight[k + 1], weight[k + 2], weight[k + 3]
        for m in range(PRODUCTS):
            out[m] += a * rows[k, m] + b * rows[k + 1, m] + c * rows[k + 2, m] + d * rows[k + 3, m]


@compiled
def _median(values, rank):  # type: ignore[no-untyped-def]
    """The median of a few numbers; ``rank`` is a buffer."""
    count = values.shape[0]
    rank[:count] = 0
    for j in range(count):
        own = values[j]
        for i in range(count):
            rank[i] += (own < values[i]) | ((own == values[i]) & (j < i))
    low, high = 0.0, 0.0
    for i in range(count):
        low = values[i] if rank[i] == (count - 1) // 2 else low
        high = values[i] if rank[i] == count // 2 else high
    return 0.5 * (low + high)


@compiled
def _robust(rows, count, exact2, room):  # type: ignore[no-untyped-def]
    """(2, 6) the map's terms by robust least squares, the variance about it, and the leverage at the origin; infinite
    where the witnesses lie in a row. ``room`` is for what is computed on the way."""
    weight, squares, rank, normal, right, sums = room
    for k in range(WITNESSES):
        weight[k] = rows[k, CLOSENESS]
    for number in range(ROBUST_ROUNDS):
        _sums(rows, weight, sums)
        largest = 0.0
        for a in range(TERMS):
            for b in range(a + 1):
                normal[a, b] = sums[PRODUCT[a, b]]
            normal[a, a] += RIDGE if a >= 3 else 0.0
            largest = max(largest, normal[a, a])
            right[0, a], right[1, a] = sums[PLACE_X + a], sums[PLACE_Y + a]
            right[2, a] = 1.0 if a == 0 else 0.0
        cholesky_solve(normal, right if number == ROBUST_ROUNDS - 1 else right[:2], TERMS)
        for a in range(TERMS):
            if not normal[a, a] ** 2 > MIN_PIVOT * largest:
                return right[:2], np.inf, np.inf
        for k in range(count):
            u, v = -rows[k, PLACE_X], -rows[k, PLACE_Y]
            for a in range(TERMS):
                u += rows[k, a] * right[0, a]
                v += rows[k, a] * right[1, a]
            squares[k] = u * u + v * v
        usual, total, about = 2.0 * _median(squares[:count], rank) + exact2, 0.0, 0.0
        leverage = right[2, 0] * sums[0] / count
        for k in range(count):
            weight[k] = rows[k, CLOSENESS] / (1.0 + squares[k] / usual)
            total += weight[k]
            about += weight[k] * squares[k]
    return right[:2], about / (2.0 * total), leverage
