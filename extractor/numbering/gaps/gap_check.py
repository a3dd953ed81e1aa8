"""Whether what was numbered apart stands where the pattern goes on.

Cells of one ink are 1.7 cells apart. A part of the pattern beyond a scratch, numbered one such step aside, looks right
in itself and is wrong as a whole. So the numbered cells are taken as blocks that hang together by shared corners, and
from the block at the white cell on, the nearest first, each is judged by the ways to what holds already: they must be
as long as the pattern's slopes on both sides say. What does not hold, or hangs in nothing, loses its number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import image_cell_of_layout_cell, linear_maps
from extractor.numbering.gaps.corner_contact import (
    corner_neighbours,
    equilateral_edge,
    fill_map_by_similarity,
)
from extractor.numbering.mesh_parts import connected_components
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points

# in cells, the median between a block's ways by the numbers and by the slopes; a wrong step makes 1.7
MAX_MEDIAN_JUMP = 0.6
MAX_JUMP_SHARE = 0.25  # of a block's ways that may be longer
MAX_SINGLE_JUMP = 0.9  # the same for a cell that is not whole, whose center may lie aside
MAX_GAP = 5.0  # how far apart the two sides may be, in cells
MAX_GAP_RATIO = 1.5  # a block's ways that tell are at most so much longer than its shortest
COMPARED_CELLS = 3  # cells on the near side that each beyond is compared with
WHITE_CELL_NEIGHBOURS = 5  # cells nearest to the white one that say where it must be, of which so many are
MIN_WHITE_CELL_NEIGHBOURS = 3
MAX_WHITE_CELL_MISFIT = 1.0  # in cells, the median between that and where it is; a wrong step makes 1.7
REFERENCE_CANDIDATES = 3  # cells nearest to the white one, of which the largest block holds the reference


def inconsistent_cells(
    cells: Cells,
    cell: NDArray[np.int32],
    lattice: Lattice,
    mirrored: bool,
    white_px: NDArray[np.float64] | None,
) -> NDArray[np.bool_]:
    """(N,) bool, the numbered cells that do not stand where the pattern goes on from the reference's block.

    Args:
        cell: (N,) the layout's cell of each cell of the image, or -1.
        mirrored: the pattern is seen from its back.
        white_px: the middle of the white cell; None where the outline told, and the largest block is right.
    """
    seen = cells.center_px, cells.corner_px, cells.area_px, cells.whole
    white = np.full(2, np.nan) if white_px is None else white_px
    plan, step = lattice.layout_cells, 1 if mirrored else 2
    beside = corner_neighbours(*seen, cell, image_cell_of_layout_cell(cell, len(plan.ink)), plan, step)
    held = consistent_cells(*seen, cell, white, beside, plan, step)
    return np.asarray((cell >= 0) & ~held)


@compiled
def consistent_cells(center, corner, area, whole, cell, white, beside, plan, step):  # type: ignore[no-untyped-def]
    """(N,) bool, the numbered cells that hold on to the reference's block; ``white`` is NaN where the outline told, and
    ``beside`` the cells that touch, as ``corner_neighbours`` gives it."""
    block = connected_components(beside, whole & (cell >= 0))
    sizes = np.zeros(block.max() + 1 if block.shape[0] > 0 else 0, np.int64)
    for i in range(block.shape[0]):
        if block[i] >= 0:
            sizes[block[i]] += 1
    if sizes.shape[0] == 0:
        return np.zeros(cell.shape[0], np.bool_)
    first = sizes.argmax() if np.isnan(white[0]) else _reference_block(center, block, sizes, white)
    return _consistent_with_block(center, corner, area, cell, block, first, beside, plan, step)


@compiled
def is_white_cell_contradicted(center, whole, cell, white, white_mm, plan):  # type: ignore[no-untyped-def]
    """Whether the numbered cells nearest to the white one put that elsewhere in the image, by the layout's slopes
    there; not where no such cell is within reach.

    A part of the pattern that does not touch the white cell may be numbered by it one step aside; what lies around the
    white cell was numbered by that part then, and tells.
    """
    known = np.flatnonzero((cell >= 0) & whole)
    if known.shape[0] < MIN_WHITE_CELL_NEIGHBOURS:
        return False
    seen, xy = image_cell_of_layout_cell(cell, plan.ink.shape[0]), center[known]
    slope = linear_maps(center, cell, seen, plan.center_mm, plan.cell_neighbours)
    index, square = np.empty(WHITE_CELL_NEIGHBOURS, np.int32), np.empty(WHITE_CELL_NEIGHBOURS)
    aside, told = np.empty(WHITE_CELL_NEIGHBOURS), 0
    for k in range(fill_nearest_points(xy, bucket_grid(xy), white[0], white[1], index, square)):
        i = known[index[k]]
        a, b, c, d = slope[i, 0, 0], slope[i, 0, 1], slope[i, 1, 0], slope[i, 1, 1]
        size = plan.size_mm[cell[i]] * np.sqrt(abs(a * d - b * c))
        if square[k] < (MAX_GAP * size) ** 2:
            x, y = white_mm[0] - plan.center_mm[cell[i], 0], white_mm[1] - plan.center_mm[cell[i], 1]
            dx, dy = center[i, 0] + a * x + b * y - white[0], center[i, 1] + c * x + d * y - white[1]
            aside[told] = np.sqrt(dx * dx + dy * dy) / size
            told += 1
    return told >= MIN_WHITE_CELL_NEIGHBOURS and np.median(aside[:told]) > MAX_WHITE_CELL_MISFIT


@compiled
def _reference_block(center, block, sizes, white):  # type: ignore[no-untyped-def]
    """The largest block of those of the cells nearest to the white one."""
    square, near, found = np.empty(REFERENCE_CANDIDATES), np.empty(REFERENCE_CANDIDATES, np.int64), 0
    for i in range(block.shape[0]):
        if block[i] < 0:
            continue
        apart = (center[i, 0] - white[0]) ** 2 + (center[i, 1] - white[1]) ** 2
        at = min(found, REFERENCE_CANDIDATES - 1)
        if found == REFERENCE_CANDIDATES and apart >= square[at]:
            continue
        while at > 0 and square[at - 1] > apart:
            square[at], near[at] = square[at - 1], near[at - 1]
            at -= 1
        square[at], near[at] = apart, block[i]
        found = min(found + 1, REFERENCE_CANDIDATES)
    best = near[0]
    for k in range(1, found):
        best = near[k] if sizes[near[k]] > sizes[best] else best
    return best


@inlined_no_refcount
def _fill_slope(i, center, cell, beside, center_mm, out):  # type: ignore[no-untyped-def]
    """Write the image step per layout step around cell i by the cells that touch it; False where they are in a row."""
    xx, xy, yy, count = 0.0, 0.0, 0.0, 0
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    for k in range(6):
        j = beside[i, k]
        if j < 0:
            continue
        x = center_mm[cell[j], 0] - center_mm[cell[i], 0]
        y = center_mm[cell[j], 1] - center_mm[cell[i], 1]
        px, py = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        xx, xy, yy, count = xx + x * x, xy + x * y, yy + y * y, count + 1
        ax, ay, bx, by = ax + px * x, ay + px * y, bx + py * x, by + py * y
    determinant = xx * yy - xy * xy
    if count < 2 or determinant < 0.05 * (xx + yy) ** 2:
        return False
    out[0, 0], out[0, 1] = (ax * yy - ay * xy) / determinant, (ay * xx - ax * xy) / determinant
    out[1, 0], out[1, 1] = (bx * yy - by * xy) / determinant, (by * xx - bx * xy) / determinant
    return True


@compiled
def _consistent_with_block(center, corner, area, cell, block, first, beside, plan, step):  # type: ignore[no-untyped-def]
    """(N,) bool, the cells of the first block and of those that hold on to it, and the single ones between."""
    count, blocks = cell.shape[0], block.max() + 1
    held, alone = block == first, np.flatnonzero((cell >= 0) & (block < 0))
    if blocks == 1 and alone.shape[0] == 0:
        return held
    slope, sloped = np.full((count, 2, 2), np.nan), np.zeros(count, np.bool_)
    for i in range(count):
        if block[i] >= 0:
            sloped[i] = _fill_slope(i, center, cell, beside, plan.center_mm, slope[i])
    if blocks > 1:
        _update_consistent_blocks(center, corner, area, cell, block, held, slope, sloped, plan, step)
    if alone.shape[0] > 0:
        _update_consistent_singles(center, corner, area, cell, alone, held, slope, sloped, plan, step)
    return held


@compiled
def _update_consistent_blocks(center, corner, area, cell, block, held, slope, sloped, plan, step):  # type: ignore[no-untyped-def]
    """Let the blocks that hold on be held, in place, the nearest first."""
    count, blocks = cell.shape[0], block.max() + 1
    index, square = np.empty(COMPARED_CELLS, np.int32), np.empty(COMPARED_CELLS)
    one, apart = np.empty(1, np.int32), np.empty(1)
    jump, gap = np.empty(count), np.empty(count)
    least, refused = np.empty(blocks), np.zeros(blocks, np.bool_)
    while True:
        waiting = np.flatnonzero((block >= 0) & ~held & ~refused[block])
        here = np.flatnonzero(held & sloped)
        if waiting.shape[0] == 0 or here.shape[0] < COMPARED_CELLS:
            break
        xy = center[here]
        grid = bucket_grid(xy)
        least[:] = np.inf
        for j in waiting:
            fill_nearest_points(xy, grid, center[j, 0], center[j, 1], one, apart)
            gap[j] = np.sqrt(apart[0]) / equilateral_edge(area[here[one[0]]])
            least[block[j]] = min(least[block[j]], gap[j])
        nearest_of_all = least.min()
        if not nearest_of_all < MAX_GAP:
            break
        for b in range(blocks):
            if least[b] > MAX_GAP_RATIO * nearest_of_all:
                continue
            telling, wide = 0, 0
            for j in waiting:
                if block[j] != b or gap[j] > MAX_GAP_RATIO * least[b]:
                    continue
                fill_nearest_points(xy, grid, center[j, 0], center[j, 1], index, square)
                own = _update_slope_and_measure_jump(
                    j, here, index, center, corner, cell, slope, sloped, plan, step
                )
                if np.isfinite(own):
                    jump[telling] = own
                    wide += own > MAX_MEDIAN_JUMP
                    telling += 1
            if (
                telling > 0
                and np.median(jump[:telling]) < MAX_MEDIAN_JUMP
                and wide <= MAX_JUMP_SHARE * telling
            ):
                held |= block == b
            else:
                refused[b] = True


@compiled
def _update_consistent_singles(center, corner, area, cell, alone, held, slope, sloped, plan, step):  # type: ignore[no-untyped-def]
    """Let the single cells that hold on be held, in place."""
    here = np.flatnonzero(held & sloped)
    if here.shape[0] < COMPARED_CELLS:
        return
    index, square = np.empty(COMPARED_CELLS, np.int32), np.empty(COMPARED_CELLS)
    xy = center[here]
    grid = bucket_grid(xy)
    for j in alone:
        fill_nearest_points(xy, grid, center[j, 0], center[j, 1], index, square)
        own = _update_slope_and_measure_jump(j, here, index, center, corner, cell, slope, sloped, plan, step)
        held[j] = own < MAX_SINGLE_JUMP and np.sqrt(square[0]) < MAX_GAP * equilateral_edge(
            area[here[index[0]]]
        )


@inlined_no_refcount
def _update_slope_and_measure_jump(j, here, near, center, corner, cell, slope, sloped, plan, step):  # type: ignore[no-untyped-def]
    """How far, in cells, cell j is from where its number puts it, by the slopes there and at those ``here`` near it;
    the median over these. A cell without a slope has that of its triangle, or else of the others, and keeps it."""
    if not sloped[j]:
        like = slope[here[near[0]]]
        if (
            fill_map_by_similarity(center, corner, j, plan.corner_vectors_mm, cell[j], step, like, slope[j])
            < 0
        ):
            slope[j, 0, 0], slope[j, 0, 1] = like[0, 0], like[0, 1]
            slope[j, 1, 0], slope[j, 1, 1] = like[1, 0], like[1, 1]
        sloped[j] = True
    one, two, three = 0.0, 0.0, 0.0
    for k in range(COMPARED_CELLS):
        i = here[near[k]]
        a, b = 0.5 * (slope[i, 0, 0] + slope[j, 0, 0]), 0.5 * (slope[i, 0, 1] + slope[j, 0, 1])
        c, d = 0.5 * (slope[i, 1, 0] + slope[j, 1, 0]), 0.5 * (slope[i, 1, 1] + slope[j, 1, 1])
        determinant = a * d - b * c
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        dx = (d * x - b * y) / determinant - plan.center_mm[cell[j], 0] + plan.center_mm[cell[i], 0]
        dy = (a * y - c * x) / determinant - plan.center_mm[cell[j], 1] + plan.center_mm[cell[i], 1]
        one, two, three = two, three, np.hypot(dx, dy) / plan.size_mm[cell[j]]
    return _median_of_three(one, two, three)


@inlined_no_refcount
def _median_of_three(a, b, c):  # type: ignore[no-untyped-def]
    """The median of three numbers (``COMPARED_CELLS``); NaN if any is none."""
    if np.isnan(a) or np.isnan(b) or np.isnan(c):
        return np.nan
    return max(min(a, b), min(max(a, b), c))
