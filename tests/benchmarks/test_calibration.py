"""The figures of calibration are right for errors with a known distribution, and so are their intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.suites.scoring.calibration import (
    BEYOND_D2,
    COLUMNS,
    NOMINAL_BEYOND_SHARE,
    calibration_table,
    calibration_values,
    squared_distances,
    summarise,
)

PICTURES, MARKERS = 60, 300
COVARIANCE = np.array([[0.04, 0.015], [0.015, 0.01]])  # px^2


def normal_errors(seed: int, count: int = PICTURES * MARKERS) -> np.ndarray:
    return np.random.default_rng(seed).multivariate_normal((0, 0), COVARIANCE, count)


def pictures_of(error: np.ndarray, scale: float = 1.0) -> list[np.ndarray]:
    """Errors, in pictures of equal size, over ``scale`` times their covariance."""
    covariance = np.broadcast_to(scale * COVARIANCE, (len(error), 2, 2))
    return list(squared_distances(error, covariance).reshape(PICTURES, -1))


def test_normal_errors_have_nominal_figures() -> None:
    found = summarise(pictures_of(normal_errors(1)))
    assert (found.pictures, found.count, found.singular) == (PICTURES, PICTURES * MARKERS, 0)
    assert found.z.value == pytest.approx(1, abs=0.02) and found.median_z == pytest.approx(1, abs=0.02)
    assert found.beyond.value == pytest.approx(NOMINAL_BEYOND_SHARE, abs=0.0012)
    assert math.exp(-BEYOND_D2 / 2) == pytest.approx(NOMINAL_BEYOND_SHARE, rel=0.01)


def test_intervals_cover_the_nominal_figures_as_often_as_stated() -> None:
    found = [summarise(pictures_of(normal_errors(seed))) for seed in range(60)]
    for covered in (
        [one.z.low <= 1 <= one.z.high for one in found],
        [one.beyond.low <= NOMINAL_BEYOND_SHARE <= one.beyond.high for one in found],
    ):
        assert 0.85 <= np.mean(covered) <= 1.0


def test_a_covariance_four_times_too_large_gives_half_of_z() -> None:
    error = normal_errors(2)
    found, right = summarise(pictures_of(error, 4.0)), summarise(pictures_of(error))
    assert found.z.value == pytest.approx(right.z.value / 2) and found.z.high == pytest.approx(
        right.z.high / 2
    )
    assert found.median_z == pytest.approx(right.median_z / 2)
    assert found.beyond.value < 1e-4
    assert summarise(pictures_of(error, 0.25)).beyond.value == pytest.approx(
        math.exp(-BEYOND_D2 / 8), abs=0.01
    )


def test_correlated_markers_have_a_wider_interval() -> None:
    """Half of the variance is common to all markers of a picture."""
    rng = np.random.default_rng(3)
    common = np.repeat(rng.multivariate_normal((0, 0), COVARIANCE / 2, PICTURES), MARKERS, axis=0)
    own = rng.multivariate_normal((0, 0), COVARIANCE / 2, PICTURES * MARKERS)
    together, apart = summarise(pictures_of(common + own)), summarise(pictures_of(normal_errors(3)))
    assert together.z.high - together.z.low > 3 * (apart.z.high - apart.z.low)
    assert together.z.low < 1 < together.z.high


def test_the_same_pictures_give_the_same_interval() -> None:
    assert summarise(pictures_of(normal_errors(4))) == summarise(pictures_of(normal_errors(4)))


@settings(deadline=None)
@given(
    arrays(np.float64, (7, 2), elements=st.floats(-5, 5)),
    arrays(np.float64, (2, 2), elements=st.floats(-3, 3)),
)
def test_d2_is_the_same_in_other_coordinates(error: np.ndarray, change: np.ndarray) -> None:
    change = change + 8 * np.eye(2)
    covariance = np.broadcast_to(COVARIANCE, (7, 2, 2))
    expected = [e @ np.linalg.inv(COVARIANCE) @ e for e in error]
    np.testing.assert_allclose(squared_distances(error, covariance), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        squared_distances(error @ change.T, change @ covariance @ change.T), expected, rtol=1e-6, atol=1e-9
    )


def test_unknown_rows_are_not_counted_and_singular_covariances_are_beyond() -> None:
    error = np.array([(0.1, 0.1), (np.nan, 0.1), (0.1, 0.1), (0.2, 0.1), (0.0, 0.0), (0.1, 0.2)])
    covariance = np.array([COVARIANCE] * 6)
    covariance[2] = np.nan
    covariance[3] = [[1, 1], [1, 1]]
    covariance[4] = 0
    covariance[5] = [[1, 0], [0, -1]]
    d2 = squared_distances(error, covariance)
    assert np.isfinite(d2).tolist() == [True, False, False, False, False, False]
    assert np.isnan(d2).tolist() == [False, True, True, False, False, False] and np.isinf(d2[3:]).all()
    found = summarise([d2])
    assert (found.count, found.singular, found.beyond.value) == (4, 3, 0.75)
    assert found.z.value == pytest.approx(math.sqrt(d2[0] / 2))


def test_few_pictures_have_no_interval_and_none_has_no_figure() -> None:
    one = summarise([np.ones(5), np.full(3, np.nan), np.empty(0)])
    assert (one.pictures, one.count) == (1, 5) and math.isnan(one.z.low)
    assert summarise([]).count == 0 and math.isnan(summarise([]).z.value)
    assert squared_distances(np.empty((0, 2)), np.empty((0, 2, 2))).shape == (0,)
    (cells,) = calibration_table("", {"": summarise([])}).cells()
    assert cells == ["", "0", "0", "-", "- -", "-", "-", "- -", "0"]


def test_a_row_has_the_columns_of_its_head() -> None:
    found = summarise(pictures_of(normal_errors(5)))
    head, line = str(calibration_table("", {"dirt": found})).splitlines()
    assert len(head) == len(line) and len(calibration_values(found)) == len(COLUMNS)
    assert line.startswith("dirt ") and f"{found.z.low:.2f} {found.z.high:.2f}" in line
    infinite = summarise([np.array([1.0, np.inf, np.inf, np.inf])])
    assert calibration_values(infinite)[-1] == infinite.singular == 3
