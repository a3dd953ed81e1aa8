"""The numbering of the triangular lattice as the reader defines it: axial (q, r) <-> layer, index <-> id.

Marker i of layer k has the id 3k(k-1) + 1 + i; index 0 lies at the axial (-k, k) and the index runs clockwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import layout as native

NEIGHBOUR_STEPS = np.array(
    [[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]], np.int32
)  # (6, 2) axial steps from a marker to its neighbours; as in native/layout/lattice.hpp


def layer_of(q: int, r: int) -> int:
    """The layer of the marker at the axial (q, r)."""
    return native.layer_of(q, r)


def marker_id(q: int, r: int) -> int:
    """The id of the marker at the axial (q, r)."""
    return native.marker_id(q, r)


def axial_coordinates(layer: NDArray[np.int32], index: NDArray[np.int32]) -> NDArray[np.int32]:
    """(M, 2) int32 axial coordinates (q, r) of the markers with these layers (M,) and indices (M,)."""
    k = np.maximum(layer, 1)
    sextant, steps = np.divmod(index, k)
    corner_q = np.array([-1, 0, 1, 1, 0, -1])[sextant] * layer
    corner_r = np.array([1, 1, 0, -1, -1, 0])[sextant] * layer
    step_q = np.array([1, 1, 0, -1, -1, 0])[sextant] * steps
    step_r = np.array([0, -1, -1, 0, 1, 1])[sextant] * steps
    return np.stack([corner_q + step_q, corner_r + step_r], axis=1).astype(np.int32)
