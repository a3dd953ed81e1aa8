"""A design's TOML file with every field: its meaning, unit, range and default as comments, from the models."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from cmpdesign.design.design import Design
from cmpdesign.design.extends import FIELD as EXTENDS
from cmpdesign.patterns import registered_patterns

# The fields of a new design: fields without a default that fix a pattern and its size.
STARTING_VALUES: Mapping[str, Any] = {"pattern": "honeycomb", "layers": 10, "pitch_mm": 1.5}
_UNITS = {"_mm_s": "mm/s", "_mm": "mm", "_deg": "degrees", "_percent": "percent", "_px": "px"}
_WIDTH = 100


def commented_toml(extends: str | None = None) -> str:
    """The text of a new design file. The text has every field; fields that need no value are comments.

    Args:
        extends: the design that the file extends, a template's name or a path; None: an independent design with
            ``STARTING_VALUES``.
    """
    lines = [
        '# A design of cmpdesign. Lengths are numbers in mm, or texts with a unit (um, mm, cm, m, mil, in): "60mil".',
        "# Angles are numbers in degrees, or texts with a unit (deg, mrad, rad, turn). Take the # away to set a field.",
        "",
    ]
    given: Mapping[str, Any] = STARTING_VALUES
    if extends is not None:
        lines += [
            "# The design that gives all fields which this file does not set.",
            f"{EXTENDS} = {_toml(extends)}",
            "",
        ]
        given = {}
    tables = {name: info for name, info in Design.model_fields.items() if _table_of(info) is not None}
    for name, info in Design.model_fields.items():
        if name not in tables:
            lines += _field_lines(name, info, given)
    for name, info in tables.items():
        model = _table_of(info)
        assert model is not None
        lines += [*_comment(info.description or ""), f"[{name}]"]
        for inner, inner_info in model.model_fields.items():
            lines += _field_lines(inner, inner_info, {})
    return "\n".join(lines).rstrip() + "\n"


def design_toml(fields: Mapping[str, Any]) -> str:
    """The text of a design file with the given fields alone; tables are mappings."""
    lines = [f"{name} = {_toml(value)}" for name, value in fields.items() if not isinstance(value, Mapping)]
    for name, table in fields.items():
        if isinstance(table, Mapping) and table:
            lines += ["", f"[{name}]", *(f"{inner} = {_toml(value)}" for inner, value in table.items())]
    return "\n".join(lines) + "\n"


def _field_lines(name: str, info: FieldInfo, given: Mapping[str, Any]) -> list[str]:
    """The comment of a field, the line of the field, and a blank line."""
    facts = [fact for fact in (_unit_text(name), _values_text(name, info), _default_text(info)) if fact]
    comment = " ".join([info.description or "", f"[{'; '.join(facts)}]" if facts else ""]).strip()
    start, value = ("", given[name]) if name in given else ("# ", _shown_value(name, info))
    return [*_comment(comment), f"{start}{name} = {_toml(value)}", ""]


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, _WIDTH)]


def _unit_text(name: str) -> str:
    return next((unit for suffix, unit in _UNITS.items() if name.endswith(suffix)), "")


def _values_text(name: str, info: FieldInfo) -> str:
    """The range of a number, or the words that a field takes."""
    if name == "pattern":
        return " | ".join(map(_toml, registered_patterns()))
    words = [
        word for part in _parts(info.annotation) if get_origin(part) is Literal for word in get_args(part)
    ]
    if words:
        return " | ".join(map(_toml, words))
    if bool in _parts(info.annotation):
        return "true | false"
    limits = {kind: value for item in _metadata(info) for kind, value in _limits(item)}
    lower = (
        f"above {limits['gt']:g}" if "gt" in limits else f"from {limits['ge']:g}" if "ge" in limits else ""
    )
    upper = f"below {limits['lt']:g}" if "lt" in limits else f"to {limits['le']:g}" if "le" in limits else ""
    return " ".join(text for text in (lower, upper) if text)


def _default_text(info: FieldInfo) -> str:
    default = _default_of(info)
    return "" if default is PydanticUndefined else f"default {'none' if default is None else _toml(default)}"


def _default_of(info: FieldInfo) -> Any:
    return info.get_default(call_default_factory=True) if info.default_factory is None else PydanticUndefined


def _shown_value(name: str, info: FieldInfo) -> Any:
    """The value in a commented line: the default, or else a value that the field takes."""
    default = _default_of(info)
    if default is not None and default is not PydanticUndefined:
        return default
    if name in STARTING_VALUES:
        return STARTING_VALUES[name]
    parts = _parts(info.annotation)
    words = [word for part in parts if get_origin(part) is Literal for word in get_args(part)]
    if words:
        return words[0]
    return 1 if int in parts else 1.0 if float in parts else ""


def _parts(annotation: Any) -> list[Any]:
    """The types of a union, without None and without annotations."""
    if get_origin(annotation) in (Union, UnionType):
        return [part for each in get_args(annotation) for part in _parts(each)]
    if get_origin(annotation) is Annotated:
        return _parts(get_args(annotation)[0])
    return [] if annotation is NoneType else [annotation]


def _metadata(info: FieldInfo) -> Iterator[Any]:
    """The limits of a field: the field's own limits, and the limits in its type."""
    yield from info.metadata
    yield from _annotated(info.annotation)


def _annotated(annotation: Any) -> Iterator[Any]:
    if get_origin(annotation) in (Union, UnionType):
        for each in get_args(annotation):
            yield from _annotated(each)
    if get_origin(annotation) is Annotated:
        inner, *items = get_args(annotation)
        yield from items
        yield from _annotated(inner)


def _limits(item: Any) -> Iterator[tuple[str, float]]:
    """The limits in one piece of metadata: a limit itself, or a ``Field`` with limits."""
    for inner in (item, *getattr(item, "metadata", ())):
        for kind in ("gt", "ge", "lt", "le"):
            value = getattr(inner, kind, None)
            if value is not None:
                yield kind, value


def _table_of(info: FieldInfo) -> type[BaseModel] | None:
    annotation = info.annotation
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None


def _toml(value: Any) -> str:
    """A text, number or truth value as TOML."""
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else f"{value!r}"
