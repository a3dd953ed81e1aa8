"""Quantities with units."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmpdesign.units import LENGTHS_MM, parse_angle_deg, parse_length_mm


@pytest.mark.parametrize(
    ("text", "mm"),
    [
        ("1.5mm", 1.5),
        ("60mil", 1.524),
        ("60 thou", 1.524),
        ("0.2in", 5.08),
        ('2"', 50.8),
        ("0.15cm", 1.5),
        ("250um", 0.25),
        ("250µm", 0.25),
        ("1e-3m", 1.0),
        (" .5 mm ", 0.5),
        ("3", 3.0),
        (2, 2.0),
    ],
)
def test_lengths_are_exact(text: object, mm: float) -> None:
    assert parse_length_mm(text) == mm


@pytest.mark.parametrize(("text", "deg"), [("30deg", 30), ("-15°", -15), ("0.25turn", 90), ("3.5", 3.5)])
def test_angles(text: object, deg: float) -> None:
    assert parse_angle_deg(text) == deg


def test_radians() -> None:
    assert parse_angle_deg("1rad") == pytest.approx(57.29577951308232, rel=1e-15)


@pytest.mark.parametrize(
    "value", ["3kg", "3deg", "3 mm mm", "mm", "", "1,5mm", "nan", "inf", True, None, [1]]
)
def test_what_is_no_length_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match="length"):
        parse_length_mm(value)


def test_a_wrong_unit_is_answered_with_the_accepted_ones() -> None:
    with pytest.raises(ValueError, match=r"'kg'.*um, mm, cm, m, mil, in"):
        parse_length_mm("3kg")
    with pytest.raises(ValueError, match=r"'mm'.*deg, mrad, rad, turn"):
        parse_angle_deg("3mm")


@given(st.floats(0, 1e6), st.sampled_from(sorted(LENGTHS_MM)))
def test_any_number_with_any_unit(number: float, unit: str) -> None:
    assert parse_length_mm(f"{number!r}{unit}") == pytest.approx(number * float(LENGTHS_MM[unit]), rel=1e-14)


@given(st.text())
def test_any_text_is_a_length_or_a_value_error(text: str) -> None:
    try:
        parse_length_mm(text)
    except ValueError as error:
        assert "\n" not in str(error).replace(repr(text), "")
