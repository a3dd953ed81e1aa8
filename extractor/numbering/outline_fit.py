"""Where no white cell is to be seen, the pattern's outline can say where the lattice begins: if only one place fits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice import rotated_cell, rotated_cells
from extractor.layout.lattice_tables import UNKNOWN_AXIAL, Lattice, cell_at
from extractor.numeric.compilation import compiled

MIN_SEEN_SHARE = 0.5  # of the layout's cells must be seen
MAX_OUTSIDE_SHARE = 0.005  # of the cells seen may lie outside where they fit: dirt that joined the mesh
MIN_MARGIN_SHARE = 0.02  # of them must lie outside at every other place, and
MIN_MARGIN_CELLS = 5  # at least so many
SHIFT_MARGIN = 3  # how far beyond the fitting places others are tried
NO_FIT = 1 << 30
MAX_ALIGNMENTS = 200  # places to try; where more could fit, none is certain
RIM_WIDTH = 2  # steps from the outermost cells, of those that are tried first
BATCH_SIZE = 32  # cells that are tried before it is asked whether these are enough


def align_to_outline(at: NDArray[np.int32], lattice: Lattice) -> NDArray[np.int32] | None:
    """(N,) the layout's cell of each cell of the image, or -1, if the outline leaves one way to put them into it.

    All turns by 120 degrees and all shifts that carry every ink onto itself are tried.

    Args:
        at: (N, 2) axial coordinates of the connected cells, up to such a turn and shift; ``UNKNOWN_AXIAL`` for the
            others.
    """
    settled, cell = _align(at, lattice.axial, lattice.cell_lookup)
    return cell if settled else None


@compiled
def _align(at, axial, holder):  # type: ignore[no-untyped-def]
    """Whether only one way fits, and the cells that it gives."""
    known, cell = np.flatnonzero(at[:, 0] != UNKNOWN_AXIAL), np.full(at.shape[0], -1, np.int32)
    stray = MAX_OUTSIDE_SHARE * known.shape[0]
    if known.shape[0] < MIN_SEEN_SHARE * axial.shape[0] or known.shape[0] - axial.shape[0] > stray:
        return False, cell
    best, next_best, turn, shift = _best_alignment(_outermost_first(at, known), axial, holder)
    if not best <= stray or next_best - best < max(MIN_MARGIN_CELLS, MIN_MARGIN_SHARE * known.shape[0]):
        return False, cell
    for i in known:
        q, r = rotated_cell(at[i, 0], at[i, 1], turn)
        cell[i] = cell_at(holder, q + shift[0], r + shift[1])
    return True, cell


@compiled
def _outermost_first(at, known):  # type: ignore[no-untyped-def]
    """(K, 2) int32 the known places, those near the outline before all others: where cells lie outside, some of these
    do."""
    place = at[known]
    extents, out, filled = _axial_extents(place), np.empty_like(place), 0
    middle = extents[:, 0] + extents[:, 1]
    away = np.empty(known.shape[0], np.int64)  # in half steps
    for k in range(known.shape[0]):
        q, r = 2 * place[k, 0] - middle[0], 2 * place[k, 1] - middle[1]
        away[k] = max(abs(q), abs(r), abs(2 * (place[k, 0] + place[k, 1]) - middle[2]))
    rim = away.max() - 2 * RIM_WIDTH
    for outer in (True, False):
        for k in range(known.shape[0]):
            out[filled] = place[k]
            filled += (away[k] >= rim) == outer
            if filled == known.shape[0]:
                return out
    return out


@compiled
def _best_alignment(at, axial, holder):  # type: ignore[no-untyped-def]
    """Of all ways, the fewest cells that lie outside and the next fewest, and the turn and (2,) int32 the shift of the
    best; with too many ways or only one no numbers that could be enough."""
    best, next_best, best_turn, best_shift, count = NO_FIT, NO_FIT, 0, np.zeros(2, np.int32), 0
    for turn in range(3):
        place = rotated_cells(at, turn)
        shifts = _admissible_shifts(place, axial)
        count += shifts.shape[0]
        if count > MAX_ALIGNMENTS:
            return NO_FIT, NO_FIT, 0, best_shift
        for n in range(shifts.shape[0]):
            outside = _count_outside(place, shifts[n, 0], shifts[n, 1], holder, next_best)
            if outside < best:
                best, next_best = outside, best
                best_turn, best_shift = turn, shifts[n]
            elif outside < next_best:
                next_best = outside
    return best, next_best if count > 1 else best, best_turn, best_shift


@compiled
def _axial_extents(axial):  # type: ignore[no-untyped-def]
    """(3, 2) the least and the largest q, r and q + r."""
    out = np.zeros((3, 2), np.int64)
    out[:, 0], out[:, 1] = 1 << 30, -(1 << 30)
    for i in range(axial.shape[0]):
        q, r = np.int64(axial[i, 0]), np.int64(axial[i, 1])
        for k, value in enumerate((q, r, q + r)):
            out[k, 0], out[k, 1] = min(out[k, 0], value), max(out[k, 1], value)
    return out


@compiled
def _admissible_shifts(place, axial):  # type: ignore[no-untyped-def]
    """(S, 2) int32 shifts that carry inks onto themselves and the places' extent into the layout's, or nearly."""
    apart = _axial_extents(axial) - _axial_extents(place)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        first[k], last[k] = apart[k].min() - SHIFT_MARGIN, apart[k].max() + SHIFT_MARGIN
    shifts = np.empty(((last[0] - first[0] + 1) * (last[1] - first[1] + 1), 2), np.int32)
    count = 0
    for q in range(first[0], last[0] + 1):
        for r in range(first[1], last[1] + 1):
            if (q - r) % 3 == 0 and first[2] <= q + r <= last[2]:
                shifts[count, 0], shifts[count, 1] = q, r
                count += 1
    return shifts[:count]


@compiled
def _count_outside(place, q, r, holder, enough):  # type: ignore[no-untyped-def]
    """How many of the places, shifted so, hold no cell of the layout; counted until there are
    ``converged_deviations``."""
    count = 0
    for first in range(0, place.shape[0], BATCH_SIZE):
        for i in range(first, min(first + BATCH_SIZE, place.shape[0])):
            count += cell_at(holder, place[i, 0] + q, place[i, 1] + r) < 0
        if count >= enough:
            break
    return count
