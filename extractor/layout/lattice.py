"""The numbering of the triangular lattice, on this side of layout.json: axial (q, r) <-> layer, index <-> id.

Marker i of layer k has the id 3k(k-1) + 1 + i; index 0 lies at the axial (-k, k) and the index runs clockwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled

NEIGHBOUR_STEPS = np.array(
    [[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]], np.int32
)  # steps to the neighbours


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
    """(M, 2) int32 axial coordinates of the markers with these layers and indices."""
    k = np.maximum(layer, 1)
    side, along = np.divmod(index, k)
    corner_q = np.array([-1, 0, 1, 1, 0, -1])[side] * layer
    corner_r = np.array([1, 1, 0, -1, -1, 0])[side] * layer
    step_q = np.array([1, 1, 0, -1, -1, 0])[side] * along
    step_r = np.array([0, -1, -1, 0, 1, 1])[side] * along
    return np.stack([corner_q + step_q, corner_r + step_r], axis=1).astype(np.int32)


@compiled
def rotated_cell(q, r, turn):  # type: ignore[no-untyped-def]
    """The axial place of a cell turned by 0, 120 or 240 degrees; inks are carried onto themselves when shifted so that
    their (q - r) mod 3 agrees.

    It is the turn that brings the three cells around the down-cell (turn, 0) to those around (0, 0).
    """
    q -= turn
    if turn == 1:
        return -q - r - 1, q + 1
    if turn == 2:
        return r - 1, -q - r
    return q, r


@compiled
def rotated_cells(at, turn):  # type: ignore[no-untyped-def]
    """(N, 2) int32, the axial coordinates of cells turned so."""
    out = np.empty(at.shape, np.int32)
    for i in range(at.shape[0]):
        out[i] = rotated_cell(at[i, 0], at[i, 1], turn)
    return out
