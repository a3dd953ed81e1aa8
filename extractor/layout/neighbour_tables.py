"""The markers in the two rings around each marker, and the weights by which they predict the marker's place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import layout as native

QUADRATIC_TERMS = 6  # of a quadratic map: 1, x, y, x^2, xy, y^2 in units of the local edge
LINEAR_TERMS = 3  # of a linear map: 1, x, y
MIN_EIGENVALUE = 1e-7  # of the normal equations, a neighbour
RING_STEPS = np.array(
    [[q, r] for q in range(-2, 3) for r in range(-2, 3) if abs(q + r) <= 2 and (q, r) != (0, 0)], np.int32
)  # (18, 2) axial steps to the markers of the two rings
FIRST_RING = np.flatnonzero([max(abs(q), abs(r), abs(q + r)) == 1 for q, r in RING_STEPS])  # (6,)


def neighbour_table(axial: NDArray[np.int32], layers: int) -> NDArray[np.int32]:
    """(M, 18) int32, the ids of the markers in the two rings around each marker at (M, 2); -1 outside the pattern."""
    return native.neighbour_ids(axial, RING_STEPS, layers)


def ring_weights(marker_mm: NDArray[np.float64], table: NDArray[np.int32]) -> NDArray[np.float64]:
    """(M, 18) float64 weights of the neighbours ``table`` (M, 18) whose weighted sum is a marker's place.

    The weights are those of the least-squares map of ``predict_markers`` with all neighbours known: quadratic, or
    linear with few neighbours. They are 0 where the neighbours are too few.
    """
    exists = table >= 0
    vectors = np.where(exists[..., None], marker_mm[table] - marker_mm[:, None], 0.0)
    count = exists.sum(axis=1)
    scale = np.linalg.norm(vectors, axis=2).sum(axis=1) / np.maximum(count, 1)
    x, y = np.moveaxis(vectors / np.maximum(scale, 1e-12)[:, None, None], 2, 0)
    rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2) * exists[..., None]
    weights = np.zeros(table.shape)
    quadratic = count >= native.MIN_QUADRATIC_NEIGHBOURS
    for terms, selected in (
        (QUADRATIC_TERMS, quadratic),
        (LINEAR_TERMS, (count >= native.MIN_LINEAR_NEIGHBOURS) & ~quadratic),
    ):
        map_rows = rows[selected, :, :terms]
        gram = np.swapaxes(map_rows, 1, 2) @ map_rows
        regular = np.linalg.eigvalsh(gram)[:, 0] > MIN_EIGENVALUE * count[selected]
        first = np.linalg.solve(gram[regular], np.eye(terms)[:, :1])
        weights[np.flatnonzero(selected)[regular]] = (map_rows[regular] @ first)[..., 0]
    return weights
