"""Whether what was numbered apart stands where the pattern goes on.

Cells of one ink are 1.7 cells apart. A part of the pattern beyond a scratch, numbered one such step aside, looks right
in itself and is wrong as a whole. So the numbered cells are taken as blocks that hang together by shared corners, and
from the block at the white cell on, the nearest first, each is judged by the ways to what holds already: they must be
as long as the pattern's slopes on both sides say. What does not hold, or hangs in nothing, loses its number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .engine import compiled
from .near import bucketed, nearest
from .parts import connected
from .tables import Lattice
from .touch import edge_of, touching, turn_like

MAX_JUMP = 0.6  # in cells, the median between a block's ways by the numbers and by the slopes; a wrong step makes 1.7
MAX_JUMPING = 0.25  # of a block's ways that may be longer
MAX_ALONE = 0.9  # the same for a cell that is not whole, whose center may lie aside
REACH = 5.0  # how far apart the two sides may be, in cells
BESIDE = 1.5  # a block's ways that tell are at most so much longer than its shortest
PAIRS = 3  # cells on the near side that each beyond is compared with
SEEDS = 3  # cells nearest to the white one, of which the largest block holds the reference


def unbridged(
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
    seen_as = np.full(len(lattice.ink), -1, np.int32)
    numbered = np.flatnonzero(cell >= 0)
    seen_as[cell[numbered]] = numbered
    seen = cells.center_px, cells.corner_px, cells.area_px
    step = 1 if mirrored else 2
    tables = lattice.center_mm, lattice.arms_mm, lattice.beside
    beside = touching(*seen, cells.whole, cell, seen_as, tables, step)
    block = connected(beside, cells.whole & (cell >= 0))
    sizes = np.bincount(block[block >= 0])
    if len(sizes) == 0:
        return np.asarray(cell >= 0)
    first = int(sizes.argmax())
    if white_px is not None:
        among = np.flatnonzero(block >= 0)
        apart = ((cells.center_px[among] - white_px) ** 2).sum(axis=1)
        near = block[among[np.argsort(apart, kind="stable")[:SEEDS]]]
        first = int(near[sizes[near].argmax()])
    layout = lattice.center_mm, lattice.size_mm, lattice.arms_mm
    held = _held(*seen, cell, block, first, beside, *layout, step)
    return np.asarray((cell >= 0) & ~held)


@compiled
def _slope(i, center, cell, beside, center_mm, out):  # type: ignore[no-untyped-def]
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
def _held(center, corner, area, cell, block, first, beside, center_mm, size_mm, arms_mm, step):  # type: ignore[no-untyped-def]
    """(N,) bool, the cells of the first block and of those that hold on to it, and the single ones between."""
    count, blocks = cell.shape[0], block.max() + 1
    held = block == first
    slope, sloped = np.full((count, 2, 2), np.nan), np.zeros(count, np.bool_)
    for i in range(count):
        if block[i] >= 0:
            sloped[i] = _slope(i, center, cell, beside, center_mm, slope[i])
    index, square = np.empty(PAIRS, np.int32), np.empty(PAIRS)
    jump, gap = np.empty(count), np.empty(count)
    least, refused = np.empty(blocks), np.zeros(blocks, np.bool_)
    while True:
        here = np.flatnonzero(held & sloped)
        if here.shape[0] < PAIRS:
            break
        xy = center[here]
        grid = bucketed(xy)
        least[:] = np.inf
        for j in range(count):
            gap[j] = np.inf
            if block[j] >= 0 and not held[j] and not refused[block[j]]:
                nearest(xy, grid, center[j, 0], center[j, 1], index, square)
                gap[j] = np.sqrt(square[0]) / edge_of(area[here[index[0]]])
                least[block[j]] = min(least[block[j]], gap[j])
        nearest_of_all = least.min()
        if not nearest_of_all < REACH:
            break
        for b in range(blocks):
            if least[b] > BESIDE * nearest_of_all:
                continue
            telling, wide = 0, 0
            for j in range(count):
                if block[j] != b or gap[j] > BESIDE * least[b]:
                    continue
                nearest(xy, grid, center[j, 0], center[j, 1], index, square)
                own = _jump(
                    j, here[index], center, corner, cell, slope, sloped, center_mm, size_mm, arms_mm, step
                )
                if np.isfinite(own):
                    jump[telling] = own
                    wide += own > MAX_JUMP
                    telling += 1
            if telling > 0 and np.median(jump[:telling]) < MAX_JUMP and wide <= MAX_JUMPING * telling:
                held |= block == b
            else:
                refused[b] = True
    here = np.flatnonzero(held & sloped)
    if here.shape[0] >= PAIRS:
        xy = center[here]
        grid = bucketed(xy)
        for j in range(count):
            if cell[j] >= 0 and block[j] < 0:
                nearest(xy, grid, center[j, 0], center[j, 1], index, square)
                own = _jump(
                    j, here[index], center, corner, cell, slope, sloped, center_mm, size_mm, arms_mm, step
                )
                held[j] = own < MAX_ALONE and np.sqrt(square[0]) < REACH * edge_of(area[here[index[0]]])
    return held


@compiled
def _jump(j, near, center, corner, cell, slope, sloped, center_mm, size_mm, arms_mm, step):  # type: ignore[no-untyped-def]
    """How far, in cells, cell j is from where its number puts it, by the slopes there and at the cells near it; the
    median over these. A cell without a slope has that of its triangle, or else of the others, and keeps it."""
    if not sloped[j]:
        own = np.empty((2, 2))
        if turn_like(center[j], corner[j], arms_mm[cell[j]], step, slope[near[0]], own) >= 0:
            slope[j] = own
        else:
            slope[j] = slope[near[0]]
        sloped[j] = True
    apart = np.empty(near.shape[0])
    for k in range(near.shape[0]):
        i = near[k]
        a, b = 0.5 * (slope[i, 0, 0] + slope[j, 0, 0]), 0.5 * (slope[i, 0, 1] + slope[j, 0, 1])
        c, d = 0.5 * (slope[i, 1, 0] + slope[j, 1, 0]), 0.5 * (slope[i, 1, 1] + slope[j, 1, 1])
        determinant = a * d - b * c
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        dx = (d * x - b * y) / determinant - center_mm[cell[j], 0] + center_mm[cell[i], 0]
        dy = (a * y - c * x) / determinant - center_mm[cell[j], 1] + center_mm[cell[i], 1]
        apart[k] = np.hypot(dx, dy) / size_mm[cell[j]]
    return np.median(apart)
