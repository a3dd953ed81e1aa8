"""Finds the origin of the lattice by the pattern's outline where no white cell is visible: only if it is unique."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice import rotated_cell, rotated_cells
from extractor.layout.lattice_tables import UNKNOWN_AXIAL, Lattice, cell_at
from extractor.numeric.compilation import compiled

MIN_SEEN_SHARE = 0.5  # of the layout's cells must be found
MAX_OUTSIDE_SHARE = 0.005  # of the cells found may lie outside at the best alignment: dirt in the mesh
MIN_MARGIN_SHARE = 0.02  # more of them must lie outside at every other alignment, and
MIN_MARGIN_CELLS = 5  # at least so many more
SHIFT_MARGIN = 3  # lattice steps by which shifts may exceed the fitting ones
NO_FIT = 1 << 30
MAX_ALIGNMENTS = 200  # alignments to try; with more possible ones none is certain
RIM_WIDTH = 2  # lattice steps from the outermost cells; the cells of this rim are tested first
BATCH_SIZE = 32  # cells that are tested between two comparisons with the limit


def align_to_outline(axial: NDArray[np.int32], lattice: Lattice) -> NDArray[np.int32] | None:
    """Align connected cells with the layout's outline.

    All rotations by 120 degrees and all shifts that carry every ink onto itself are tried.

    Args:
        axial: (N, 2) int32, axial coordinates of the connected cells, up to such a rotation and shift;
            ``UNKNOWN_AXIAL`` for the others.
        lattice: the layout.

    Returns:
        (N,) int32, the layout's cell of each cell of the image, or -1; None unless the alignment is unique.
    """
    is_unique, cell = _align(axial, lattice.axial, lattice.cell_lookup)
    return cell if is_unique else None


@compiled
def _align(axial, layout_axial, cell_lookup):  # type: ignore[no-untyped-def]
    """Whether the alignment is unique, and the layout's cells (N,) by it."""
    known, cell = np.flatnonzero(axial[:, 0] != UNKNOWN_AXIAL), np.full(axial.shape[0], -1, np.int32)
    max_outside = MAX_OUTSIDE_SHARE * known.shape[0]
    layout_count = layout_axial.shape[0]
    if known.shape[0] < MIN_SEEN_SHARE * layout_count or known.shape[0] - layout_count > max_outside:
        return False, cell
    best, next_best, turn, shift = _best_alignment(_outermost_first(axial, known), layout_axial, cell_lookup)
    margin = max(MIN_MARGIN_CELLS, MIN_MARGIN_SHARE * known.shape[0])
    if not best <= max_outside or next_best - best < margin:
        return False, cell
    for i in known:
        q, r = rotated_cell(axial[i, 0], axial[i, 1], turn)
        cell[i] = cell_at(cell_lookup, q + shift[0], r + shift[1])
    return True, cell


@compiled
def _outermost_first(axial, known):  # type: ignore[no-untyped-def]
    """(K, 2) int32, the axial places of the ``known`` cells (K,), the rim first: its cells are the first outside."""
    place = axial[known]
    extents, out, filled = _axial_extents(place), np.empty_like(place), 0
    middle = extents[:, 0] + extents[:, 1]
    radius = np.empty(known.shape[0], np.int64)  # from the middle, in half steps
    for k in range(known.shape[0]):
        q, r = 2 * place[k, 0] - middle[0], 2 * place[k, 1] - middle[1]
        radius[k] = max(abs(q), abs(r), abs(2 * (place[k, 0] + place[k, 1]) - middle[2]))
    rim = radius.max() - 2 * RIM_WIDTH
    for outer in (True, False):
        for k in range(known.shape[0]):
            out[filled] = place[k]
            filled += (radius[k] >= rim) == outer
            if filled == known.shape[0]:
                return out
    return out


@compiled
def _best_alignment(place, layout_axial, cell_lookup):  # type: ignore[no-untyped-def]
    """The least and the next least number of cells outside, and the rotation and the shift (2,) int32 of the best.

    With too many possible alignments both numbers are ``NO_FIT``; with a single one they are equal: neither is unique.
    """
    best, next_best, best_turn, best_shift, count = NO_FIT, NO_FIT, 0, np.zeros(2, np.int32), 0
    for turn in range(3):
        rotated = rotated_cells(place, turn)
        shifts = _admissible_shifts(rotated, layout_axial)
        count += shifts.shape[0]
        if count > MAX_ALIGNMENTS:
            return NO_FIT, NO_FIT, 0, best_shift
        for n in range(shifts.shape[0]):
            outside = _count_outside(rotated, shifts[n, 0], shifts[n, 1], cell_lookup, next_best)
            if outside < best:
                best, next_best = outside, best
                best_turn, best_shift = turn, shifts[n]
            elif outside < next_best:
                next_best = outside
    return best, next_best if count > 1 else best, best_turn, best_shift


@compiled
def _axial_extents(axial):  # type: ignore[no-untyped-def]
    """(3, 2) int64, the least and the largest q, r and q + r."""
    out = np.zeros((3, 2), np.int64)
    out[:, 0], out[:, 1] = 1 << 30, -(1 << 30)
    for i in range(axial.shape[0]):
        q, r = np.int64(axial[i, 0]), np.int64(axial[i, 1])
        for k, value in enumerate((q, r, q + r)):
            out[k, 0], out[k, 1] = min(out[k, 0], value), max(out[k, 1], value)
    return out


@compiled
def _admissible_shifts(place, layout_axial):  # type: ignore[no-untyped-def]
    """(S, 2) int32, the shifts that carry inks onto themselves and the places' extents nearly into the layout's."""
    difference = _axial_extents(layout_axial) - _axial_extents(place)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        first[k], last[k] = difference[k].min() - SHIFT_MARGIN, difference[k].max() + SHIFT_MARGIN
    shifts = np.empty(((last[0] - first[0] + 1) * (last[1] - first[1] + 1), 2), np.int32)
    count = 0
    for q in range(first[0], last[0] + 1):
        for r in range(first[1], last[1] + 1):
            if (q - r) % 3 == 0 and first[2] <= q + r <= last[2]:
                shifts[count, 0], shifts[count, 1] = q, r
                count += 1
    return shifts[:count]


@compiled
def _count_outside(place, q, r, cell_lookup, limit):  # type: ignore[no-untyped-def]
    """The number of places (K, 2), shifted by (q, r), without a cell of the layout; counting stops at ``limit``."""
    count = 0
    for first in range(0, place.shape[0], BATCH_SIZE):
        for i in range(first, min(first + BATCH_SIZE, place.shape[0])):
            count += cell_at(cell_lookup, place[i, 0] + q, place[i, 1] + r) < 0
        if count >= limit:
            break
    return count
