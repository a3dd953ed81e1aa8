"""Values drawn from a plan's distributions: within their limits, in their shares, and refused where they are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmpdesign import CmpDesignError
from cmpdesign.data.frames.distributions import ABSENT, check_distributions, draw, value_at, varying_leaves


def draws(value: Any, count: int = 2000) -> list[Any]:
    rng = np.random.default_rng(5)
    check_distributions(value, "scene")
    return [draw(value, rng) for _ in range(count)]


def test_numbers_lie_within_their_limits_and_fill_them() -> None:
    uniform = np.array(draws({"uniform": [-2, 6]}))
    assert -2 <= uniform.min() < -1.9 and 5.9 < uniform.max() <= 6 and abs(uniform.mean() - 2) < 0.2
    decades = np.log10(draws({"log_uniform": [0.01, 100]}))
    assert decades.min() >= -2 and decades.max() <= 2 and abs(np.median(decades)) < 0.15
    normal = np.array(draws({"normal": [10, 2]}))
    assert abs(normal.mean() - 10) < 0.2 and abs(normal.std() - 2) < 0.1 and abs(normal - 10).max() <= 6
    whole = draws({"whole": [3, 5]})
    assert {type(each) for each in whole} == {int} and {3, 4, 5} == set(whole)


def test_choices_come_by_their_weights() -> None:
    found = draws({"choice": ["a", {"b": {"uniform": [1, 2]}}, "c"], "weights": [1, 3, 0]})
    tables = [each for each in found if isinstance(each, dict)]
    assert found.count("c") == 0 and 0.7 < len(tables) / len(found) < 0.8
    assert all(1 <= each["b"] <= 2 for each in tables) and len({each["b"] for each in tables}) > 1000


def test_repeats_and_chances() -> None:
    found = draws({"dirt": {"repeat": {"whole": [0, 2]}, "of": {"uniform": [0, 1]}}})
    assert {len(each["dirt"]) for each in found} == {0, 1, 2}
    assert all(one != other for each in found if len(each["dirt"]) == 2 for one, other in [each["dirt"]])
    glare = draws({"glare": {"chance": 0.25, "of": 7}, "other": 1})
    assert all(each in ({"glare": 7, "other": 1}, {"other": 1}) for each in glare)
    assert 0.2 < sum("glare" in each for each in glare) / len(glare) < 0.3
    assert draws({"chance": 0.0, "of": 7}, 1) == [ABSENT]


def test_what_varies_has_a_column() -> None:
    scene = {
        "size_px": [640, 480],
        "kind": {"choice": [{"name": "ball", "at": [{"uniform": [0, 1]}, 0]}, {"name": "cube"}]},
        "dirt": {"repeat": 2, "of": {"radius": {"uniform": [0, 1]}}},
    }
    assert sorted(dict(varying_leaves(scene))) == ["dirt.count", "kind.at.0", "kind.at.1", "kind.name"]
    drawn = draw(scene, np.random.default_rng(0))
    assert value_at(drawn, "dirt.count") == 2 and value_at(drawn, "size_px.1") == 480
    assert value_at({"kind": {"name": "cube"}}, "kind.at.0") is None


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({"uniform": [2, 1]}, "uniform is [2, 1]; it must be [low, high] with low <= high"),
        ({"uniform": [1, 2], "normal": [0, 1]}, "normal is not allowed with uniform"),
        ({"log_uniform": [0, 1]}, "0 < low <= high"),
        ({"normal": [0, -1]}, "the deviation 0 or more"),
        ({"whole": [0.5, 2]}, "whole numbers"),
        ({"choice": []}, "a list of one value or more"),
        ({"choice": [1, 2], "weights": [1]}, "weights is [1]; it must be 2 numbers of 0 or more"),
        ({"choice": [1, 2], "weights": [0, 0]}, "not all 0"),
        ({"repeat": {"uniform": [0, 2]}, "of": 1}, "a whole number from 0 to 1000"),
        ({"repeat": 2}, "repeat needs of"),
        ({"chance": 1.5, "of": 1}, "chance is 1.5; it must be a number from 0 to 1"),
        ([{"chance": 0.5, "of": 1}], "chance is not allowed in a list"),
        ({"repeat": 1, "of": {"x": {"uniform": ["a", 2]}}}, "uniform is ['a', 2]"),
    ],
)
def test_what_is_no_distribution_is_named(value: Any, said: str) -> None:
    with pytest.raises(CmpDesignError) as error:
        check_distributions({"light": value}, "scene")
    assert str(error.value).startswith("scene.light") and said in str(error.value)
