"""Maps through two rings: those laid side by side are those laid alone, and least squares.

Inside: which neighbours an image leaves a marker cannot be chosen one by one, and least squares by numpy can.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor import parse_layout
from extractor.layout.lattice_tables import lattice_of
from extractor.localmap.neighbour_prediction import predict_markers
from tests.support.layouts import small_text

LAYERS = 5
FEWEST, FEWEST_QUADRATIC = 4, 9  # neighbours of a plane, and of a quadratic


@pytest.fixture
def lattice() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Places in the layout, mm, and the two rings around each."""
    found = lattice_of(parse_layout(small_text("honeycomb", LAYERS)))
    return found.marker_mm, found.neighbours


def seen(mm: NDArray[np.float64], gone: float) -> NDArray[np.float64]:
    """Places in the image, px, of a bent pattern, some of them unknown."""
    rng = np.random.default_rng(7)
    x, y = mm.T
    xy = np.stack([320 + 20 * x + 0.3 * x * y, 240 - 19 * y + 0.2 * x * x], axis=1)
    xy += rng.normal(0.0, 0.3, xy.shape)
    xy[rng.random(len(xy)) < gone] = np.nan
    return xy


def noise_of(mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """The variances of the places, px^2."""
    return np.random.default_rng(8).uniform(0.5, 2.0, len(mm))


@pytest.mark.parametrize("gone", [0.0, 0.2, 0.55, 0.9])
def test_markers_are_predicted_together_as_alone(
    lattice: tuple[NDArray[np.float64], NDArray[np.int32]], gone: float
) -> None:
    mm, table = lattice
    xy, alone = seen(mm, gone), np.zeros(len(mm), np.bool_)
    assert len(mm) == 91  # many times as many as are solved side by side
    noise = noise_of(mm)
    together = predict_markers(xy, noise, ~alone, mm, table)
    for m in range(len(mm)):
        alone[:] = False
        alone[m] = True
        for one, many in zip(predict_markers(xy, noise, alone, mm, table), together, strict=True):
            assert np.array_equal(one[m], many[m], equal_nan=True)


@pytest.mark.parametrize("origin_px", [0.0, 1e4, 1e6])
@pytest.mark.parametrize("gone", [0.0, 0.2, 0.55])
def test_a_prediction_is_least_squares(
    lattice: tuple[NDArray[np.float64], NDArray[np.int32]], gone: float, origin_px: float
) -> None:
    """Far from the origin, as in a window of a stitched picture, too: every fit is about its own middle."""
    mm, table = lattice
    xy = seen(mm, gone) + origin_px
    noise = noise_of(mm)
    place, variance, leverage, by_noise, noise_around, support = predict_markers(
        xy, noise, np.ones(len(mm), np.bool_), mm, table
    )
    for m in np.flatnonzero(np.isfinite(place[:, 0])):
        near = [j for j in table[m] if j >= 0 and np.isfinite(xy[j, 0])]
        assert support[m] == len(near) >= FEWEST
        x, y = (mm[near] - mm[m]).T
        rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
        rows = rows[:, : 6 if len(near) >= FEWEST_QUADRATIC else 3]
        terms = np.linalg.lstsq(rows, xy[near], rcond=None)[0]
        terms = terms + np.linalg.lstsq(rows, xy[near] - rows @ terms, rcond=None)[0]
        left = ((rows @ terms - xy[near]) ** 2).sum() / (2 * max(len(near) - rows.shape[1], 1))
        assert place[m] == pytest.approx(terms[0], abs=1e-6)
        assert variance[m] == pytest.approx(left, abs=1e-6)
        inverse = np.linalg.inv(rows.T @ rows)
        assert leverage[m] == pytest.approx(inverse[0, 0], rel=1e-6)
        assert by_noise[m] == pytest.approx((inverse[0] @ rows.T) ** 2 @ noise[near], rel=1e-6)
        assert noise_around[m] == pytest.approx(noise[near].mean())


def test_quadratics_through_too_few_or_repeated_points_are_refused(
    lattice: tuple[NDArray[np.float64], NDArray[np.int32]],
) -> None:
    """Neighbours in any number, on one line, and all on one point."""
    mm, table = lattice
    wanted, exact = np.zeros(len(mm), np.bool_), np.zeros(len(mm))
    wanted[0] = True
    for known in range(19):
        xy = np.full_like(mm, np.nan)
        xy[table[0, :known]] = 20.0 * mm[table[0, :known]]
        place = predict_markers(xy, exact, wanted, mm, table)[0][0]
        assert np.isnan(place).all() or np.abs(place - 20.0 * mm[0]).max() < 1e-6
        assert known >= 4 or np.isnan(place).all()
    line = np.abs(mm[table[0], 1]) < 1e-9
    assert line.sum() >= 4
    xy = np.full_like(mm, np.nan)
    xy[table[0][line]] = mm[table[0][line]]
    assert np.isnan(predict_markers(xy, exact, wanted, mm, table)[0]).all()
    repeated = np.repeat(table[:, :1], table.shape[1], axis=1)
    assert np.isnan(predict_markers(20.0 * mm, exact, wanted, mm, repeated)[0]).all()
    assert np.isfinite(predict_markers(np.full_like(mm, 7.0), exact, wanted, mm, table)[0][0]).all()
