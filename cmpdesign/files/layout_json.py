"""Writing of ``layout.json``: columns, mm, UTF-8, the same bytes for the same layout. See docs/."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign import __version__
from cmpdesign.files.atomic import write_file
from cmpdesign.layout.layout import AsMade, Layout
from cmpdesign.patterns.colors import COLORS

FORMAT = "cmp-layout"


def write_layout(layout: Layout, path: str | Path) -> None:
    """Write ``layout_to_json`` to a file.

    Raises:
        OutputError: the file cannot be written.
    """
    write_file(path, layout_to_json(layout))


def layout_to_json(layout: Layout) -> str:
    """Format the layout file, one column per line; numbers are the shortest that read back exactly."""
    return _format_object(layout_document(layout), "") + "\n"


def layout_document(layout: Layout) -> dict[str, Any]:
    """The JSON object of the layout file."""
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": file_version(layout),
        "units": "mm",
        "pattern": layout.pattern,
        "parameters": dict(layout.parameters),
        "markers": {
            "layer": layout.marker_layer.tolist(),
            "index": layout.marker_index.tolist(),
            "x": layout.marker_xy_mm[:, 0].tolist(),
            "y": layout.marker_xy_mm[:, 1].tolist(),
        },
        "cells": {
            "corners": layout.cell_corners.tolist(),
            "color": [COLORS[color] for color in layout.cell_color.tolist()],
        },
        "edges": layout.edges.tolist(),
        "virtual_per_edge": layout.virtual_per_edge,
        "reference": {"cell": layout.reference_cell, "marker": layout.reference_marker},
        "palette": dict(layout.palette),
        "border_mm": layout.border_mm,
        "outline": layout.outline_mm.tolist(),
        "generator": f"cmpdesign {__version__}",
        "digest": layout.digest,
    }
    if len(layout.fiducials_mm):
        document["fiducials"] = {
            "x": layout.fiducials_mm[:, 0].tolist(),
            "y": layout.fiducials_mm[:, 1].tolist(),
            "diameter_mm": layout.fiducial_diameter_mm,
        }
    if layout.code is not None:
        document["code"] = {"id": layout.code.id, "share": layout.code.share}
    if layout.as_made is not None:
        document["as_made"] = _as_made_object(layout.as_made)
    return document


def file_version(layout: Layout) -> int:
    """2 for a layout with a field that version 1 does not know, else 1, so that earlier readers read the file."""
    return 2 if layout.cell_height_mm or layout.code is not None else 1


def pattern_digest(layout: Layout) -> str:
    """SHA-256 (hex) of the content of the layout file without the program's version."""
    lines = layout_to_json(layout).splitlines()
    return hashlib.sha256(
        "\n".join(line for line in lines if '"generator": ' not in line).encode()
    ).hexdigest()


def _as_made_object(as_made: AsMade) -> dict[str, Any]:
    found: dict[str, Any] = {"of": as_made.of, "product": as_made.product, "side": as_made.side}
    if as_made.outlines_mm is not None:
        found["outlines"] = [_without_repeats(outline.tolist()) for outline in as_made.outlines_mm]
    if as_made.covariance_mm2 is not None:
        places = {"xx": (0, 0), "xy": (0, 1), "yy": (1, 1)}
        columns = {name: as_made.covariance_mm2[:, i, j].tolist() for name, (i, j) in places.items()}
        found["covariance_mm2"] = {
            name: [None if math.isnan(value) else value for value in column]
            for name, column in columns.items()
        }
    if as_made.cell_height_mm:
        found["cell_height_mm"] = as_made.cell_height_mm
    return found


def _without_repeats(points: list[list[float]]) -> list[list[float]]:
    """The points without the repetitions of the last point."""
    count = len(points)
    while count > 3 and points[count - 1] == points[count - 2]:
        count -= 1
    return points[:count]


def _format_object(value: Mapping[str, Any], indent: str) -> str:
    """Format an object with one member per line; a list stays on one line."""
    inner = indent + "  "
    lines = [
        f"{inner}{_format_value(key)}: "
        f"{_format_object(item, inner) if isinstance(item, Mapping) else _format_value(item)}"
        for key, item in value.items()
    ]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def _format_value(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
