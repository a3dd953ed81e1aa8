"""Cells that stand apart (behind a scratch, amid missing ones) are numbered by prediction and color, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import image_cell_of_layout_cell
from extractor.localmap.quadratic_map import SUPPORT_CELLS
from extractor.numbering.gaps.cell_claims import (
    empty_assignments,
    update_assignments,
    update_outdated_assignments,
)
from extractor.numbering.gaps.corner_contact import (
    TURN_NOT_EVALUATED,
    corner_neighbours,
    fill_map_by_neighbours,
    fill_map_by_similarity,
    update_corner_neighbours,
    update_numbers_by_contact,
)
from extractor.numbering.gaps.gap_check import consistent_cells, is_white_cell_contradicted
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.compilation import compiled
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points
from extractor.result import Origin

MAX_ROUNDS = 40
MIN_NUMBERED_CELLS = 8


def number_detached_cells(cells: Cells, numbering: Numbering, lattice: Lattice) -> Numbering:
    """Number what is not connected with the reference by any face of the mesh.

    Cells that share a corner with a numbered one are its neighbours. For the others, the numbered cells around must map
    the cell near a free place of the layout that holds its ink, with little doubt, and no other cell may claim it; the
    nearest come first. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 leaves no choice. What does not fit
    across the gap, or across damaged cells by which the mesh hung together, loses its number. Where the white cell
    touches nothing that it numbered, the cells around it must agree in the end, else all is ambiguous.
    """
    if np.count_nonzero(numbering.cell >= 0) == len(lattice.ink):
        return numbering
    seen = cells.center_px, cells.corner_px, cells.area_px, cells.is_intact
    step = 1 if numbering.mirrored else 2
    cell = _number_detached(seen, cells.ink, numbering.cell, numbering.white_px, lattice.layout_cells, step)
    if numbering.origin is not Origin.WHITE or numbering.white_adjacent:
        return replace(numbering, cell=cell)
    about = numbering.white_px, lattice.white_cell_frame[0], lattice.layout_cells
    return replace(
        numbering, cell=cell, ambiguous=bool(is_white_cell_contradicted(seen[0], cells.is_intact, cell, *about))
    )


@compiled
def _number_detached(seen, ink, cell, white, plan, step):  # type: ignore[no-untyped-def]
    """The numbers of the cells with those that could be attached, without those that hang in nothing."""
    center, corner, area, whole = seen
    beside = corner_neighbours(
        center, corner, area, whole, cell, image_cell_of_layout_cell(cell, plan.ink.shape[0]), plan, step
    )
    held = consistent_cells(center, corner, area, whole, cell, white, beside, plan, step)
    cell, gone = _update_rejecting_inconsistent(cell, held, beside)
    free, candidates = _free_places_and_candidates(ink, cell, plan.ink)
    if not candidates.any():
        return cell
    more = _update_numbering_outward(center, corner, area, whole, ink, candidates, cell, free, plan, step)
    fresh = more != cell
    if gone == 0 and not fresh.any():
        return cell
    update_corner_neighbours(
        fresh,
        center,
        corner,
        area,
        whole,
        more,
        image_cell_of_layout_cell(more, plan.ink.shape[0]),
        plan,
        step,
        beside,
    )
    return _update_rejecting_inconsistent(
        more, consistent_cells(center, corner, area, whole, more, white, beside, plan, step), beside
    )[0]


@compiled
def _update_rejecting_inconsistent(cell, held, beside):  # type: ignore[no-untyped-def]
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
def _free_places_and_candidates(ink, cell, ink_of):  # type: ignore[no-untyped-def]
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
def _update_numbering_outward(center, corner, area, whole, ink, candidates, cell, free, plan, step):  # type: ignore[no-untyped-def]
    """The numbers of the cells with those of the candidates, round by round outward from the numbered ones; what is
    ``free`` is so no more."""
    cell = cell.copy()
    loose = np.flatnonzero(candidates)
    shaped = np.flatnonzero(candidates & whole & np.isfinite(corner[:, 0, 0]))
    fresh = np.flatnonzero((cell >= 0) & whole)
    turn, maps = np.full(cell.shape[0], TURN_NOT_EVALUATED, np.int64), np.empty((cell.shape[0], 2, 2))
    seen = image_cell_of_layout_cell(cell, plan.ink.shape[0])
    claims = empty_assignments(loose.shape[0], free.shape[0])
    index, square = np.empty(SUPPORT_CELLS, np.int32), np.empty(SUPPORT_CELLS)
    for _ in range(MAX_ROUNDS):
        touched = update_numbers_by_contact(
            center, corner, area, ink, shaped, cell, free, turn, maps, seen, fresh, plan, step
        )
        fresh = np.concatenate((fresh, touched))
        known = np.flatnonzero((cell >= 0) & whole)
        if known.shape[0] < MIN_NUMBERED_CELLS or np.all(cell[loose] >= 0):
            break
        xy = center[known]
        grid = bucket_grid(xy)
        update_outdated_assignments(center, loose, fresh, cell, free, claims)
        limit = update_assignments(center, area, ink, loose, known, xy, grid, cell, free, plan, claims)
        fresh = _update_unique_assignments(loose, claims, limit, cell, free)
        if fresh.shape[0] == 0:
            break
        fresh = fresh[whole[fresh]]
        for i in fresh:
            count = fill_nearest_points(xy, grid, center[i, 0], center[i, 1], index, square)
            turn[i] = _update_turn_by_nearest(
                center, corner, i, known, index[:count], cell, turn, maps, seen, plan, step
            )
    return cell


@compiled
def _update_unique_assignments(loose, claims, limit, cell, free):  # type: ignore[no-untyped-def]
    """Number the loose cells that alone claim a place, up to this gap, in place; the cells that were."""
    fresh, count = np.empty(loose.shape[0], np.int64), 0
    for n in range(loose.shape[0]):
        place = claims.place[n]
        if place >= 0 and claims.candidate_count[place] == 1 and claims.gap[n] <= limit:
            cell[loose[n]] = place
            free[place] = False
            fresh[count] = loose[n]
            count += 1
    return fresh[:count]


@compiled
def _update_turn_by_nearest(center, corner, i, known, near, cell, turn, maps, seen, plan, step):  # type: ignore[no-untyped-def]
    """From which corner cell i is counted, by the nearest of the known cells that is counted from any; -1 unknown."""
    for k in near:
        j = known[k]
        if turn[j] == TURN_NOT_EVALUATED:
            turn[j] = fill_map_by_neighbours(center, corner, j, cell[j], seen, plan, step, maps[j])
        if turn[j] >= 0:
            return fill_map_by_similarity(
                center, corner, i, plan.corner_vectors_mm, cell[i], step, maps[j], maps[i]
            )
    return -1
