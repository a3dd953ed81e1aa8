"""The numbering of the triangular lattice as the reader defines it: axial (q, r) <-> layer, index <-> id.

Marker i of layer k has the id 3k(k-1) + 1 + i; index 0 lies at the axial (-k, k) and the index runs clockwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled

NEIGHBOUR_STEPS = np.array(
    [[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]], np.int32
)  # (6, 2) axial steps from a marker to its neighbours


@compiled
def layer_of(q, r):  # type: ignore[no-untyped-def]
    """The layer of the marker at the axial (q, r)."""
    return max(abs(q), abs(r), abs(q + r))


@compiled
def marker_id(q, r):  # type: ignore[no-untyped-def]
    """The id of the marker at the axial (q, r)."""
    k = layer_of(q, r)
    if k == 0:
        return 0
    if r == k and q < 0:
        i = q + k
    elif q + r == k and q < k:
        i = k + q
    elif q == k and r > -k:
        i = 2 * k - r
    elif (r == -k and q > 0) or (q + r == -k and q > -k):
        i = 4 * k - q
    else:
        i = 5 * k + r
    return 3 * k * (k - 1) + 1 + i


def axial_coordinates(layer: NDArray[np.int32], index: NDArray[np.int32]) -> NDArray[np.int32]:
    """(M, 2) int32 axial coordinates (q, r) of the markers with these layers (M,) and indices (M,)."""
    k = np.maximum(layer, 1)
    sextant, steps = np.divmod(index, k)
    corner_q = np.array([-1, 0, 1, 1, 0, -1])[sextant] * layer
    corner_r = np.array([1, 1, 0, -1, -1, 0])[sextant] * layer
    step_q = np.array([1, 1, 0, -1, -1, 0])[sextant] * steps
    step_r = np.array([0, -1, -1, 0, 1, 1])[sextant] * steps
    return np.stack([corner_q + step_q, corner_r + step_r], axis=1).astype(np.int32)


@compiled
def rotated_cell(q, r, turn):  # type: ignore[no-untyped-def]
    """The axial place of a cell after a rotation of the lattice by ``turn`` (0, 1, 2) times 120 degrees.

    The rotation maps the three cells around the down-cell (turn, 0) to the cells around (0, 0). Inks are mapped onto
    themselves when the lattice is also shifted so that (q - r) mod 3 agrees.
    """
    q -= turn
    if turn == 1:
        return -q - r - 1, q + 1
    if turn == 2:
        return r - 1, -q - r
    return q, r


@compiled
def rotated_cells(axial, turn):  # type: ignore[no-untyped-def]
    """(N, 2) int32, the axial coordinates of cells (N, 2) after ``rotated_cell``."""
    out = np.empty(axial.shape, np.int32)
    for i in range(axial.shape[0]):
        out[i] = rotated_cell(axial[i, 0], axial[i, 1], turn)
    return out
