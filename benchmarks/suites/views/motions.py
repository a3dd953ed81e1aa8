"""The motions of the lattice of colors that put a set of cells into a pattern.

A motion is a turn by 0, 120 or 240 degrees and a shift that keep every color of a cell. It fits a
set of cells if every cell becomes a cell of the pattern. The identity always fits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.int64]


def fitting_motions(pattern: Cells, seen: Cells) -> int:
    """The number of motions that put all seen cells into the pattern.

    Args:
        pattern: (N, 2) axial coordinates (q, r) of all colored up-cells of the pattern.
        seen: (K, 2) of the seen ones.
    """
    low = pattern.min(axis=0)
    inside = np.zeros(np.ptp(pattern, axis=0) + 1, dtype=np.bool_)
    inside[tuple((pattern - low).T)] = True
    count = 0
    for turned in _turns(seen):
        shift_low, shift_high = low - turned.min(axis=0), pattern.max(axis=0) - turned.max(axis=0)
        if (shift_high < shift_low).any():
            continue
        shift = np.stack(
            np.meshgrid(*map(np.arange, shift_low, shift_high + 1), indexing="ij"), axis=-1
        ).reshape(-1, 2)
        keeps_color = (turned[0] @ (1, -1) + shift @ (1, -1) - seen[0] @ (1, -1)) % 3 == 0
        places = turned[:, None] + shift[keeps_color] - low
        count += int(inside[places[..., 0], places[..., 1]].all(axis=0).sum())
    return count


def _turns(cells: Cells) -> list[Cells]:
    """The up-cells turned about marker 0 by 0, 120 and 240 degrees counter-clockwise.

    The middle of the up-cell (q, r) is (q + 1/3, r + 1/3); a turn by 120 degrees maps (q, r) to (-q - r, q).
    """
    found = [cells]
    for _ in range(2):
        q, r = found[-1].T
        found.append(np.stack([-q - r - 1, q], axis=1))
    return found
