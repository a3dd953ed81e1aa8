"""Cells that stand apart (behind a scratch, amid missing ones) are numbered by prediction and color, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .algebra import cholesky_solve
from .bridge import unbridged
from .cells import Cells
from .engine import compiled
from .gradients import gradients
from .mesh import Mesh
from .near import bucketed, nearest
from .numbering import Numbering
from .tables import Lattice
from .touch import edge_of, spread, turn_like
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


def attach(cells: Cells, mesh: Mesh, numbering: Numbering, lattice: Lattice) -> Numbering:
    """Number what is not connected with the reference by any face of the mesh.

    Cells that share a corner with a numbered one are its neighbours. For the others, the numbered cells around must map
    the cell near a free place of the layout that holds its ink, with little doubt, and no other cell may claim it; the
    nearest come first. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 leaves no choice. What does not fit
    across the gap, or across damaged cells by which the mesh hung together, loses its number.
    """
    if np.count_nonzero(numbering.cell >= 0) == len(lattice.ink):
        return numbering
    by_white = numbering.white_px if numbering.origin is Origin.WHITE else None
    cell = numbering.cell.copy()
    cell[unbridged(cells, cell, lattice, numbering.mirrored, by_white)] = -1
    free, candidates = _candidates(cells.ink, cell, lattice.ink)
    if candidates.any():
        slope = gradients(cells.center_px, cell, lattice)
        seen = cells.center_px, cells.corner_px, cells.ink, cells.area_px
        layout = lattice.center_mm, lattice.ink, lattice.size_mm, lattice.arms_mm, lattice.beside
        step = 1 if numbering.mirrored else 2
        cell = _attached(*seen, cells.whole, slope, candidates, cell, free, layout, step)
        cell[unbridged(cells, cell, lattice, numbering.mirrored, by_white)] = -1
    return replace(numbering, cell=cell)


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
def _attached(center_px, corner_px, ink, area_px, whole, slope, candidates, cell, free, layout, step):  # type: ignore[no-untyped-def]
    """The numbers of the cells with those of the candidates, round by round outward from the numbered ones."""
    center_mm, ink_of, size_mm, arms_mm, beside = layout
    cell, free = cell.copy(), free.copy()
    loose = np.flatnonzero(candidates)
    shaped = np.flatnonzero(candidates & whole & np.isfinite(corner_px[:, 0, 0]))
    claim = np.full(loose.shape[0], -1, np.int32)  # the place of the layout that a loose cell would take
    gap = np.full(loose.shape[0], np.inf)  # how far it is from the next numbered one, in cells
    # the squared distance of its farthest witness: a nearer one changes it
    reach2 = np.full(loose.shape[0], np.inf)
    fresh = np.flatnonzero((cell >= 0) & whole)
    turn, maps = np.full(cell.shape[0], -1, np.int64), np.full((cell.shape[0], 2, 2), np.nan)
    for i in fresh:
        turn[i] = turn_like(center_px[i], corner_px[i], arms_mm[cell[i]], step, slope[i], maps[i])
    claims = np.zeros(free.shape[0], np.int32)
    index, square = np.empty(WITNESSES, np.int32), np.empty(WITNESSES)
    for _ in range(ROUNDS):
        touched = spread(
            center_px,
            corner_px,
            area_px,
            ink,
            shaped,
            cell,
            free,
            turn,
            maps,
            fresh,
            (center_mm, ink_of, arms_mm, beside),
            step,
        )
        fresh = np.concatenate((fresh, touched))
        known = np.flatnonzero((cell >= 0) & whole)
        if known.shape[0] < MIN_WITNESSES:
            break
        xy = center_px[known]
        grid = bucketed(xy)
        claims[:] = 0
        for n in range(loose.shape[0]):
            i = loose[n]
            if cell[i] >= 0:
                claim[n] = -1
                continue
            if claim[n] >= 0 and not free[claim[n]]:
                claim[n] = -1
            if _touched(center_px, i, fresh, reach2[n]):
                count = nearest(xy, grid, center_px[i, 0], center_px[i, 1], index, square)
                reach2[n] = square[count - 1] if count == WITNESSES else np.inf
                near = known[index[:count]]
                claim[n], gap[n] = -1, np.sqrt(square[0]) / edge_of(area_px[near[0]])
                # far beyond reach, whatever the map
                if gap[n] < 2.0 * REACH:
                    x, y, size = _predicted(center_px, i, near, square, cell, center_mm, size_mm)
                    claim[n] = _nearest_free(x, y, MAX_MISFIT * size, ink[i], center_mm, ink_of, free)
            if claim[n] >= 0:
                claims[claim[n]] += 1
        fresh = _numbered(loose, claim, gap, claims, cell, free)
        if fresh.shape[0] == 0:
            break
        fresh = fresh[whole[fresh]]
        for i in fresh:
            count = nearest(xy, grid, center_px[i, 0], center_px[i, 1], index, square)
            for k in range(count):
                j = known[index[k]]
                if turn[j] >= 0:
                    turn[i] = turn_like(center_px[i], corner_px[i], arms_mm[cell[i]], step, maps[j], maps[i])
                    break
    return cell


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
def _nearest_free(x, y, limit, ink, center_mm, ink_of, free):  # type: ignore[no-untyped-def]
    """The free place of the layout that holds this ink within the limit of (x, y), or -1."""
    best, least = -1, limit * limit
    for u in range(free.shape[0]):
        if free[u] and ink_of[u] == ink:
            apart = (center_mm[u, 0] - x) ** 2 + (center_mm[u, 1] - y) ** 2
            if apart < least:
                best, least = u, apart
    return best


@compiled
def _predicted(center_px, i, near, square, cell, center_mm, size_mm):  # type: ignore[no-untyped-def]
    """Where cell i lies in the layout by its witnesses (the nearest first), NaN where that is doubtful, and the size of
    a cell there, mm.

    In units of the witnesses' mean distance, with the cell at the origin, so that the map's first term is the place.
    """
    count = near.shape[0]
    scale, size, middle_x, middle_y = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        u = cell[near[k]]
        scale += np.sqrt(square[k]) / count
        size += size_mm[u] / count
        middle_x += center_mm[u, 0] / count
        middle_y += center_mm[u, 1] / count
    rows, offset, closeness = np.empty((count, TERMS)), np.empty((count, 2)), np.empty(count)
    for k in range(count):
        j, u = near[k], cell[near[k]]
        x, y = (center_px[j, 0] - center_px[i, 0]) / scale, (center_px[j, 1] - center_px[i, 1]) / scale
        rows[k, 0], rows[k, 1], rows[k, 2] = 1.0, x, y
        rows[k, 3], rows[k, 4], rows[k, 5] = x * x, x * y, y * y
        offset[k, 0], offset[k, 1] = center_mm[u, 0] - middle_x, center_mm[u, 1] - middle_y
        closeness[k] = 1.0 / (0.3 + square[k] / scale**2)
    terms, variance, leverage = _robust(rows, offset, closeness, (EXACT * size) ** 2)
    slope = np.sqrt(abs(terms[0, 1] * terms[1, 2] - terms[0, 2] * terms[1, 1])) / scale
    sure = (
        np.sqrt(square[0]) * slope < REACH * size and np.sqrt(variance * (1.0 + leverage)) < MAX_SIGMA * size
    )
    if not sure:
        return np.nan, np.nan, size
    return middle_x + terms[0, 0], middle_y + terms[1, 0], size


@compiled
def _robust(rows, offset, closeness, exact2):  # type: ignore[no-untyped-def]
    """(2, 6) the map's terms by robust least squares, the variance about it, and the leverage at the origin; infinite
    where the witnesses lie in a row."""
    count = rows.shape[0]
    weight, squares = closeness.copy(), np.zeros(count)
    normal, right = np.empty((TERMS, TERMS)), np.empty((3, TERMS))
    for number in range(ROBUST_ROUNDS):
        normal[:], right[:] = 0.0, 0.0
        right[2, 0] = 1.0
        for k in range(count):
            for a in range(TERMS):
                moment = weight[k] * rows[k, a]
                right[0, a] += moment * offset[k, 0]
                right[1, a] += moment * offset[k, 1]
                for b in range(a + 1):
                    normal[a, b] += moment * rows[k, b]
        for a in range(3, TERMS):
            normal[a, a] += RIDGE
        largest = 0.0
        for a in range(TERMS):
            largest = max(largest, normal[a, a])
        cholesky_solve(normal, right if number == ROBUST_ROUNDS - 1 else right[:2], TERMS)
        for a in range(TERMS):
            if not normal[a, a] ** 2 > MIN_PIVOT * largest:
                return right[:2], np.inf, np.inf
        for k in range(count):
            u, v = -offset[k, 0], -offset[k, 1]
            for a in range(TERMS):
                u += rows[k, a] * right[0, a]
                v += rows[k, a] * right[1, a]
            squares[k] = u * u + v * v
        usual, total, about = 2.0 * np.median(squares) + exact2, 0.0, 0.0
        leverage = right[2, 0] * weight.mean()
        for k in range(count):
            weight[k] = closeness[k] / (1.0 + squares[k] / usual)
            total += weight[k]
            about += weight[k] * squares[k]
    return right[:2], about / (2.0 * total), leverage
