"""The measures of the experiments on point sets with known results."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmpdesign.evaluation.article_results import change_percent
from cmpdesign.evaluation.measures.edge_points import (
    circumscribed_square_mm,
    edge_points,
    mean_extent_mm,
    shear_response,
)
from cmpdesign.evaluation.report.statistics import (
    SuccessShare,
    round_for_json,
    sample_statistics,
    wilson_interval,
)


@pytest.mark.parametrize(
    ("successful", "trials", "low", "high"),
    # Newcombe, Statistics in Medicine 17 (1998), table I, method 3 (Wilson's score interval).
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (10, 10, 0.7225, 1.0),
    ],
)
def test_wilsons_interval(successful: int, trials: int, low: float, high: float) -> None:
    assert wilson_interval(successful, trials) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 2000), st.data())
def test_wilsons_interval_holds_the_share_and_is_symmetric(trials: int, data: st.DataObject) -> None:
    successful = data.draw(st.integers(0, trials))
    low, high = wilson_interval(successful, trials)
    assert 0 <= low <= successful / trials <= high <= 1
    mirrored = wilson_interval(trials - successful, trials)
    assert (1 - mirrored[1], 1 - mirrored[0]) == pytest.approx((low, high), abs=1e-12)


def test_nothing_tried_says_nothing() -> None:
    assert wilson_interval(0, 0) == (0.0, 1.0)
    assert SuccessShare(0, 0).to_json()["share"] is None
    with pytest.raises(ValueError, match="3 of 2"):
        SuccessShare(2, 3)


def test_a_spread_leaves_out_what_is_missing() -> None:
    found = sample_statistics([1.0, 3.0, None, float("nan")])  # type: ignore[list-item]
    assert (found.count, found.mean, found.low, found.high) == (2, 2.0, 1.0, 3.0)
    assert found.deviation == pytest.approx(np.sqrt(2))
    assert sample_statistics([]).to_json() == dict.fromkeys(sample_statistics([]).to_json(), None) | {
        "count": 0
    }
    assert round_for_json(float("nan")) is None and round_for_json(1.23456789) == 1.234568


def lattice(step_x: float, step_y: float, offset: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    x, y = np.meshgrid(np.arange(-12, 13) * step_x + offset[0], np.arange(-12, 13) * step_y + offset[1])
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


def pressed(points: np.ndarray, side_mm: float) -> np.ndarray:
    """1 mm deep under a square, 0.4 mm around it."""
    under = (np.abs(points[:, :2]) <= side_mm / 2).all(axis=1)
    moved = np.zeros_like(points)
    moved[:, 2] = np.where(under, -1.0, -0.4)
    return moved


@pytest.mark.parametrize(("offset", "side"), [((0.0, 0.0), 15.0), ((0.7, 0.0), 15.0), ((0.7, 0.7), 13.5)])
def test_a_square_lattice_shows_a_cube_in_steps_of_its_pitch(
    offset: tuple[float, float], side: float
) -> None:
    points = lattice(1.5, 1.5, offset)
    chosen = edge_points(points, pressed(points, 15.0), (0.0, 0.0, -1.0))
    assert circumscribed_square_mm(chosen.xy_mm) == pytest.approx(side)


def test_the_square_has_the_larger_of_width_and_height() -> None:
    points = lattice(1.5, 1.3)
    chosen = edge_points(points, pressed(points, 15.0), (0.0, 0.0, -1.0))
    assert circumscribed_square_mm(chosen.xy_mm) == pytest.approx(15.0)
    assert mean_extent_mm(chosen.xy_mm) == pytest.approx((15.0 + 13.0) / 2)


@given(st.floats(-180, 180), st.floats(-5, 5), st.floats(-5, 5))
def test_the_square_turns_and_moves_with_the_object(turn_deg: float, x: float, y: float) -> None:
    points = lattice(1.5, 1.5)[:, :2]
    angle = np.radians(turn_deg)
    turned = points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) + [x, y]
    assert circumscribed_square_mm(turned, turn_deg) == pytest.approx(36.0)


def test_lost_markers_are_no_edge_points_and_none_give_no_square() -> None:
    points = lattice(1.5, 1.5)
    moved = pressed(points, 15.0)
    moved[np.abs(points[:, 0]) > 5] = np.nan
    chosen = edge_points(points, moved, (0.0, 0.0, -1.0))
    assert np.ptp(chosen.xy_mm[:, 0]) == pytest.approx(9.0)
    nothing = edge_points(points, np.full_like(moved, np.nan), (0.0, 0.0, -1.0))
    assert circumscribed_square_mm(nothing.xy_mm) is None and shear_response(nothing, 1.0) is None
    assert mean_extent_mm(nothing.xy_mm) is None


def test_the_response_is_the_mean_share_of_the_shear() -> None:
    points = lattice(1.5, 1.5)
    moved = np.zeros_like(points)
    moved[:, 1] = np.where(points[:, 0] < 0, 1.6, np.where(points[:, 0] == 0, 1.0, 0.7))
    chosen = edge_points(points, moved, (0.0, 1.0, 0.0))
    assert shear_response(chosen, 2.0) == pytest.approx((12 * 1.6 + 1.0) / 13 / 2)


def test_changes_are_in_percent_of_the_square_pattern() -> None:
    assert change_percent(2.0, 0.776) == -61.2
    assert change_percent(0.0, 1.0) is None and change_percent(None, 1.0) is None
