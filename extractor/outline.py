"""Where no white cell is to be seen, the pattern's outline can say where the lattice begins: if only one place fits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .lattice import turned
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
    outside: list[int] = []
    ways: list[NDArray[np.int32]] = []
    for turn in range(3):
        place = turned(at, turn)
        for shift in _shifts(place, lattice):
            cell = cells_at(place + shift, lattice)
            outside.append(int((cell < 0).sum()))
            ways.append(cell)
        if len(ways) > MAX_PLACES:
            return None
    order = np.argsort(outside, kind="stable")
    if len(order) < 2 or outside[order[0]] > stray:
        return None
    if outside[order[1]] - outside[order[0]] < max(MIN_MISFITS, MIN_MISFIT * len(at)):
        return None
    best: NDArray[np.int32] = ways[int(order[0])]
    return best


def _shifts(place: NDArray[np.int32], lattice: Lattice) -> NDArray[np.int32]:
    """(S, 2) shifts that carry inks onto themselves and the places' extent into the layout's, or nearly."""

    def extents(axial: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        three = np.column_stack([axial, axial.sum(axis=1)])
        return three.min(axis=0), three.max(axis=0)

    (low, high), (lowest, highest) = extents(place), extents(lattice.axial)
    first = np.minimum(lowest - low, highest - high) - MARGIN
    last = np.maximum(lowest - low, highest - high) + MARGIN
    q, r = np.meshgrid(np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1), indexing="ij")
    use = ((q - r) % 3 == 0) & (q + r >= first[2]) & (q + r <= last[2])
    return np.stack([q[use], r[use]], axis=1).astype(np.int32)
