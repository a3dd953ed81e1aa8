"""Whether cells that were numbered across a gap stand where the pattern goes on.

Cells of one ink are 1.7 cells apart. A part of the pattern beyond a scratch, numbered one such step aside, looks right
in itself and is wrong as a whole. But the way across the gap must be as long as the pattern on both sides says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .engine import compiled
from .gradients import seen_as, slopes
from .lattice import SIX, layer_of, marker_id
from .near import bucketed, nearest
from .parts import connected
from .tables import Lattice


class Limits(NamedTuple):
    """In cells, between the way by the numbers and by the pattern's slopes; a wrong step makes 1.7.

    Attributes:
        cell: of a single cell.
        group: the median of a group, of which at least
        members: so many can be judged.
    """

    cell: float
    group: float
    members: int


PREDICTED = Limits(0.9, 0.6, 1)  # cells numbered by prediction
MESHED = Limits(
    np.inf, 1.2, 8
)  # cells that hang together with the rest by damaged ones: sharp bends look so, too
REACH = 5.0  # how far apart the two sides may be, in cells
PAIRS = 3  # cells on the near side that each beyond is compared with


def unbridged(
    cells: Cells, before: NDArray[np.int32], after: NDArray[np.int32], lattice: Lattice, limits: Limits
) -> NDArray[np.bool_]:
    """(N,) bool, the cells beyond gaps whose numbers make the way across longer or shorter than the pattern is.

    Cells that hang together fall together when most of them do; what has no whole neighbours is not judged.

    Args:
        before, after: (N,) the layout's cell of each cell of the image, or -1, without and with those beyond gaps.
    """
    beyond = np.count_nonzero((after >= 0) & (before < 0))
    if beyond == 0 or (beyond < limits.members and limits.cell == np.inf):  # none that could be judged
        return np.zeros(len(after), np.bool_)
    seen, layout = (cells.center_px, cells.whole), (lattice.center_mm, lattice.size_mm)
    return np.asarray(_unbridged(*seen, before, after, lattice.slope_tables, *layout, *limits))


@compiled
def _unbridged(center_px, whole, before, after, tables, center_mm, size_mm, cell_limit, group_limit, members):  # type: ignore[no-untyped-def]
    slope = slopes(center_px, after, seen_as(after, size_mm.shape[0]), tables)
    group, sure = _groups(before, after, whole, slope, size_mm.shape[0], tables)
    here = np.flatnonzero(sure & (before >= 0))
    there = np.flatnonzero(sure & (group >= 0))
    bad = np.zeros(after.shape[0], np.bool_)
    if here.shape[0] < PAIRS or there.shape[0] == 0:
        return bad
    jump = _jumps(center_px, slope, after, here, there, center_mm, size_mm)
    bad[there] = jump > cell_limit
    for one in range(group.max() + 1):
        known = jump[(group[there] == one) & np.isfinite(jump)]
        if known.shape[0] >= members and np.median(known) > group_limit:
            bad[group == one] = True
    return bad


@compiled
def _groups(before, after, whole, slope, count, tables):  # type: ignore[no-untyped-def]
    """(N,) int32 the group of neighbouring cells beyond gaps that each belongs to, or -1; and (N,) bool, the numbered
    cells with a slope that are whole and amid whole ones."""
    _, axial, cell_of, layers = tables
    seen = seen_as(after, count)
    sure = np.zeros(after.shape[0], np.bool_)
    beside = np.full((after.shape[0], 6), -1, np.int32)
    for i in range(after.shape[0]):
        if after[i] < 0:
            continue
        sure[i] = whole[i] and np.isfinite(slope[i, 0, 0])
        for k in range(6):
            q, r = axial[after[i], 0] + SIX[k, 0], axial[after[i], 1] + SIX[k, 1]
            if layer_of(q, r) <= layers and cell_of[marker_id(q, r)] >= 0:
                j = seen[cell_of[marker_id(q, r)]]
                beside[i, k] = j
                sure[i] = sure[i] and (j < 0 or whole[j])
    return connected(beside, (after >= 0) & (before < 0)), sure


@compiled
def _jumps(center_px, slope, cell, here, there, center_mm, size_mm):  # type: ignore[no-untyped-def]
    """(T,) how far, in cells, each cell there is from where its numbers put it, by the slopes on both sides; NaN where
    nothing here is in reach."""
    out, apart = np.full(there.shape[0], np.nan), np.empty(PAIRS)
    index, square = np.empty(PAIRS, np.int32), np.empty(PAIRS)
    xy = center_px[here]
    grid = bucketed(xy)
    for n in range(there.shape[0]):
        j = there[n]
        nearest(xy, grid, center_px[j, 0], center_px[j, 1], index, square)
        for k in range(PAIRS):
            i = here[index[k]]
            a, b = 0.5 * (slope[i, 0, 0] + slope[j, 0, 0]), 0.5 * (slope[i, 0, 1] + slope[j, 0, 1])
            c, d = 0.5 * (slope[i, 1, 0] + slope[j, 1, 0]), 0.5 * (slope[i, 1, 1] + slope[j, 1, 1])
            determinant = a * d - b * c
            x, y = center_px[j, 0] - center_px[i, 0], center_px[j, 1] - center_px[i, 1]
            dx = (d * x - b * y) / determinant - center_mm[cell[j], 0] + center_mm[cell[i], 0]
            dy = (a * y - c * x) / determinant - center_mm[cell[j], 1] + center_mm[cell[i], 1]
            apart[k] = np.hypot(dx, dy) / size_mm[cell[j]]
        size = np.sqrt(abs(determinant)) * size_mm[cell[j]]  # of a cell there, px
        if square[0] < (REACH * size) ** 2:
            out[n] = np.median(apart)
    return out
