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
    ways: list[tuple[int, NDArray[np.int32]]] = []
    outside: list[int] = []
    for turn in range(3):
        place = turned(at, turn)
        shifts = _shifts(place, lattice.axial)
        if len(ways) + len(shifts) > MAX_PLACES:
            return None
        ways += [(turn, shift) for shift in shifts]
        outside += _outside(place, shifts, lattice.cell_of, lattice.layers).tolist()
    order = np.argsort(outside, kind="stable")
    if len(order) < 2 or outside[order[0]] > stray:
        return None
    if outside[order[1]] - outside[order[0]] < max(MIN_MISFITS, MIN_MISFIT * len(at)):
        return None
    turn, shift = ways[int(order[0])]
    return cells_at(turned(at, turn) + shift, lattice)


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
def _outside(place, shifts, cell_of, layers):  # type: ignore[no-untyped-def]
    """(S,) how many of the places, shifted so, hold no cell of the layout."""
    out = np.zeros(shifts.shape[0], np.int64)
    for n in range(shifts.shape[0]):
        for i in range(place.shape[0]):
            q, r = place[i, 0] + shifts[n, 0], place[i, 1] + shifts[n, 1]
            out[n] += layer_of(q, r) > layers or cell_of[marker_id(q, r)] < 0
    return out
