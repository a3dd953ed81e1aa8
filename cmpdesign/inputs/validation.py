"""The errors of pydantic as one line with each field, its value, and the nearest known name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from cmpdesign.inputs.names import nearest_name
from cmpdesign.inputs.texts import visible

MAX_ERRORS = 5
_MAX_VALUE_LETTERS = 60
_UNITS = ("mm", "deg", "px")


def validation_message(error: ValidationError, model: type[BaseModel]) -> str:
    """The errors of a validation in one line.

    Args:
        error: the errors.
        model: the class of the whole document.
    """
    items = error.errors()
    parts = [_item_message(item, model) for item in items[:MAX_ERRORS]]
    if len(items) > MAX_ERRORS:
        parts.append(f"and {len(items) - MAX_ERRORS} more")
    return "; ".join(parts)


def shown_value(value: object) -> str:
    """A value on one short line; of a table or a long list only kind and size."""
    match value:
        case Mapping():
            return f"a table of {len(value)} fields"
        case list() | tuple() if len(repr(value)) > _MAX_VALUE_LETTERS:
            return f"a list of {len(value)}"
        case int() if not isinstance(value, bool) and abs(value) >= 10**30:
            return f"a whole number of {value.bit_length()} bits"
        case str() if len(value) > _MAX_VALUE_LETTERS:
            return repr(value[:_MAX_VALUE_LETTERS] + "...")
    return repr(value)


def _item_message(item: Any, model: type[BaseModel]) -> str:
    path = ".".join(visible(str(part)) for part in item["loc"])
    message, kind = item["msg"].removeprefix("Value error, "), item["type"]
    if kind == "extra_forbidden":
        return f"{path} is unknown{nearest_name(item['loc'][-1], _known_names(model, item['loc'][:-1]))}"
    if kind == "missing":
        return f"{path} is missing"
    if kind == "value_error":
        return f"{path}: {message}" if path else message
    value = shown_value(item["input"])
    if kind == "string_pattern_mismatch" and "0-9a-fA-F" in item["ctx"]["pattern"]:
        return f'{path} = {value} is no color; write it as "#c8322d"'
    unit = next((f" {unit}" for unit in _UNITS if path.endswith(f"_{unit}")), "")
    return f"{path} = {value} must be {message.removeprefix('Input should be ')}{unit}"


def _known_names(model: Any, path: tuple[int | str, ...]) -> tuple[str, ...]:
    """The fields of the table at a path of names; empty where any name is allowed."""
    annotation: Any = model
    for part in path:
        table = _table_class(annotation)
        if table is not None and part in table.model_fields:
            annotation = table.model_fields[str(part)].annotation
        # else the path goes into a mapping or a list, whose values have the same class
    table = _table_class(annotation)
    return () if table is None else tuple(table.model_fields)


def _table_class(annotation: Any) -> type[BaseModel] | None:
    """The first table in a type such as "Settings", "Mapping[str, Settings]" or "Table | None"."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for found in map(_table_class, get_args(annotation)) if found), None)
