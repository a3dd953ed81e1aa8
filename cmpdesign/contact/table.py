"""The [contact] table of a scene: the names of the Python API; lengths and angles may have units."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.errors import ContactError
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects.heightmap import HeightMap
from cmpdesign.contact.objects.indenters import Ball, Cube, Cylinder, Indenter, Punch, Rib, Ring, Wedge
from cmpdesign.contact.result import Contact
from cmpdesign.contact.solve import solve
from cmpdesign.inputs.names import nearest_name
from cmpdesign.inputs.validation import MAX_ERRORS, shown_value
from cmpdesign.units import parse_angle_deg, parse_length_mm

INDENTER_KINDS: Mapping[str, type[Indenter]] = {
    kind.__name__.lower(): kind for kind in (Ball, Cube, Cylinder, Punch, Rib, Ring, Wedge, HeightMap)
}
SignedLength = Annotated[float, BeforeValidator(parse_length_mm)]
SignedAngle = Annotated[float, BeforeValidator(parse_angle_deg)]
Model = TypeVar("Model", bound=BaseModel)
STRICT = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True)
class ContactSetup:
    """The checked arguments of ``solve``; ``dataclasses.replace`` exchanges the motion or the object."""

    elastomer: Elastomer
    indenter: Indenter
    motion: Motion
    friction: float
    size_mm: tuple[float, float]
    grid: int
    steps: int

    def solve(self) -> Contact:
        """Solve the contact.

        Raises:
            ContactError: the object misses the solved area, or the grid does not fit the area.
        """
        given = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return solve(**given)


class _ContactTable(BaseModel):
    model_config = STRICT

    elastomer: dict[str, Any]
    indenter: dict[str, Any]
    motion: dict[str, Any]
    # TOML has "inf": no slip wherever there is pressure.
    friction: float = Field(0.5, ge=0, allow_inf_nan=True)
    size_mm: tuple[SignedLength, SignedLength] = (30.0, 30.0)
    grid: int = Field(256, strict=True)
    steps: int = Field(4, strict=True)


def contact_from(table: Mapping[str, Any], folder: str | Path = ".") -> ContactSetup:
    """A contact from its table; a height map's ``path`` is read from ``folder``.

    >>> contact_from({
    ...     "elastomer": {"thickness_mm": 4, "young_mpa": 0.3},
    ...     "indenter": {"kind": "ball", "radius_mm": "1cm", "centre_mm": [2, 0]},
    ...     "motion": {"press_mm": 0.5},
    ... }).indenter
    Ball(centre_mm=(2.0, 0.0), turn_deg=0.0, radius_mm=10.0)

    Raises:
        ContactError: an unknown, missing or impossible value; the message names its path in the table.
    """
    read = _validate_table(_ContactTable, table, "contact")
    given = {name: getattr(read, name) for name in ("friction", "size_mm", "grid", "steps")}
    return ContactSetup(
        elastomer=_make_from_table(Elastomer, read.elastomer, "contact.elastomer"),
        indenter=_make_indenter(read.indenter, Path(folder)),
        motion=_make_from_table(Motion, read.motion, "contact.motion"),
        **given,
    )


def _make_indenter(table: Mapping[str, Any], folder: Path) -> Indenter:
    rest = dict(table)
    kind = rest.pop("kind", None)
    if not isinstance(kind, str) or kind not in INDENTER_KINDS:
        raise ContactError(
            f"contact.indenter.kind is {shown_value(kind)}{nearest_name(kind, INDENTER_KINDS)}; there are "
            f"{', '.join(INDENTER_KINDS)}"
        )
    if INDENTER_KINDS[kind] is not HeightMap:
        made: Indenter = _make_from_table(INDENTER_KINDS[kind], rest, "contact.indenter")
        return made
    placed = ("centre_mm", "turn_deg")
    fields = {"path": (str, ...), "depth_mm": (SignedLength | None, None)}
    fields |= {name: _pydantic_field(HeightMap, name) for name in ("pixel_mm", *placed)}
    read = _validate_table(create_model("HeightMap", __config__=STRICT, **fields), rest, "contact.indenter")  # type: ignore[call-overload]
    values = read.model_dump()
    return HeightMap.read(folder / values.pop("path"), **values)


def _make_from_table(kind: type[Any], table: Mapping[str, Any], where: str) -> Any:
    """A dataclass of numbers from a table with its fields' names."""
    fields = {field.name: _pydantic_field(kind, field.name) for field in dataclasses.fields(kind)}
    read = _validate_table(create_model(kind.__name__, __config__=STRICT, **fields), table, where)  # type: ignore[call-overload]
    try:
        return kind(**read.model_dump())
    except ContactError as error:
        raise ContactError(f"{where}: {error}") from None


def _pydantic_field(kind: type[Any], name: str) -> tuple[Any, Any]:
    """A field's type and default for pydantic. The name holds the unit; a pair as default makes the type a pair."""
    found = {field.name: field for field in dataclasses.fields(kind)}[name]
    number: Any = {"mm": SignedLength, "deg": SignedAngle}.get(name.rpartition("_")[2], float)
    if isinstance(found.default, tuple):
        number = tuple[number, number]
    return number, ... if found.default is dataclasses.MISSING else found.default


def _validate_table(model: type[Model], table: Mapping[str, Any], where: str) -> Model:
    try:
        return model.model_validate(dict(table))
    except ValidationError as error:
        items = error.errors()[:MAX_ERRORS]
        raise ContactError("; ".join(_error_message(item, model, where) for item in items)) from None


def _error_message(item: Any, model: type[BaseModel], where: str) -> str:
    path = ".".join([where, *(str(part) for part in item["loc"])])
    if item["type"] == "extra_forbidden":
        known = [*model.model_fields, *(["kind"] if where == "contact.indenter" else [])]
        return f"{path} is unknown{nearest_name(item['loc'][-1], known)}"
    if item["type"] == "missing":
        return f"{path} is missing"
    message = item["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return f"{path} = {shown_value(item['input'])}: {message}"
