"""Which markers lie in the two rings around each one, and the weights by which they predict its place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice import layer_of, marker_id
from extractor.numeric.compilation import compiled

QUADRATIC_TERMS, RIGHT_SIDES = (
    6,
    3,
)  # 1, x, y, x^2, xy, y^2 in units of the local edge; right sides: x, y and the leverage
LINEAR_TERMS = 3  # the terms of a linear map
MIN_PIVOT = 1e-7


RING_STEPS = np.array(
    [[q, r] for q in range(-2, 3) for r in range(-2, 3) if abs(q + r) <= 2 and (q, r) != (0, 0)], np.int32
)


FIRST_RING = np.flatnonzero([max(abs(q), abs(r), abs(q + r)) == 1 for q, r in RING_STEPS])


MIN_QUADRATIC_NEIGHBOURS = 9  # neighbours for the quadratic; fewer get the linear map


MIN_LINEAR_NEIGHBOURS = 4


@compiled
def _neighbour_ids(axial, layers):  # type: ignore[no-untyped-def]
    out = np.full((axial.shape[0], RING_STEPS.shape[0]), -1, np.int32)
    for m in range(axial.shape[0]):
        for k in range(RING_STEPS.shape[0]):
            q, r = axial[m, 0] + RING_STEPS[k, 0], axial[m, 1] + RING_STEPS[k, 1]
            if layer_of(q, r) <= layers:
                out[m, k] = marker_id(q, r)
    return out


def neighbour_table(axial: NDArray[np.int32], layers: int) -> NDArray[np.int32]:
    """(M, 18) int32 ids of the markers in the two rings around each one; -1 beyond the pattern."""
    return np.asarray(_neighbour_ids(axial, layers))


def inward_neighbour_table(axial: NDArray[np.int32], layer: NDArray[np.int32]) -> NDArray[np.int32]:
    """(M, 18) int32: for markers of the outermost layer, the nearest ones of the other layers; else -1."""
    from scipy.spatial import cKDTree

    table = np.full((len(layer), len(RING_STEPS)), -1, np.int32)
    outer, inner = np.flatnonzero(layer == layer.max()), np.flatnonzero(layer < layer.max())
    count = min(len(RING_STEPS), len(inner))
    place = axial @ np.array([[1.0, 0.0], [0.5, 0.75**0.5]])
    near = cKDTree(place[inner]).query(place[outer], count)[1].reshape(len(outer), -1)
    table[outer, :count] = inner[near]
    return table


def ring_weights(marker_mm: NDArray[np.float64], table: NDArray[np.int32]) -> NDArray[np.float64]:
    """(M, 18) weights that give a marker's place from all neighbours that the pattern has, as ``predicted`` does; 0
    where these are too few."""
    there = table >= 0
    arms = np.where(there[..., None], marker_mm[table] - marker_mm[:, None], 0.0)
    count = there.sum(axis=1)
    scale = np.linalg.norm(arms, axis=2).sum(axis=1) / np.maximum(count, 1)
    x, y = np.moveaxis(arms / np.maximum(scale, 1e-12)[:, None, None], 2, 0)
    rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2) * there[..., None]
    weights = np.zeros(table.shape)
    quadratic = count >= MIN_QUADRATIC_NEIGHBOURS
    for terms, use in (
        (QUADRATIC_TERMS, quadratic),
        (LINEAR_TERMS, (count >= MIN_LINEAR_NEIGHBOURS) & ~quadratic),
    ):
        map_rows = rows[use, :, :terms]
        gram = np.swapaxes(map_rows, 1, 2) @ map_rows
        sound = np.linalg.eigvalsh(gram)[:, 0] > MIN_PIVOT * count[use]
        solved = np.linalg.solve(gram[sound], np.swapaxes(map_rows[sound], 1, 2))[:, 0]
        weights[np.flatnonzero(use)[sound]] = solved
    return weights
