"""Numbers detached cells, behind a scratch or amid missing cells, by contact or by prediction and color."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from extractor.cells.cell_mesh import without_swelling
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.quadratic_map import SUPPORT_CELLS
from extractor.numbering.gaps.cell_claims import (
    SupportCells,
    empty_assignments,
    update_assignments,
    update_outdated_assignments,
)
from extractor.numbering.gaps.corner_contact import (
    begin_numbering,
    corner_neighbours,
    fill_map_by_similarity,
    update_corner_neighbours,
    update_first_corner,
    update_numbers_by_contact,
)
from extractor.numbering.gaps.gap_check import consistent_cells, is_white_cell_contradicted
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.compilation import compiled
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points
from extractor.result import Origin, Reason

MAX_ROUNDS = 40
MIN_NUMBERED_CELLS = 8  # intact ones, for any prediction


def number_detached_cells(cells: Cells, numbering: Numbering, lattice: Lattice, swelling: float) -> Numbering:
    """Number the cells that no face of the mesh connects with the reference cell.

    Cells that share a corner with a numbered cell are its neighbours. Other cells are predicted from the numbered cells
    around them: the prediction must be certain and near a free cell of the layout with the same ink, and no other cell
    may be assigned there. The nearest cells come first. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 is
    unambiguous. Cells inconsistent across the gap, or across damaged cells that connected the mesh, lose their number.
    If the white cell touches no cell that was numbered by it, the cells around it must agree in the end; otherwise the
    numbering is ambiguous. Cells larger than those that just meet, by the factor ``swelling``, are taken at that size.
    """
    if np.count_nonzero(numbering.cell >= 0) == len(lattice.ink):
        return numbering
    corner_step, white_px = 1 if numbering.mirrored else 2, numbering.white_px
    corner = without_swelling(cells.center_px, cells.corner_px, swelling)
    arrays = cells.arrays._replace(corner_px=corner)
    cell = _number_detached(arrays, numbering.cell, white_px, lattice.layout_cells, corner_step)
    if numbering.origin is not Origin.WHITE or numbering.white_adjacent:
        return replace(numbering, cell=cell)
    white_mm = lattice.white_cell_frame[0]
    is_ambiguous = is_white_cell_contradicted(
        cells.center_px, cells.is_intact, cell, white_px, white_mm, lattice.layout_cells
    )
    return replace(numbering, cell=cell, doubt=Reason.AMBIGUOUS if is_ambiguous else None)


@compiled
def _number_detached(cells, cell, white_px, layout, corner_step):  # type: ignore[no-untyped-def]
    """(N,) int32, ``cell`` with the numbers of detached cells added and inconsistent numbers removed."""
    neighbours = corner_neighbours(cells, cell, layout, corner_step)
    consistent = consistent_cells(cells, cell, white_px, neighbours, layout, corner_step)
    cell, removed = _remove_inconsistent(cell, consistent)
    _update_removed_neighbours(removed, neighbours)
    free, candidates = _free_places_and_candidates(cells.ink, cell, layout.ink)
    if not candidates.any():
        return cell
    extended = _number_outward(cells, candidates, cell, free, layout, corner_step)
    is_new = extended != cell
    if removed.shape[0] == 0 and not is_new.any():
        return cell
    update_corner_neighbours(is_new, cells, extended, layout, corner_step, neighbours)
    consistent = consistent_cells(cells, extended, white_px, neighbours, layout, corner_step)
    return _remove_inconsistent(extended, consistent)[0]


@compiled
def _remove_inconsistent(cell, consistent):  # type: ignore[no-untyped-def]
    """(N,) int32, the numbers of the consistent cells only, and the cells that lost theirs."""
    out, removed = cell.copy(), np.flatnonzero((cell >= 0) & ~consistent)
    for i in removed:
        out[i] = -1
    return out, removed


@compiled
def _update_removed_neighbours(removed, neighbours):  # type: ignore[no-untyped-def]
    """Erase the removed cells from the ``corner_neighbours`` (N, 6)."""
    for i in removed:
        for k in range(6):
            if neighbours[i, k] >= 0:
                neighbours[neighbours[i, k], (k + 3) % 6] = -1
                neighbours[i, k] = -1


@compiled
def _free_places_and_candidates(ink, cell, layout_ink):  # type: ignore[no-untyped-def]
    """(U,) bool the free cells of the layout, and (N,) bool the cells without a number that have the ink of one."""
    free = np.ones(layout_ink.shape[0], np.bool_)
    for i in range(cell.shape[0]):
        if cell[i] >= 0:
            free[cell[i]] = False
    is_free_ink = np.zeros(256, np.bool_)
    for u in range(layout_ink.shape[0]):
        if free[u]:
            is_free_ink[layout_ink[u]] = True
    candidates = np.zeros(cell.shape[0], np.bool_)
    for i in range(cell.shape[0]):
        candidates[i] = cell[i] < 0 and is_free_ink[ink[i]]
    return free, candidates


@compiled
def _number_outward(cells, candidates, cell, free, layout, corner_step):  # type: ignore[no-untyped-def]
    """(N,) int32, ``cell`` with numbers of ``candidates`` (N,) added, round by round outward from the numbered cells.

    ``free`` (U,) bool are the free cells of the layout.
    """
    numbering, is_intact = begin_numbering(cell, free), cells.is_intact
    unnumbered = np.flatnonzero(candidates)
    triangles = np.flatnonzero(candidates & is_intact & np.isfinite(cells.corner_px[:, 0, 0]))
    new_cells = np.flatnonzero((cell >= 0) & is_intact)
    assignments = empty_assignments(unnumbered, free.shape[0])
    index, square = np.empty(SUPPORT_CELLS, np.int32), np.empty(SUPPORT_CELLS)
    for _ in range(MAX_ROUNDS):
        touched = update_numbers_by_contact(cells, layout, corner_step, triangles, new_cells, numbering)
        new_cells = np.concatenate((new_cells, touched))
        known = np.flatnonzero((numbering.cell >= 0) & is_intact)
        if known.shape[0] < MIN_NUMBERED_CELLS or np.all(numbering.cell[unnumbered] >= 0):
            break
        support = SupportCells(known, bucket_grid(cells.center_px[known]))
        update_outdated_assignments(cells, new_cells, numbering, assignments)
        limit = update_assignments(cells, layout, support, numbering, assignments)
        new_cells = _update_unique_assignments(assignments, limit, numbering)
        if new_cells.shape[0] == 0:
            break
        new_cells = new_cells[is_intact[new_cells]]
        for i in new_cells:
            x, y = cells.center_px[i, 0], cells.center_px[i, 1]
            nearest = known[index[: fill_nearest_points(support.grid, x, y, index, square)]]
            _update_first_corner_by_nearest(cells, i, nearest, layout, corner_step, numbering)
    return numbering.cell


@compiled
def _update_unique_assignments(assignments, limit, numbering):  # type: ignore[no-untyped-def]
    """Number the cells with a unique assignment and a gap up to the limit; returns these cells."""
    candidate = assignments.candidate
    new_cells, count = np.empty(candidate.shape[0], np.int64), 0
    for n in range(candidate.shape[0]):
        place = assignments.place[n]
        if place >= 0 and assignments.candidate_count[place] == 1 and assignments.gap[n] <= limit:
            numbering.cell[candidate[n]] = place
            numbering.free[place] = False
            new_cells[count] = candidate[n]
            count += 1
    return new_cells[:count]


@compiled
def _update_first_corner_by_nearest(cells, i, nearest, layout, corner_step, numbering):  # type: ignore[no-untyped-def]
    """Orient the triangle of cell i like the nearest of the numbered cells that has an orientation; -1 without one."""
    numbering.first_corner[i] = -1
    for j in nearest:
        if update_first_corner(cells, j, layout, corner_step, numbering) >= 0:
            numbering.first_corner[i] = fill_map_by_similarity(
                cells, i, layout, numbering.cell[i], corner_step, numbering.maps[j], numbering.maps[i]
            )
            break
