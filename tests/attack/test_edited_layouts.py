"""Layouts edited in memory: the value is refused when it is made, or every picture is read without an error.

Native loops follow the indices of a layout without checks. The slow test reads 2,000 of these layouts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from extractor import Extractor, LayoutError, Reference, parse_layout
from tests.support.layouts import small_text
from tests.support.pictures import picture as shot

ARRAYS = ("layer", "index", "xy_mm", "cell_corners", "cell_color", "edges", "outline_mm", "fiducials_mm")
NUMBERS = ("reference_cell", "reference_marker", "virtual_per_edge")


@pytest.fixture(scope="module")
def pattern() -> Reference:
    return parse_layout(small_text())


@pytest.fixture(scope="module")
def picture() -> Any:
    return shot(layers=2).image


def edited_values(pattern: Reference, rng: np.random.Generator) -> Iterator[tuple[str, Any]]:
    """Without an end: a field and another value of it."""
    while True:
        if rng.random() < 0.1:
            yield str(rng.choice(NUMBERS)), int(rng.choice([-1, 0, 1, 3, 10**6, 2**40]))
            continue
        name = str(rng.choice([*ARRAYS, "xy_mm", "xy_mm"]))
        values = getattr(pattern, name).copy()
        if values.size:
            yield name, _edited(values, int(rng.integers(7)), rng)


def _edited(values: Any, way: int, rng: np.random.Generator) -> Any:
    is_length = values.dtype.kind == "f"
    at = tuple(rng.integers(side) for side in values.shape)
    extremes = {
        "f": [np.nan, np.inf, 1e300, 5e-324],
        "i": [-1, 2**30, -(2**31)],
        "u": [255, 5],
    }[values.dtype.kind]
    match way:
        case 0:
            values[at] = rng.choice(extremes)
        case 1:
            values[at] = values.flat[rng.integers(values.size)]
        case 2:
            return values[:-1]
        case 3:
            return values[::-1]
        case 4:
            return values.astype(np.int64 if is_length else np.float64)
        case 5 if is_length:
            return values * 10.0 ** rng.uniform(-320, 6)
        case 6 if is_length:
            values[:, rng.integers(2)] *= 10.0 ** rng.uniform(-20, 1)
        case _:
            return values.reshape(-1) if rng.random() < 0.5 else rng.permutation(values)
    return values


def attack(pattern: Reference, picture: Any, count: int, seed: int) -> dict[str, int]:
    """How many of the edited layouts were refused and read."""
    counts = {"refused": 0, "read": 0}
    values = edited_values(pattern, np.random.default_rng(seed))
    for _, (name, value) in zip(range(count), values, strict=False):
        try:
            changed = replace(pattern, **{name: value})
        except LayoutError as error:
            assert "\n" not in str(error)
            counts["refused"] += 1
            continue
        Extractor(changed).extract(picture)
        counts["read"] += 1
    return counts


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numpy, on layouts of extreme sizes
def test_an_edited_layout_is_refused_or_read(pattern: Reference, picture: Any) -> None:
    counts = attack(pattern, picture, 150, seed=1)
    assert counts["refused"] > 50 and counts["read"] > 20, counts


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_2000_edited_layouts_are_refused_or_read(pattern: Reference, picture: Any) -> None:
    counts = attack(pattern, picture, 2000, seed=2)
    assert counts["refused"] > 1000 and counts["read"] > 300, counts


@pytest.mark.parametrize(
    ("name", "edit", "said"),
    [
        ("cell_corners", lambda v: v + 2**20, r"cell_corners\[0\]\[0\] is 1.04"),
        ("cell_color", lambda v: v + 7, r"cell_color\[0\] is .*; expected a number from 0 to 4"),
        ("xy_mm", lambda v: v * 0, r"cells.corners\[0\] .* expected different markers"),
        ("xy_mm", lambda v: v * [1, 0], r"cells.corners\[0\] .* expected different markers"),
        ("xy_mm", lambda v: v * 1e-310, r"cells.corners\[0\] .* expected different markers"),
        ("xy_mm", lambda v: v.astype(np.float32), "xy_mm is of float32; expected an array of float64"),
        ("edges", lambda v: v[:, :1], r"edges is of the shape \(\d+, 1\); expected the shape \(N, 2\)"),
        ("edges", lambda v: v[:, ::-1], "edges is not contiguous"),
    ],
)
def test_the_message_names_the_array(pattern: Reference, name: str, edit: Any, said: str) -> None:
    with pytest.raises(LayoutError, match=said):
        Extractor(replace(pattern, **{name: edit(getattr(pattern, name))}))
