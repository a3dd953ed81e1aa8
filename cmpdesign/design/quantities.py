"""Types of pydantic fields for lengths, angles and colors: numbers, or texts with a unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from cmpdesign.units import ANGLES_DEG, LENGTHS_MM, parse_angle_deg, parse_length_mm

LARGEST_MM = 10_000.0


def _quantity_schema(units: Sequence[str], allow_zero: bool, signed: bool = False) -> dict[str, Any]:
    sign = "[+-]?" if signed else "[+]?"
    number: dict[str, Any] = {"type": "number"}
    if not signed:
        number["minimum" if allow_zero else "exclusiveMinimum"] = 0
    pattern = rf"^\s*{sign}(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*({'|'.join(units)})?\s*$"
    return {"anyOf": [number, {"type": "string", "pattern": pattern}]}


_LENGTH = BeforeValidator(parse_length_mm)
Length = Annotated[
    float,
    Field(gt=0, le=LARGEST_MM),
    _LENGTH,
    WithJsonSchema(_quantity_schema(tuple(LENGTHS_MM), allow_zero=False)),
]
LengthOrZero = Annotated[
    float,
    Field(ge=0, le=LARGEST_MM),
    _LENGTH,
    WithJsonSchema(_quantity_schema(tuple(LENGTHS_MM), allow_zero=True)),
]
Angle = Annotated[
    float,
    Field(ge=-360, le=360),
    BeforeValidator(parse_angle_deg),
    WithJsonSchema(_quantity_schema(tuple(ANGLES_DEG), allow_zero=True, signed=True)),
]
Color = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$"), AfterValidator(str.lower)]
