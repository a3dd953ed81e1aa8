"""Single cells: deformations have the stated size, and recognition ends at the limit of the formulas."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.evaluation import angles
from cmpdesign.evaluation.measures.single_cells import (
    bend_corner,
    draw_cell,
    find_cell_corners,
    is_numbering_kept,
    is_shape_recognised,
    match_corners_by_direction,
    regular_cell,
    turn_cell,
)


def inner_angle_deg(corners: np.ndarray) -> float:
    """The angle at the first corner, from 0 to 360 deg, inside a polygon that is clockwise in the image."""
    one, other = corners[1] - corners[0], corners[-1] - corners[0]
    return float(np.degrees(np.arctan2(one[0] * other[1] - one[1] * other[0], one @ other)) % 360)


@pytest.mark.parametrize("sides", angles.CELL_SIDES)
@pytest.mark.parametrize("change_deg", [0, 20, 59, 75])
def test_bending_opens_the_first_corner_by_that_much(sides: int, change_deg: float) -> None:
    at_rest = regular_cell(sides, 100)
    assert inner_angle_deg(at_rest) == pytest.approx(180 - 360 / sides)
    assert inner_angle_deg(bend_corner(at_rest, change_deg)) == pytest.approx(180 - 360 / sides + change_deg)


@pytest.mark.parametrize("sides", angles.CELL_SIDES)
def test_a_cell_at_rest_is_recognised_where_it_lies(sides: int) -> None:
    corners = turn_cell(regular_cell(sides, 60), 7)
    picture, origin = draw_cell(corners)
    found = find_cell_corners(picture, sides)
    assert found is not None
    nearest = np.linalg.norm(found[:, None] - origin - corners, axis=2).min(axis=0)
    assert nearest.max() < 3.5


@pytest.mark.parametrize("sides", angles.CELL_SIDES)
def test_the_shape_is_lost_before_the_formulas_limit_and_not_long_before(sides: int) -> None:
    limit = angles.change_limit_deg(sides)
    assert is_shape_recognised(sides, 400, limit - 8)
    assert not is_shape_recognised(sides, 400, limit + 1)


@pytest.mark.parametrize("sides", angles.CELL_SIDES)
def test_the_number_is_lost_at_the_formulas_limit(sides: int) -> None:
    limit = angles.turn_limit_deg(sides)
    assert is_numbering_kept(sides, 100, limit - 2) and is_numbering_kept(sides, 100, -(limit - 2))
    assert not is_numbering_kept(sides, 100, limit + 2)


def test_the_nearest_direction_decides() -> None:
    at_rest = regular_cell(4, 10)
    assert match_corners_by_direction(turn_cell(at_rest, 44), at_rest).tolist() == [0, 1, 2, 3]
    assert match_corners_by_direction(turn_cell(at_rest, 46), at_rest).tolist() == [1, 2, 3, 0]


def test_the_first_angle_lost_is_the_first() -> None:
    assert angles.first_lost_deg(lambda angle: angle < 10.2, 40) == 11.0
    assert angles.first_lost_deg(lambda angle: True, 40) is None
