"""The definition of numbering: axial (q, r) <-> (layer, index) <-> id, for whole arrays.

    index 0 -> *---*         position = pitch * (q + r / 2, r * sqrt(3) / 2)
              / \\ / \\        spokes, clockwise from 120 degrees:
             *---0---*       (-1,1) (0,1) (1,0) (1,-1) (0,-1) (-1,0)
              \\ / \\ /
               *---*

Marker i of layer k has the id 3k(k-1) + 1 + i; marker 0 is layer 0. In layer k, spoke s is the index s*k.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

# Axial directions of the six spokes, clockwise from 120 degrees.
SPOKE_DIRECTIONS: Ints = np.array([(-1, 1), (0, 1), (1, 0), (1, -1), (0, -1), (-1, 0)], dtype=np.int64)
SPOKE_DIRECTIONS.setflags(write=False)


def marker_count(layers: int) -> int:
    """Markers in the layers 0 to ``layers``."""
    return 3 * layers * (layers + 1) + 1


def id_from_layer(layer: Ints, index: Ints) -> Ints:
    """Ids of the markers (layer, index). Shapes must match."""
    return np.where(layer > 0, 3 * layer * (layer - 1) + 1 + index, 0)


def layer_from_id(ids: Ints) -> tuple[Ints, Ints]:
    """Layer and index of every id; the inverse of ``id_from_layer``."""
    ids = np.asarray(ids, dtype=np.int64)
    # The first id of layer k is 3k(k-1) + 1. The next lower and higher layers are tested too, so that rounding
    # of the root cannot shift a layer.
    layer = np.rint(0.5 + np.sqrt(np.maximum(12 * ids - 3, 0)) / 6).astype(np.int64)
    layer = np.where(3 * layer * (layer - 1) + 1 > ids, layer - 1, layer)
    layer = np.where(3 * layer * (layer + 1) + 1 <= ids, layer + 1, layer)
    layer = np.where(ids > 0, layer, 0)
    index = np.where(layer > 0, ids - 3 * layer * (layer - 1) - 1, 0)
    return layer, index


def axial_from_layer(layer: Ints, index: Ints) -> tuple[Ints, Ints]:
    """Axial coordinates (q, r) of the markers (layer, index)."""
    divisor = np.maximum(layer, 1)
    sextant, step = index // divisor % 6, index % divisor
    # In sextant s the layer runs parallel to spoke s + 2.
    spoke, along = SPOKE_DIRECTIONS[sextant], SPOKE_DIRECTIONS[(sextant + 2) % 6]
    axial = layer[..., None] * spoke + step[..., None] * along
    return axial[..., 0], axial[..., 1]


def layer_from_axial(q: Ints, r: Ints) -> tuple[Ints, Ints]:
    """Layer and index of the axial coordinates; the inverse of ``axial_from_layer``."""
    q, r = np.asarray(q, dtype=np.int64), np.asarray(r, dtype=np.int64)
    layer = np.maximum(np.maximum(np.abs(q), np.abs(r)), np.abs(q + r))
    # The side of the layer on which a marker lies, clockwise. A spoke belongs to the side that starts there.
    sides = [
        (r == layer) & (q < 0),
        (q + r == layer) & (r > 0),
        (q == layer) & (r > -layer),
        (r == -layer) & (q > 0),
        (q + r == -layer) & (r < 0),
        (q == -layer) & (r < layer),
    ]
    steps = [layer + q, q, -r, layer - q, -q, r]
    index = np.select(sides, [s * layer + step for s, step in enumerate(steps)], 0)
    return layer, np.where(layer > 0, index, 0)


def id_from_axial(q: Ints, r: Ints) -> Ints:
    """Ids of the axial coordinates."""
    return id_from_layer(*layer_from_axial(q, r))
