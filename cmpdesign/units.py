"""Conversion of texts with units ("1.5mm", "60mil", "30deg") to millimetres and degrees."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal

# Decimal factors keep "60mil" at exactly 1.524 mm instead of 1.5239999999999998.
LENGTHS_MM: Mapping[str, Decimal] = {
    "um": Decimal("0.001"),
    "mm": Decimal(1),
    "cm": Decimal(10),
    "m": Decimal(1000),
    "mil": Decimal("0.0254"),
    "in": Decimal("25.4"),
}
ANGLES_DEG: Mapping[str, Decimal] = {
    "deg": Decimal(1),
    "mrad": Decimal(repr(math.degrees(1e-3))),
    "rad": Decimal(repr(math.degrees(1.0))),
    "turn": Decimal(360),
}
_ALIASES = {"µm": "um", "μm": "um", "inch": "in", '"': "in", "thou": "mil", "°": "deg"}
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(\S*)\s*")


def parse_length_mm(value: object) -> float:
    """Convert a number (mm) or a string with a unit to a length in mm.

    >>> parse_length_mm("60mil"), parse_length_mm(2)
    (1.524, 2.0)

    Raises:
        ValueError: the value is not finite or not a number, or its unit is not in ``LENGTHS_MM``.
    """
    return _parse(value, LENGTHS_MM, "length", "1.5mm")


def parse_angle_deg(value: object) -> float:
    """Convert a number (degrees) or a string with a unit to an angle in degrees.

    >>> parse_angle_deg("0.25turn")
    90.0

    Raises:
        ValueError: the value is not finite or not a number, or its unit is not in ``ANGLES_DEG``.
    """
    return _parse(value, ANGLES_DEG, "angle", "30deg")


def _parse(value: object, units: Mapping[str, Decimal], kind: str, example: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r} is no {kind}; write a number or a text such as {example!r}")
    if not isinstance(value, str):
        return _finite(float(value), value, kind)
    match = _QUANTITY.fullmatch(value)
    if match is None:
        raise ValueError(f"{value!r} is no {kind}; write a number and a unit, such as {example!r}")
    number, unit = match.groups()
    factor = units.get(_ALIASES.get(unit, unit)) if unit else Decimal(1)
    if factor is None:
        raise ValueError(f"{value!r} has the unit {unit!r}; units of {kind} are {', '.join(units)}")
    return _finite(float(Decimal(number) * factor), value, kind)


def _finite(number: float, value: object, kind: str) -> float:
    if not math.isfinite(number):
        raise ValueError(f"{value!r} is no {kind}: it must be finite")
    return number
