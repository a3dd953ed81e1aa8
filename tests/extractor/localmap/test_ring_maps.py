"""Maps through two rings: those laid side by side are those laid alone, and least squares.

Inside: which neighbours an image leaves a marker cannot be chosen one by one, and least squares by numpy can.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor.layout.lattice import axial_coordinates
from extractor.layout.neighbour_tables import MIN_LINEAR_NEIGHBOURS, MIN_QUADRATIC_NEIGHBOURS, neighbour_table
from extractor.localmap.neighbour_prediction import predict_markers
from extractor.numeric.batched_systems import LANES

LAYERS = 5


@pytest.fixture
def lattice() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Places in the layout, mm, and the two rings around each."""
    layer = np.repeat(np.arange(LAYERS + 1), [1, *(6 * k for k in range(1, LAYERS + 1))])
    index = np.concatenate([[0], *(np.arange(6 * k) for k in range(1, LAYERS + 1))])
    at = axial_coordinates(layer.astype(np.int32), index.astype(np.int32))
    return at @ np.array([[1.5, 0.0], [0.75, 1.3]]), neighbour_table(at, LAYERS)


def seen(mm: NDArray[np.float64], gone: float) -> NDArray[np.float64]:
    """Places in the image, px, of a bent pattern, some of them unknown."""
    rng = np.random.default_rng(7)
    x, y = mm.T
    xy = np.stack([320 + 20 * x + 0.3 * x * y, 240 - 19 * y + 0.2 * x * x], axis=1)
    xy += rng.normal(0.0, 0.3, xy.shape)
    xy[rng.random(len(xy)) < gone] = np.nan
    return xy


@pytest.mark.parametrize("gone", [0.0, 0.2, 0.55, 0.9])
def test_markers_are_predicted_together_as_alone(
    lattice: tuple[NDArray[np.float64], NDArray[np.int32]], gone: float
) -> None:
    mm, table = lattice
    xy, alone = seen(mm, gone), np.zeros(len(mm), np.bool_)
    assert len(mm) > 2 * LANES
    together = predict_markers(xy, ~alone, mm, table)
    for m in range(len(mm)):
        alone[:] = False
        alone[m] = True
        for one, many in zip(predict_markers(xy, alone, mm, table), together, strict=True):
            assert np.array_equal(one[m], many[m], equal_nan=True)


@pytest.mark.parametrize("gone", [0.0, 0.2, 0.55])
def test_a_prediction_is_least_squares(
    lattice: tuple[NDArray[np.float64], NDArray[np.int32]], gone: float
) -> None:
    mm, table = lattice
    xy = seen(mm, gone)
    place, variance, leverage, support = predict_markers(xy, np.ones(len(mm), np.bool_), mm, table)
    for m in np.flatnonzero(np.isfinite(place[:, 0])):
        near = [j for j in table[m] if j >= 0 and np.isfinite(xy[j, 0])]
        assert support[m] == len(near) >= MIN_LINEAR_NEIGHBOURS
        x, y = (mm[near] - mm[m]).T
        rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
        rows = rows[:, : 6 if len(near) >= MIN_QUADRATIC_NEIGHBOURS else 3]
        terms = np.linalg.lstsq(rows, xy[near], rcond=None)[0]
        left = ((rows @ terms - xy[near]) ** 2).sum() / (2 * max(len(near) - rows.shape[1], 1))
        assert place[m] == pytest.approx(terms[0], abs=1e-6)
        assert variance[m] == pytest.approx(left, abs=1e-6)
        assert leverage[m] == pytest.approx(np.linalg.inv(rows.T @ rows)[0, 0], rel=1e-6)
