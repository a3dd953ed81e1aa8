"""Checks whether detached numbered cells lie where the pattern continues.

Cells of one ink are 1.7 cells apart. A part of the pattern beyond a scratch, numbered one such step aside, is
consistent in itself and wrong as a whole. So the numbered cells are divided into blocks connected by shared corners.
Beginning with the block at the white cell, the nearest blocks first, each block is compared with the consistent cells:
the vectors between their centers must have the lengths that the pattern's slopes on both sides predict. Cells
inconsistent so, or connected with nothing, lose their number. A slope is the local linear map from layout to image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.localmap.affine_maps import image_cell_of_layout_cell, linear_maps
from extractor.numbering.gaps.corner_contact import (
    equilateral_edge,
    fill_map_by_similarity,
)
from extractor.numbering.mesh_parts import connected_components
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points

# A jump is the difference, in cells, between a vector by the numbers and by the slopes; a wrong step makes 1.7.
MAX_MEDIAN_JUMP = 0.6  # the median jump of a block
MAX_JUMP_SHARE = 0.25  # share of a block's jumps that may be larger
MAX_SINGLE_JUMP = 0.9  # of a cell without contacts: its center may be shifted
MAX_GAP = 5.0  # between the two sides, in cells
MAX_GAP_RATIO = 1.5  # vectors of a block not longer than this many times its shortest are compared
COMPARED_CELLS = 3  # consistent cells with which each cell is compared
WHITE_CELL_NEIGHBOURS = 5  # numbered cells nearest to the white cell, which predict its place
MIN_WHITE_CELL_NEIGHBOURS = 3  # least number of them
MAX_WHITE_CELL_MISFIT = 1.0  # in cells, the median distance from the predictions; a wrong step makes 1.7
REFERENCE_CANDIDATES = 3  # cells nearest to the white one, of which the largest block is the reference


class _Consistency(NamedTuple):
    """Which of N numbered cells are consistent; updated in place.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        is_consistent: (N,) bool.
        slope: (N, 2, 2) float64, px per mm, the local linear maps.
        has_slope: (N,) bool.
    """

    cell: NDArray[np.int32]
    is_consistent: NDArray[np.bool_]
    slope: NDArray[np.float64]
    has_slope: NDArray[np.bool_]


@compiled
def consistent_cells(cells, cell, white_px, neighbours, layout, corner_step):  # type: ignore[no-untyped-def]
    """(N,) bool, the numbered cells consistent with the reference block.

    Args:
        cells: ``CellArrays``. layout: ``LayoutCells``.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        white_px: (2,) the center of the white cell; NaN if the outline gave the origin.
        neighbours: (N, 6) int32, by ``corner_neighbours``.
        corner_step: as in ``corner_contact``.
    """
    block = connected_components(neighbours, cells.is_intact & (cell >= 0))
    sizes = np.zeros(block.max() + 1 if block.shape[0] > 0 else 0, np.int64)
    for i in range(block.shape[0]):
        if block[i] >= 0:
            sizes[block[i]] += 1
    if sizes.shape[0] == 0:
        return np.zeros(cell.shape[0], np.bool_)
    reference = (
        sizes.argmax() if np.isnan(white_px[0]) else _reference_block(cells.center_px, block, sizes, white_px)
    )
    return _consistent_with_block(cells, cell, block, reference, neighbours, layout, corner_step)


@compiled
def is_white_cell_contradicted(center, is_intact, cell, white_px, white_mm, layout):  # type: ignore[no-untyped-def]
    """Whether the numbered cells nearest to the white cell predict it elsewhere, by the local slopes.

    A part of the pattern that does not touch the white cell may be numbered one step aside. The cells around the white
    cell were then numbered by that part, and contradict it. False where no such cell is within reach.

    Args:
        center: (N, 2) px; is_intact: (N,) bool, as in ``Cells``.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        white_px, white_mm: (2,) the white cell's center in the image and in the layout.
        layout: ``LayoutCells``.
    """
    known = np.flatnonzero((cell >= 0) & is_intact)
    if known.shape[0] < MIN_WHITE_CELL_NEIGHBOURS:
        return False
    slope = linear_maps(center, cell, image_cell_of_layout_cell(cell, layout.ink.shape[0]), layout)
    index, square = np.empty(WHITE_CELL_NEIGHBOURS, np.int32), np.empty(WHITE_CELL_NEIGHBOURS)
    misfit, count = np.empty(WHITE_CELL_NEIGHBOURS), 0
    for k in range(fill_nearest_points(bucket_grid(center[known]), white_px[0], white_px[1], index, square)):
        i = known[index[k]]
        a, b, c, d = slope[i, 0, 0], slope[i, 0, 1], slope[i, 1, 0], slope[i, 1, 1]
        size = layout.size_mm[cell[i]] * np.sqrt(abs(a * d - b * c))
        if square[k] < (MAX_GAP * size) ** 2:
            x, y = white_mm[0] - layout.center_mm[cell[i], 0], white_mm[1] - layout.center_mm[cell[i], 1]
            dx, dy = center[i, 0] + a * x + b * y - white_px[0], center[i, 1] + c * x + d * y - white_px[1]
            misfit[count] = np.sqrt(dx * dx + dy * dy) / size
            count += 1
    return count >= MIN_WHITE_CELL_NEIGHBOURS and np.median(misfit[:count]) > MAX_WHITE_CELL_MISFIT


@compiled
def _reference_block(center, block, sizes, white_px):  # type: ignore[no-untyped-def]
    """The largest block of those of the cells nearest to the white one."""
    squares, blocks, found = np.empty(REFERENCE_CANDIDATES), np.empty(REFERENCE_CANDIDATES, np.int64), 0
    for i in range(block.shape[0]):
        if block[i] < 0:
            continue
        square = (center[i, 0] - white_px[0]) ** 2 + (center[i, 1] - white_px[1]) ** 2
        at = min(found, REFERENCE_CANDIDATES - 1)
        if found == REFERENCE_CANDIDATES and square >= squares[at]:
            continue
        while at > 0 and squares[at - 1] > square:
            squares[at], blocks[at] = squares[at - 1], blocks[at - 1]
            at -= 1
        squares[at], blocks[at] = square, block[i]
        found = min(found + 1, REFERENCE_CANDIDATES)
    best = blocks[0]
    for k in range(1, found):
        best = blocks[k] if sizes[blocks[k]] > sizes[best] else best
    return best


@inlined_no_refcount
def _fill_slope(i, center, cell, neighbours, center_mm, out):  # type: ignore[no-untyped-def]
    """Write the slope (2, 2), px per mm, at cell i by the cells in contact; False where these lie on one line."""
    xx, xy, yy, count = 0.0, 0.0, 0.0, 0
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    for k in range(6):
        j = neighbours[i, k]
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
def _consistent_with_block(cells, cell, block, reference, neighbours, layout, corner_step):  # type: ignore[no-untyped-def]
    """(N,) bool, the cells of the reference block, of the blocks consistent with it, and the single cells between."""
    count, blocks = cell.shape[0], block.max() + 1
    consistent, singles = block == reference, np.flatnonzero((cell >= 0) & (block < 0))
    if blocks == 1 and singles.shape[0] == 0:
        return consistent
    state = _Consistency(cell, consistent, np.full((count, 2, 2), np.nan), np.zeros(count, np.bool_))
    for i in range(count):
        if block[i] >= 0:
            state.has_slope[i] = _fill_slope(
                i, cells.center_px, cell, neighbours, layout.center_mm, state.slope[i]
            )
    if blocks > 1:
        _update_consistent_blocks(cells, block, layout, corner_step, state)
    if singles.shape[0] > 0:
        _update_consistent_singles(cells, singles, layout, corner_step, state)
    return consistent


@compiled
def _update_consistent_blocks(cells, block, layout, corner_step, state):  # type: ignore[no-untyped-def]
    """Accept the consistent blocks, the nearest first; ``block`` (N,) int32, or -1."""
    center, blocks = cells.center_px, block.max() + 1
    index, square = np.empty(COMPARED_CELLS, np.int32), np.empty(COMPARED_CELLS)
    jump, gap = np.empty(block.shape[0]), np.empty(block.shape[0])
    least, refused = np.empty(blocks), np.zeros(blocks, np.bool_)
    while True:
        waiting = np.flatnonzero((block >= 0) & ~state.is_consistent & ~refused[block])
        support = np.flatnonzero(state.is_consistent & state.has_slope)
        if waiting.shape[0] == 0 or support.shape[0] < COMPARED_CELLS:
            break
        grid = bucket_grid(center[support])
        _fill_gaps(cells, block, waiting, support, grid, gap, least)
        nearest_of_all = least.min()
        if not nearest_of_all < MAX_GAP:
            break
        for b in range(blocks):
            if least[b] > MAX_GAP_RATIO * nearest_of_all:
                continue
            count, large = 0, 0
            for j in waiting:
                if block[j] != b or gap[j] > MAX_GAP_RATIO * least[b]:
                    continue
                fill_nearest_points(grid, center[j, 0], center[j, 1], index, square)
                own = _update_slope_and_measure_jump(j, support, index, cells, layout, corner_step, state)
                if np.isfinite(own):
                    jump[count] = own
                    large += own > MAX_MEDIAN_JUMP
                    count += 1
            is_similar = count > 0 and np.median(jump[:count]) < MAX_MEDIAN_JUMP
            if is_similar and large <= MAX_JUMP_SHARE * count:
                state.is_consistent[block == b] = True
            else:
                refused[b] = True


@compiled
def _fill_gaps(cells, block, waiting, support, grid, gap, least):  # type: ignore[no-untyped-def]
    """Write the gaps (N,), in cells, of the ``waiting`` cells from the ``support`` in the grid, and each block's."""
    index, square = np.empty(1, np.int32), np.empty(1)
    least[:] = np.inf
    for j in waiting:
        fill_nearest_points(grid, cells.center_px[j, 0], cells.center_px[j, 1], index, square)
        gap[j] = np.sqrt(square[0]) / equilateral_edge(cells.area_px[support[index[0]]])
        least[block[j]] = min(least[block[j]], gap[j])


