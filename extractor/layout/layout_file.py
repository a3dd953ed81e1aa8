"""An independent reader of ``layout.json``, versions 1 and 2.

The file is the only interface to the generator. Every field is checked, then the fields against each other, then the
digest of the geometry. ``layout.schema.json`` describes the format.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from extractor.errors import LayoutError
from extractor.layout import json_fields as fields
from extractor.layout.as_made_fields import read_as_made
from extractor.layout.consistency import MAX_CODE, MAX_VIRTUAL_PER_EDGE
from extractor.layout.reference import BLACK, COLORS, PadCode, Reference
from extractor.layout.text_file import printable_path, read_text_file

MAX_BYTES = 1 << 26  # of a layout file; 200 layers take 23 MiB
FIELDS = (
    "format", "version", "units", "pattern", "parameters", "markers", "cells", "edges", "virtual_per_edge",
    "reference", "palette", "border_mm", "outline", "generator", "digest",
)  # fmt: skip
OPTIONAL_FIELDS = ("fiducials", "code", "as_made")
VERSIONS = (1, 2)


class HasReference(Protocol):
    """A value that gives its ``Reference``, as the layouts of cmpdesign do."""

    def reference(self) -> Reference: ...


# Forms of a layout: its file, the value of its file, the file's JSON object, or a value that gives a ``Reference``.
LayoutLike = str | PathLike[str] | Reference | Mapping[str, Any] | HasReference


def layout_of(given: LayoutLike) -> Reference:
    """The layout that a caller gives in one of several forms.

    Args:
        given: the path of a layout file, a ``Reference``, the JSON object of a layout file as a mapping, or a value
            with a method ``reference``.

    Raises:
        LayoutError: see ``load_layout``.
        TypeError: another value.
    """
    if isinstance(given, Reference):
        return given
    if isinstance(given, str | PathLike):
        return load_layout(given)
    if isinstance(given, Mapping):
        return parse_layout(_json_text(given))
    reference = given.reference() if hasattr(given, "reference") else None
    if not isinstance(reference, Reference):
        raise TypeError(
            f"layout is a value of the type {type(given).__name__}; give the path of a layout.json, a Reference "
            "(load_layout), the JSON object of a layout file, or a layout of cmpdesign"
        )
    return reference


def layouts_of(given: LayoutLike | Sequence[LayoutLike]) -> tuple[Reference, ...]:
    """One layout, or the layouts of a family: pads that differ in their codes, and as made in their markers' places.

    Raises:
        LayoutError: see ``load_layout``; no layout, or layouts that are no family.
        TypeError: another value.
    """
    if not isinstance(given, Sequence) or isinstance(given, str):
        return (layout_of(given),)
    layouts = tuple(layout_of(one) for one in given)
    if not layouts:
        raise LayoutError("no layout is given; give one, or the layouts of several pads with different codes")
    first, *others = layouts
    for number, other in enumerate(others, start=2):
        differing = _not_of_family(first, other)
        if differing:
            raise LayoutError(
                f"layouts 1 and {number} differ in {differing}; several layouts are those of pads that differ in "
                "their codes alone; read other pads one by one"
            )
    codes = [one.code and one.code.id for one in layouts]
    doubtful = next((code for code in codes if len(layouts) > 1 and (not code or codes.count(code) > 1)), 0)
    if doubtful != 0:
        same = f"the code {doubtful}" if doubtful else "no code"
        raise LayoutError(
            f"{codes.count(doubtful)} of {len(layouts)} layouts have {same}; pads are told apart by their codes: give "
            "each its own"
        )
    return layouts


def _not_of_family(one: Reference, other: Reference) -> str:
    """What two layouts differ in that pads of one family have in common; empty for none."""
    inks = [np.where(layout.cell_color < BLACK, layout.cell_color, BLACK) for layout in (one, other)]
    pairs = {
        "pattern": one.pattern == other.pattern,
        "markers": np.array_equal(one.layer, other.layer) and np.array_equal(one.index, other.index),
        "cells": np.array_equal(one.cell_corners, other.cell_corners) and np.array_equal(inks[0], inks[1]),
        "virtual markers": one.virtual_per_edge == other.virtual_per_edge,
        "palette": one.palette == other.palette,
        "the side that is seen": one.mirrored == other.mirrored,
    }
    return next((name for name, is_same in pairs.items() if not is_same), "")


def _json_text(document: Mapping[str, Any]) -> str:
    try:
        return json.dumps(dict(document))
    except (TypeError, ValueError, RecursionError) as error:
        raise LayoutError(f"layout is no JSON object ({error}); expected that of a layout.json") from None


def load_layout(path: str | PathLike[str]) -> Reference:
    """Read and check a layout file.

    Raises:
        LayoutError: the file cannot be read, is of another format or version, or contradicts itself; one line
            that names the file, the field, the value and what is expected.
    """
    text = read_text_file(
        path, MAX_BYTES, LayoutError, "a layout, a text in UTF-8; it comes first, then the pictures"
    )
    return parse_layout(text, printable_path(path))


def parse_layout(text: str, name: str = "layout") -> Reference:
    """The layout in a JSON text; every error's message begins with ``name``.

    Raises:
        LayoutError: see ``load_layout``.
    """
    try:
        return _checked_reference(fields.document(text))
    except LayoutError as error:
        raise LayoutError(f"{name}: {error}") from None


def _checked_reference(document: dict[str, Any]) -> Reference:
    _check_header(document)
    markers = fields.mapping(document["markers"], "markers")
    fields.known_fields(markers, ("layer", "index", "x", "y"), "markers.")
    layer = fields.integers(markers["layer"], "markers.layer", fields.MAX_INT)
    count = len(layer)
    x_mm = fields.lengths_mm(markers["x"], "markers.x", count)
    y_mm = fields.lengths_mm(markers["y"], "markers.y", count)
    cells = fields.mapping(document["cells"], "cells")
    fields.known_fields(cells, ("corners", "color"), "cells.")
    corners = fields.integer_rows(cells["corners"], "cells.corners", count - 1, (3, 4))
    origin = fields.mapping(document["reference"], "reference")
    fields.known_fields(origin, ("cell", "marker"), "reference.")
    fiducials_mm, fiducial_diameter_mm = _fiducials(document)
    reference = Reference(
        pattern=fields.text_field(document["pattern"], "pattern"),
        parameters=_parameters(document["parameters"]),
        layer=layer,
        index=fields.integers(markers["index"], "markers.index", fields.MAX_INT, count),
        xy_mm=np.column_stack([x_mm, y_mm]),
        cell_corners=corners,
        cell_color=fields.choices(cells["color"], "cells.color", len(corners), COLORS),
        edges=fields.integer_rows(document["edges"], "edges", count - 1, (2,)),
        virtual_per_edge=fields.integer(
            document["virtual_per_edge"], "virtual_per_edge", 0, MAX_VIRTUAL_PER_EDGE
        ),
        reference_cell=fields.integer(origin["cell"], "reference.cell", 0, len(corners) - 1),
        reference_marker=fields.integer(origin["marker"], "reference.marker", 0, count - 1),
        palette=_palette(document["palette"]),
        border_mm=fields.length_mm(document["border_mm"], "border_mm"),
        outline_mm=fields.points_mm(document["outline"], "outline"),
        digest=fields.text_field(document["digest"], "digest"),
        fiducials_mm=fiducials_mm,
        fiducial_diameter_mm=fiducial_diameter_mm,
        code=_code(document),
        as_made=read_as_made(document, count),
    )
    _check_digest(reference)
    return reference


def _check_header(document: dict[str, Any]) -> None:
    """Check format and version before all other fields, which another version may define differently."""
    for field, expected in (("format", ("cmp-layout",)), ("version", VERSIONS), ("units", ("mm",))):
        value = document.get(field)
        if type(value) is not type(expected[0]) or value not in expected:
            found = fields.shown(value) if field in document else "missing"
            fields.fail(field, found, " or ".join(map(fields.shown, expected)))
    fields.known_fields(document, FIELDS, optional=OPTIONAL_FIELDS)
    fields.text_field(document["generator"], "generator")


def _parameters(value: object) -> dict[str, Any]:
    parameters = fields.mapping(value, "parameters")
    if type(parameters.get("mirrored", False)) is not bool:
        fields.fail("parameters.mirrored", fields.shown(parameters["mirrored"]), "true or false")
    fields.require_plain_values(parameters, "parameters")
    return parameters


def _palette(value: object) -> dict[str, str]:
    palette = fields.mapping(value, "palette")
    fields.known_fields(palette, COLORS, "palette.")
    for name, ink in palette.items():
        if type(ink) is not str or not re.fullmatch("#[0-9a-fA-F]{6}", ink):
            fields.fail(f"palette.{name}", fields.shown(ink), 'a color as "#rrggbb"')
    return palette


def _fiducials(document: dict[str, Any]) -> tuple[NDArray[np.float64], float]:
    """(F, 2) float64 centres and the diameter of the registration marks, mm."""
    if "fiducials" not in document:
        return np.empty((0, 2)), 0.0
    marks = fields.mapping(document["fiducials"], "fiducials")
    fields.known_fields(marks, ("x", "y", "diameter_mm"), "fiducials.")
    count = len(marks["x"]) if isinstance(marks["x"], list) else 1
    x_mm = fields.lengths_mm(marks["x"], "fiducials.x", count)
    y_mm = fields.lengths_mm(marks["y"], "fiducials.y", count)
    diameter_mm = fields.length_mm(marks["diameter_mm"], "fiducials.diameter_mm")
    return np.column_stack([x_mm, y_mm]), diameter_mm


def _code(document: dict[str, Any]) -> PadCode | None:
    """The pad's code; None for a plain pattern, with one white cell."""
    fields.require_version_2(document, ("code",), "", document["version"])
    if "code" not in document:
        return None
    code = fields.mapping(document["code"], "code")
    fields.known_fields(code, ("id", "share"), "code.")
    return PadCode(fields.integer(code["id"], "code.id", 1, MAX_CODE), code["share"])


def _check_digest(reference: Reference) -> None:
    digest = reference.geometry_digest()
    if digest != reference.digest:
        fields.fail(
            "digest",
            fields.shown(reference.digest),
            f"{digest}: the geometry was changed or damaged",
        )
