"""Texts of a sensor file's tables, and a file's text with some of its tables replaced; all other lines stay."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from datetime import date
from typing import Any

from extractor import View
from extractor.space.medium import Medium
from extractor.space.rig import Deviation

_HEADER = re.compile(r"^\s*\[\[?\s*([A-Za-z][\w.-]*)\s*\]\]?\s*(#.*)?$")


def toml_value(value: Any) -> str:
    """A number, a text, a date, a truth value or a list of these in TOML."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            clean = "".join(letter if letter.isprintable() else "?" for letter in value)
            return '"' + clean.replace("\\", "\\\\").replace('"', '\\"') + '"'
        case date():
            return value.isoformat()
        case int():
            return str(value)
        case float():
            return f"{value:.10g}" if value % 1 or abs(value) >= 1e15 else f"{value:.1f}"
    return f"[{', '.join(map(toml_value, value))}]"


def toml_table(header: str, values: Mapping[str, Any]) -> str:
    """A table; lists of lists have a line for each row. ``header`` has its brackets; None is left out."""
    lines = [header]
    for name, value in values.items():
        rows = (
            isinstance(value, Sequence)
            and value
            and not isinstance(value, str)
            and isinstance(value[0], Sequence)
        )
        if rows and not isinstance(value[0], str):
            lines += [f"{name} = [", *(f"  {toml_value(row)}," for row in value), "]"]
        elif value is not None:
            lines.append(f"{name} = {toml_value(value)}")
    return "\n".join(lines) + "\n"


def view_table(view: View) -> str:
    """The [[view]] of a view, with its pose and window if known."""
    window = view.window
    return toml_table(
        "[[view]]",
        {
            "name": view.name,
            "focal_px": view.focal_px,
            "centre_px": view.centre_px,
            "lens": view.lens,
            "distortion": view.distortion,
            "area_px": view.area_px,
            "mirrored": bool(view.mirrored),
            "window_normal": None if window is None else window.normal,
            "window_distance_mm": None if window is None else window.distance_mm,
            "R_camera_from_layout": view.R_camera_from_layout.tolist() if view.placed else None,
            "t_camera_from_layout_mm": view.t_camera_from_layout_mm.tolist() if view.placed else None,
        },
    )


def medium_table(medium: Medium) -> str:
    """The [medium]."""
    return toml_table("[medium]", {field.name: getattr(medium, field.name) for field in fields(medium)})


def deviation_table(one: Deviation) -> str:
    """A [[deviation]]."""
    return toml_table("[[deviation]]", {field.name: getattr(one, field.name) for field in fields(one)})


def replaced_tables(text: str, tables: Iterable[str], removed: Sequence[str]) -> str:
    """A file's text without the tables of the names ``removed``, and with these tables at its end.

    Comments that stand directly before a removed table stay.
    """
    kept, leaving = [], False
    for line in text.splitlines():
        header = _HEADER.match(line)
        if header:
            leaving = header[1] in removed
        if not leaving or (line.startswith("#") and line.strip()):
            kept.append(line)
    return "\n".join(kept).rstrip() + "\n\n" + "\n".join(tables)