@compiled
def _update_consistent_singles(cells, singles, layout, corner_step, state):  # type: ignore[no-untyped-def]
    """Accept the consistent ones of the cells without contacts."""
    support = np.flatnonzero(state.is_consistent & state.has_slope)
    if support.shape[0] < COMPARED_CELLS:
        return
    index, square = np.empty(COMPARED_CELLS, np.int32), np.empty(COMPARED_CELLS)
    grid = bucket_grid(cells.center_px[support])
    for j in singles:
        fill_nearest_points(grid, cells.center_px[j, 0], cells.center_px[j, 1], index, square)
        jump = _update_slope_and_measure_jump(j, support, index, cells, layout, corner_step, state)
        edge = equilateral_edge(cells.area_px[support[index[0]]])
        state.is_consistent[j] = jump < MAX_SINGLE_JUMP and np.sqrt(square[0]) < MAX_GAP * edge


@inlined_no_refcount
def _update_slope_and_measure_jump(j, support, nearest, cells, layout, corner_step, state):  # type: ignore[no-untyped-def]
    """The median jump, in cells, of cell j against the ``nearest`` of the ``support`` cells.

    A cell without a slope is given the one of its triangle, else that of the nearest cell, and keeps it.
    """
    center, cell, slope = cells.center_px, state.cell, state.slope
    if not state.has_slope[j]:
        like = slope[support[nearest[0]]]
        if fill_map_by_similarity(cells, j, layout, cell[j], corner_step, like, slope[j]) < 0:
            slope[j, 0, 0], slope[j, 0, 1] = like[0, 0], like[0, 1]
            slope[j, 1, 0], slope[j, 1, 1] = like[1, 0], like[1, 1]
        state.has_slope[j] = True
    one, two, three = 0.0, 0.0, 0.0
    for k in range(COMPARED_CELLS):
        i = support[nearest[k]]
        a, b = 0.5 * (slope[i, 0, 0] + slope[j, 0, 0]), 0.5 * (slope[i, 0, 1] + slope[j, 0, 1])
        c, d = 0.5 * (slope[i, 1, 0] + slope[j, 1, 0]), 0.5 * (slope[i, 1, 1] + slope[j, 1, 1])
        determinant = a * d - b * c
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        dx = (d * x - b * y) / determinant - layout.center_mm[cell[j], 0] + layout.center_mm[cell[i], 0]
        dy = (a * y - c * x) / determinant - layout.center_mm[cell[j], 1] + layout.center_mm[cell[i], 1]
        one, two, three = two, three, np.hypot(dx, dy) / layout.size_mm[cell[j]]
    return _median_of_three(one, two, three)


@inlined_no_refcount
def _median_of_three(a, b, c):  # type: ignore[no-untyped-def]
    """The median of ``COMPARED_CELLS`` numbers; NaN if any is NaN."""
    if np.isnan(a) or np.isnan(b) or np.isnan(c):
        return np.nan
    return max(min(a, b), min(max(a, b), c))
