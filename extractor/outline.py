"""Where no white cell is to be seen, the pattern's outline can say where the lattice begins: if only one place fits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .lattice import layer_of, marker_id, turned
from .tables import Lattice, cells_at

MIN_SHARE = 0.5  # of the layout's cells must be seen
MAX_STRAY = 0.005  # of the cells seen may lie outside where they fit: dirt that joined the mesh
MIN_MISFIT = 0.02  # of them must lie outside at every other place, and
MIN_MISFITS = 5  # at least so many
MARGIN = 3  # how far beyond the fitting places others are tried
NONE = 1 << 30
MAX_PLACES = 200  # places to try; where more could fit, none is certain


def settle(at: NDArray[np.int32], lattice: Lattice) -> NDArray[np.int32] | None:
    """The layout's cell at each axial place, if the outline leaves one way to put them into the layout.

    All turns by 120 degrees and all shifts that carry every ink onto itself are tried.

    Args:
        at: (K, 2) axial coordinates of the connected cells, up to such a turn and shift.
    """
    stray = MAX_STRAY * len(at)
    if len(at) < MIN_SHARE * len(lattice.ink) or len(at) - len(lattice.ink) > stray:
        return None
    best, next_best, turn, shift = _best(at, lattice.axial, lattice.cell_of, lattice.layers)
    if not best <= stray or next_best - best < max(MIN_MISFITS, MIN_MISFIT * len(at)):
        return None
    return cells_at(turned(at, turn) + shift, lattice)


@compiled
def _best(at, axial, cell_of, layers):  # type: ignore[no-untyped-def]
    """Of all ways, the fewest cells that lie outside and the next fewest, and the turn and (2,) int32 the shift of the
    best; with too many ways or only one no numbers that could be enough."""
    best, next_best, best_turn, best_shift, count = NONE, NONE, 0, np.zeros(2, np.int32), 0
    for turn in range(3):
        place = turned(at, turn)
        shifts = _shifts(place, axial)
        count += shifts.shape[0]
        if count > MAX_PLACES:
            return NONE, NONE, 0, best_shift
        for n in range(shifts.shape[0]):
            outside = _outside(place, shifts[n, 0], shifts[n, 1], cell_of, layers, next_best)
            if outside < best:
                best, next_best = outside, best
                best_turn, best_shift = turn, shifts[n]
            elif outside < next_best:
                next_best = outside
    return best, next_best if count > 1 else best, best_turn, best_shift


@compiled
def _extents(axial):  # type: ignore[no-untyped-def]
    """(3, 2) the least and the largest q, r and q + r."""
    out = np.zeros((3, 2), np.int64)
    out[:, 0], out[:, 1] = 1 << 30, -(1 << 30)
    for i in range(axial.shape[0]):
        q, r = np.int64(axial[i, 0]), np.int64(axial[i, 1])
        for k, value in enumerate((q, r, q + r)):
            out[k, 0], out[k, 1] = min(out[k, 0], value), max(out[k, 1], value)
    return out


@compiled
def _shifts(place, axial):  # type: ignore[no-untyped-def]
    """(S, 2) int32 shifts that carry inks onto themselves and the places' extent into the layout's, or nearly."""
    apart = _extents(axial) - _extents(place)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        first[k], last[k] = apart[k].min() - MARGIN, apart[k].max() + MARGIN
    shifts = np.empty(((last[0] - first[0] + 1) * (last[1] - first[1] + 1), 2), np.int32)
    count = 0
    for q in range(first[0], last[0] + 1):
        for r in range(first[1], last[1] + 1):
            if (q - r) % 3 == 0 and first[2] <= q + r <= last[2]:
                shifts[count, 0], shifts[count, 1] = q, r
                count += 1
    return shifts[:count]


@compiled
def _outside(place, q, r, cell_of, layers, enough):  # type: ignore[no-untyped-def]
    """How many of the places, shifted so, hold no cell of the layout; counted until there are ``enough``."""
    count = 0
    for i in range(place.shape[0]):
        count += layer_of(place[i, 0] + q, place[i, 1] + r) > layers or (
            cell_of[marker_id(place[i, 0] + q, place[i, 1] + r)] < 0
        )
        if count >= enough:
            break
    return count
