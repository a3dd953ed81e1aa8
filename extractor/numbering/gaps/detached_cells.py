"""Cells that stand apart (behind a scratch, amid missing ones) are numbered by prediction and color, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import seen_as
from extractor.localmap.quadratic_map import WITNESSES
from extractor.numbering.gaps.cell_claims import claim, forget, no_claims
from extractor.numbering.gaps.corner_contact import UNTURNED, spread, touch, touching, turn_beside, turn_like
from extractor.numbering.gaps.gap_check import held_in, leads_elsewhere
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.compilation import compiled
from extractor.numeric.nearest_points import bucketed, nearest
from extractor.result import Origin

ROUNDS = 40
MIN_WITNESSES = 8


def attach(cells: Cells, numbering: Numbering, lattice: Lattice) -> Numbering:
    """Number what is not connected with the reference by any face of the mesh.

    Cells that share a corner with a numbered one are its neighbours. For the others, the numbered cells around must map
    the cell near a free place of the layout that holds its ink, with little doubt, and no other cell may claim it; the
    nearest come first. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 leaves no choice. What does not fit
    across the gap, or across damaged cells by which the mesh hung together, loses its number. Where the white cell
    touches nothing that it numbered, the cells around it must agree in the end, else all is ambiguous.
    """
    if np.count_nonzero(numbering.cell >= 0) == len(lattice.ink):
        return numbering
    seen = cells.center_px, cells.corner_px, cells.area_px, cells.whole
    step = 1 if numbering.mirrored else 2
    cell = _attach(seen, cells.ink, numbering.cell, numbering.white_px, lattice.plan, step)
    if numbering.origin is not Origin.WHITE or numbering.touching:
        return replace(numbering, cell=cell)
    about = numbering.white_px, lattice.white_place[0], lattice.plan
    return replace(numbering, cell=cell, ambiguous=bool(leads_elsewhere(seen[0], cells.whole, cell, *about)))


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
    fresh = np.flatnonzero((cell >= 0) & whole)
    turn, maps = np.full(cell.shape[0], UNTURNED, np.int64), np.empty((cell.shape[0], 2, 2))
    seen = seen_as(cell, plan.ink.shape[0])
    claims = no_claims(loose.shape[0], free.shape[0])
    index, square = np.empty(WITNESSES, np.int32), np.empty(WITNESSES)
    for _ in range(ROUNDS):
        touched = spread(center, corner, area, ink, shaped, cell, free, turn, maps, seen, fresh, plan, step)
        fresh = np.concatenate((fresh, touched))
        known = np.flatnonzero((cell >= 0) & whole)
        if known.shape[0] < MIN_WITNESSES or np.all(cell[loose] >= 0):
            break
        xy = center[known]
        grid = bucketed(xy)
        forget(center, loose, fresh, cell, free, claims)
        limit = claim(center, area, ink, loose, known, xy, grid, cell, free, plan, claims)
        fresh = _numbered(loose, claims, limit, cell, free)
        if fresh.shape[0] == 0:
            break
        fresh = fresh[whole[fresh]]
        for i in fresh:
            count = nearest(xy, grid, center[i, 0], center[i, 1], index, square)
            turn[i] = _turn_near(center, corner, i, known, index[:count], cell, turn, maps, seen, plan, step)
    return cell


@compiled
def _numbered(loose, claims, limit, cell, free):  # type: ignore[no-untyped-def]
    """Number the loose cells that alone claim a place, up to this gap, in place; the cells that were."""
    fresh, count = np.empty(loose.shape[0], np.int64), 0
    for n in range(loose.shape[0]):
        place = claims.place[n]
        if place >= 0 and claims.takers[place] == 1 and claims.gap[n] <= limit:
            cell[loose[n]] = place
            free[place] = False
            fresh[count] = loose[n]
            count += 1
    return fresh[:count]


@compiled
def _turn_near(center, corner, i, known, near, cell, turn, maps, seen, plan, step):  # type: ignore[no-untyped-def]
    """From which corner cell i is counted, by the nearest of the known cells that is counted from any; -1 unknown."""
    for k in near:
        j = known[k]
        if turn[j] == UNTURNED:
            turn[j] = turn_beside(center, corner, j, cell[j], seen, plan, step, maps[j])
        if turn[j] >= 0:
            return turn_like(center, corner, i, plan.arms_mm, cell[i], step, maps[j], maps[i])
    return -1
