"""The response: from values to light and back, and refused responses.

Inside: a table that is wrong by one value moves markers by less than their noise.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from extractor import Extractor, parse_layout
from extractor.image.response import (
    Response,
    decode_values,
    encode_light,
    light_of_values,
    response_tables,
)
from tests.support.layouts import small_text
from tests.support.pictures import srgb_light

ALL = np.arange(256) / 255


def responses() -> st.SearchStrategy[Any]:
    """All kinds of them; tables whose steps differ by up to 1:100."""
    table = st.lists(st.floats(0.01, 1.0), min_size=255, max_size=255).map(
        lambda steps: [0.0, *np.cumsum(steps)]
    )
    return st.one_of(st.sampled_from(["srgb", "linear"]), st.floats(0.2, 5.0), table)


def test_srgb_is_that_of_the_standard() -> None:
    """The standard rounds its constants: its line has the slope 1 / 12.92, the line that touches has 1 / 12.9232."""
    np.testing.assert_allclose(light_of_values("srgb"), srgb_light(np.arange(256)), atol=0.002, rtol=3e-4)


def test_known_values_of_srgb() -> None:
    light = light_of_values("srgb")
    assert light[0] == 0.0 and light[255] == 255.0
    assert light[10] / 255 == pytest.approx(10 / 255 / 12.92, rel=3e-4)  # on the straight line
    assert light[128] / 255 == pytest.approx(0.2158605, rel=1e-5)
    assert light[188] / 255 == pytest.approx(0.5028865, rel=1e-5)


def test_linear_changes_nothing() -> None:
    np.testing.assert_allclose(light_of_values("linear"), np.arange(256), rtol=1e-14)
    values = np.linspace(-3, 300, 1000)
    np.testing.assert_allclose(
        decode_values(values[10:800], light_of_values("linear")), values[10:800], rtol=1e-13
    )
    np.testing.assert_allclose(
        encode_light(np.linspace(0, 400, 99), light_of_values("linear")), np.linspace(0, 400, 99), rtol=1e-13
    )


@pytest.mark.parametrize("exponent", [0.2, 0.45, 1, 1.0, 2.2, 5, np.float32(2.2), np.int64(2)])
def test_an_exponent_is_the_power_of_values(exponent: float) -> None:
    np.testing.assert_allclose(light_of_values(exponent), 255 * ALL**exponent, rtol=1e-6)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 65535.0])
def test_a_table_may_have_any_unit(unit: float) -> None:
    table = unit * (0.01 + ALL**1.7)
    for given_as in (table, table.tolist(), tuple(table), table.astype(np.float32)):
        np.testing.assert_allclose(light_of_values(given_as), 255 * table / table[-1], rtol=1e-6)


def test_a_table_of_whole_numbers_is_one_too() -> None:
    np.testing.assert_array_equal(light_of_values(list(range(256))), np.arange(256))


@given(responses(), st.lists(st.floats(0, 255), min_size=1, max_size=50))
def test_values_come_back_from_their_light(response: Response, values: list[float]) -> None:
    light = light_of_values(response)
    assert (np.diff(light) > 0).all() and light[-1] == 255
    back = encode_light(decode_values(np.array(values), light), light)
    np.testing.assert_allclose(back, values, atol=1e-6)
    np.testing.assert_array_equal(
        encode_light(decode_values(np.arange(256), light), light).round(), np.arange(256)
    )


@given(responses(), st.lists(st.floats(0, 2000), min_size=1, max_size=50))
def test_more_light_has_a_larger_value(response: Response, light: list[float]) -> None:
    values = encode_light(np.sort(light), light_of_values(response))
    assert (np.diff(values) >= 0).all()
    assert ((values > 255) == (np.sort(light) > 255)).all() or np.isclose(values, 255).any()


@given(responses(), st.floats(0, 255))
def test_the_tables_hold_the_light_and_the_values(response: Response, root: float) -> None:
    """The position of light is at most half an entry away; the value lies between the values of the entries around."""
    light_of_value = light_of_values(response)
    tables = response_tables(light_of_value)
    np.testing.assert_allclose(tables.light, light_of_value, rtol=1e-6)
    values = tables.encoded[::2]
    entry_light = 255 * (np.arange(len(values)) / (len(values) - 1)) ** 2
    np.testing.assert_allclose(values, encode_light(entry_light, light_of_value), rtol=1e-5, atol=1e-4)
    assert (tables.encoded[1::2] > 0).all() and (np.diff(values) >= 0).all()


def test_slopes_are_derivatives_of_the_value_by_light() -> None:
    tables = response_tables(light_of_values("srgb"))
    light = 255 * (np.arange(2048) / 2047) ** 2
    inside = slice(100, 2040)
    step = 1e-3 * light[inside]
    bright, dark = (
        255 * (1.055 * ((light[inside] + sign * step) / 255) ** (1 / 2.4) - 0.055) for sign in (1, -1)
    )
    curved = light[inside] > 0.9  # above the straight line
    np.testing.assert_allclose(
        tables.encoded[1::2][inside][curved], ((bright - dark) / (2 * step))[curved], rtol=0.04
    )


TABLE = np.linspace(0, 1, 256)
WITH_NAN, FALLING, NEGATIVE = TABLE.copy(), TABLE.copy(), TABLE - 0.1
WITH_NAN[7], FALLING[100] = np.nan, 0.1
NAMES = "give 'srgb', 'linear', an exponent or a table of 256 values"


@pytest.mark.parametrize(
    ("response", "message"),
    [
        ("sRGB", f"response is 'sRGB'; {NAMES}"),
        ("auto", f"response is 'auto'; {NAMES}"),
        ("", f"response is ''; {NAMES}"),
        ("2.2", f"response is '2.2'; {NAMES}"),
        (True, f"response is True; {NAMES}"),
        (np.False_, f"response is (np.)?False_?; {NAMES}"),
        (2j, f"response is 2j; {NAMES}"),
        ({}, f"response is {{}}; {NAMES}"),
        ([True] * 256, f"response is .*; {NAMES}"),
        (["0"] * 256, f"response is .*; {NAMES}"),
        (0.19, "response is the exponent 0.19; it must lie between 0.2 and 5"),
        (5.01, "response is the exponent 5.01; it must lie between 0.2 and 5"),
        (0, "response is the exponent 0; it must lie between 0.2 and 5"),
        (-2.2, "response is the exponent -2.2; it must lie between 0.2 and 5"),
        (np.nan, "response is the exponent nan; it must lie between 0.2 and 5"),
        (np.inf, "response is the exponent inf; it must lie between 0.2 and 5"),
        (TABLE[:-1], r"response is a table of shape \(255,\); give 256 values, one for each 8-bit value"),
        (np.ones((256, 3)), r"response is a table of shape \(256, 3\); give 256 values"),
        (WITH_NAN, "response is a table with negative or infinite light; give finite values from 0 on"),
        (NEGATIVE, "response is a table with negative or infinite light; give finite values from 0 on"),
        (
            np.full(256, np.inf),
            "response is a table with negative or infinite light; give finite values from 0 on",
        ),
        (
            FALLING,
            r"does not rise from value 99 \(0.388235\) to the next \(0.1\); each value must stand for more",
        ),
        (np.zeros(256), r"does not rise from value 0 \(0\) to the next \(0\)"),
    ],
)
def test_what_is_no_response_is_refused(response: Any, message: str) -> None:
    layout = parse_layout(small_text())
    with pytest.raises(ValueError, match=message):
        light_of_values(response)
    with pytest.raises(ValueError, match=message):
        Extractor(layout, response=response)


def test_none_is_no_response_of_a_table() -> None:
    """None means two responses for the extractor, one for each depth."""
    with pytest.raises(ValueError, match=f"response is None; {NAMES}"):
        light_of_values(None)  # type: ignore[arg-type]
