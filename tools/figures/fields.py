"""The tables of docs/reference/design-files.md, from the model that reads the files."""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel

from cmpdesign.design.design import Design, Palette, design_schema
from cmpdesign.patterns import registered_patterns
from cmpdesign.units import ANGLES_DEG, LENGTHS_MM

BEGIN, END = "<!-- {}: written by python -m tools.figures -->", "<!-- end of {} -->"


def filled(text: str) -> str:
    """The page with its tables replaced.

    Raises:
        ValueError: the page has no place for a table.
    """
    generated = {"fields": fields(), "palette": palette(), "units": units()}
    generated |= {name: table(model) for name, model in tables().items()}
    for name, lines in generated.items():
        begin, end = BEGIN.format(name), END.format(name)
        before, _, rest = text.partition(begin)
        _, found, after = rest.partition(end)
        if not found:
            raise ValueError(f"docs/reference/design-files.md has no place for the table of {name}")
        text = f"{before}{begin}\n\n{lines}\n{end}{after}"
    return text


def fields() -> str:
    """Every field of a design: its values, its default, its meaning."""
    return _rows(Design, design_schema()["properties"])


def tables() -> dict[str, type[BaseModel]]:
    """The tables of a design without the palette, which has a shorter form: name -> model."""
    found = {name: field.annotation for name, field in Design.model_fields.items()}
    return {
        name: model
        for name, model in found.items()
        if isinstance(model, type) and issubclass(model, BaseModel) and model is not Palette
    }


def table(model: type[BaseModel]) -> str:
    """Every field of a table of a design, in the form of ``fields``."""
    return _rows(model, model.model_json_schema()["properties"])


def _rows(model: type[BaseModel], properties: dict[str, Any]) -> str:
    rows = ["| field | unit | takes | default | meaning |", "|---|---|---|---|---|"]
    for name, field in model.model_fields.items():
        default = (
            "required" if field.is_required() else _default(field.get_default(call_default_factory=True))
        )
        takes = _takes(name, properties[name])
        rows.append(f"| `{name}` | {_unit(name)} | {takes} | {default} | {field.description} |")
    return "\n".join(rows) + "\n"


def palette() -> str:
    """The inks and their defaults."""
    rows = ["| ink | default |", "|---|---|"]
    rows += [f"| `{name}` | `{field.default}` |" for name, field in Palette.model_fields.items()]
    return "\n".join(rows) + "\n"


def units() -> str:
    """The units of lengths and angles."""
    lengths = ", ".join(f"`{unit}`" for unit in LENGTHS_MM)
    angles = ", ".join(f"`{unit}`" for unit in ANGLES_DEG)
    return f"- lengths: {lengths}; a plain number is mm\n- angles: {angles}; a plain number is degrees\n"


def _default(value: Any) -> str:
    if isinstance(value, BaseModel):
        return "below"
    if value is None:
        return "none"
    shown = (
        str(value).lower()
        if isinstance(value, bool)
        else f'"{value}"'
        if isinstance(value, str)
        else f"{value:g}"
    )
    return f"`{shown}`"


def _unit(name: str) -> str:
    """The unit that stands at the end of a field's name."""
    units = {"_mm_s": "mm/s", "_mm": "mm", "_deg": "deg", "_percent": "%"}
    return next((unit for end, unit in units.items() if name.endswith(end)), "")


def _takes(name: str, schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        return "a table"
    if name == "pattern":
        return ", ".join(f'`"{pattern}"`' for pattern in registered_patterns())
    options = [option for option in schema.get("anyOf", [schema]) if option.get("type") != "null"]
    nested = [inner for option in options for inner in option.get("anyOf", [option])]
    if name.endswith(("_mm", "_deg")):  # a number, or a text with a unit
        number = next(inner for inner in nested if inner.get("type") == "number")
        return ("a length" if name.endswith("_mm") else "an angle") + _range(number)
    return " or ".join(dict.fromkeys(_kind(inner) for inner in nested))


def _kind(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(choice)}`" for choice in schema["enum"])
    kind = {"boolean": "true or false", "integer": "an integer", "number": "a number", "string": "a text"}
    return kind[schema["type"]] + _range(schema)


def _range(schema: dict[str, Any]) -> str:
    """What a number may be, as words after its kind."""
    low, above, high = (schema.get(key) for key in ("minimum", "exclusiveMinimum", "maximum"))
    lower = "" if low is None else f" from {low:g}"
    lower = lower if above is None else f" above {above:g}"
    return lower + ("" if high is None else f" to {high:g}")
