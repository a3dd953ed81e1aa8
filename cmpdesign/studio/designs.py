"""Designs for the page: the form's schema, the drawing with findings and figures, remedies, TOML."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from cmpdesign.api.designs import Design
from cmpdesign.design.commented_toml import design_toml
from cmpdesign.design.design import design_schema, load_design
from cmpdesign.design.templates import template_kinds, template_words, templates
from cmpdesign.documents.designs import FindingPart
from cmpdesign.errors import CmpDesignError, DesignError
from cmpdesign.inputs.documents import parse_toml
from cmpdesign.layout.checks import Finding, check_design
from cmpdesign.layout.report import design_report, report_values
from cmpdesign.patterns.colors import WHITE
from cmpdesign.products.as_made.reading import clip_findings
from cmpdesign.products.drawing.svg import layout_to_compact_svg, sheet_from_layout

# Fields that name a template or, outside of the page, a file.
LIBRARIES = {
    "laser.machine": "machines",
    "laser.material": "materials",
    "mold.base_silicone": "silicones",
    "mold.marker_silicone": "silicones",
    "mold.cover_silicone": "silicones",
}
_TABLES = ("palette", "fiducials", "laser", "mold", "sheet")
_WORD = re.compile(r"[a-z_]+(?:\.[a-z_]+)?")
_NOT_IN_FINDINGS = {"name", "description", "source", "extends"}
MAX_CAMERA_PIXELS = 60_000_000
_SIZE_FIELDS = ("pitch_mm", "layers", "width_mm", "height_mm")  # a finding on a size names one of them
_STEPS = 64  # of a remedy, above and below the present value
_STEP = 1.04  # ratio of such steps


@dataclass(frozen=True)
class Look:
    """How a design is looked at: pixels of the camera, the side that is drawn, and the numbers that are written."""

    camera_px: tuple[int, int] = (640, 480)
    is_back: bool = False
    labels: str = ""

    @classmethod
    def of(cls, asked: Mapping[str, Any]) -> Look:
        """The values of a request; what is missing has its usual value.

        Raises:
            DesignError: no camera of 10 px a side or more, and of at most ``MAX_CAMERA_PIXELS``.
        """
        match asked.get("camera", [640, 480]):
            case [int(width), int(height)] if (
                min(width, height) >= 10 and width * height <= MAX_CAMERA_PIXELS
            ):
                return cls((width, height), asked.get("back") is True, str(asked.get("labels", "")))
        most = MAX_CAMERA_PIXELS // 10**6
        raise DesignError(f"camera: expected width and height, 10 px or more, and at most {most} megapixels")


def start_document() -> dict[str, Any]:
    """What the page needs first: the form's schema, and the templates with their words."""
    schema = design_schema()
    for dotted, kind in LIBRARIES.items():
        table, field = dotted.split(".")
        model = schema["properties"][table]["$ref"].rpartition("/")[2]
        schema["$defs"][model]["properties"][field]["enum"] = list(library_names(kind))
    words = {name: template_words(path) for name, path in templates().items()}
    shown = [
        {"name": name, **of._asdict(), "fields": fields_of(load_design(name))} for name, of in words.items()
    ]
    return {"schema": schema, "templates": shown}


@cache
def library_names(kind: str) -> tuple[str, ...]:
    """The names of the templates of a kind; the files do not change while the page runs."""
    return tuple(template_kinds()[kind])


def fields_of(design: Any) -> dict[str, Any]:
    """The fields that are set, as a design file has them."""
    fields: dict[str, Any] = design.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    return fields


def design_of(fields: object) -> Design:
    """The design of a request. Fields that could name a file of this machine take names of templates only.

    Raises:
        DesignError: a field that ``Design`` refuses, or that names no template.
    """
    if not isinstance(fields, Mapping):
        raise DesignError("the design is no object of fields; reload the page")
    for dotted, kind in LIBRARIES.items():
        table, field = dotted.split(".")
        inner = fields.get(table)
        name = inner.get(field) if isinstance(inner, Mapping) else None
        known = library_names(kind)
        if name is not None and name not in known:
            raise DesignError(
                f"{dotted} = {str(name)[:60]!r}: the page takes names of templates only: {', '.join(known)}; "
                "a file of your own is for the command line"
            )
    return Design(**fields)


def design_document(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The drawing, labels, key figures and findings of the design of a request, and its TOML.

    Raises:
        DesignError: see ``design_of``; or a design without a layout.
    """
    design, look = design_of(asked.get("fields")), Look.of(asked)
    layout = design.layout
    report = design_report(design, layout, look.camera_px)
    findings = [*report.findings, *clip_findings(layout, look.camera_px)]
    to_sheet = sheet_from_layout(layout, look.is_back)
    labels: dict[str, Any] = {}
    if look.labels == "markers":
        ids = np.flatnonzero(layout.present)
        labels = {"text": ids.tolist(), "xy": to_sheet(layout.marker_xy_mm[ids]).tolist()}
    elif look.labels == "cells":
        centres = to_sheet(layout.marker_xy_mm[layout.cell_corners].mean(axis=1))
        labels = {"text": list(range(len(centres))), "xy": centres.tolist()}
    white = np.flatnonzero(layout.cell_color == WHITE)
    whites = [to_sheet(ring).tolist() for ring in layout.marker_xy_mm[layout.cell_corners[white]]]
    return {
        "svg": layout_to_compact_svg(layout, mirror=look.is_back),
        "labels": labels,
        "whites": whites,
        "report": {name: value for name, value in report_values(report).items() if name != "findings"},
        "findings": [finding_of(finding) for finding in findings],
        "toml": design_toml(fields_of(design)),
        "fields": fields_of(design),
    }


def finding_of(finding: Finding) -> dict[str, Any]:
    """A finding as in the documents, its line, and the fields that it names."""
    part = FindingPart.model_validate(finding, from_attributes=True)
    in_palette = any(word in finding.remedy for word in ("ink", "white", "black"))
    named = [*_fields_in(finding.remedy, False)] or [*_fields_in(finding.subject, in_palette)]
    return {**part.model_dump(), "text": str(finding), "fields": named}


def error_fields(text: str) -> list[str]:
    """The fields that the message of an error names."""
    return list(_fields_in(text, in_palette=False))


def proposed_design(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The design that ``size`` proposes for a camera, and its figures.

    Raises:
        CmpDesignError: see ``size``.
    """
    from cmpdesign.proposal.sizing import size

    make, error = asked.get("make") or None, str(asked.get("error") or "") or None
    proposal = size(str(asked.get("camera", "")), str(asked.get("view", "")), error, make=make)
    return {"fields": fields_of(proposal.design), "figures": proposal.figures()}


def remedy_of(asked: Mapping[str, Any]) -> dict[str, Any]:
    """A change of one field after which a finding is gone and no other finding has come; of a number the smallest.

    Args:
        asked: the request: design, camera, and the finding's subject.

    Returns:
        Field, dotted -> new value; empty where no single field helps.

    Raises:
        DesignError: see ``design_of``.
    """
    design, look, subject = design_of(asked.get("fields")), Look.of(asked), asked.get("subject")
    before = check_design(design, design.layout, look.camera_px)
    finding = next((each for each in before if each.subject == subject), None)
    if finding is None:
        return {}
    allowed = {each.subject for each in before} - {subject}

    def helps(dotted: str, value: Any) -> bool:
        try:
            changed = design_of(_with_value(fields_of(design), dotted, value))
            return {each.subject for each in check_design(changed, changed.layout, look.camera_px)} <= allowed
        except CmpDesignError:
            return False

    for dotted in dict.fromkeys((*finding_of(finding)["fields"], *_SIZE_FIELDS)):
        for ladder in _ladders(design, dotted):
            found = _lowest(ladder, partial(helps, dotted))
            if found is not None:
                return {dotted: found}
    return {}


def read_design_toml(text: str) -> dict[str, Any]:
    """The fields of a design file's text; ``extends`` takes the name of a template.

    Raises:
        DesignError, InputError: no TOML, or no design.
    """
    document = parse_toml(text, "the pasted text")
    extended = document.pop("extends", None)
    if extended is None:
        return fields_of(design_of(document))
    if extended not in templates():
        raise DesignError(
            f"extends = {str(extended)[:60]!r}: the page extends templates only: {', '.join(templates())}"
        )
    own = {"name": None, "description": None, "source": None}
    return fields_of(design_of(fields_of(load_design(extended, {**own, **document}))))


def _fields_in(text: str, in_palette: bool) -> Iterator[str]:
    """The fields that a text names, dotted; fields of tables also by their own name if it has an underscore."""
    known: dict[str, str] = {}
    for table in _TABLES:
        inner = getattr(Design.model_fields[table].annotation, "model_fields", {})
        known |= {f"{table}.{name}": f"{table}.{name}" for name in inner}
        known |= {
            name: f"{table}.{name}" for name in inner if "_" in name or (in_palette and table == "palette")
        }
    known |= {name: name for name in Design.model_fields if name not in {*_TABLES, *_NOT_IN_FINDINGS}}
    yield from dict.fromkeys(known[word] for word in _WORD.findall(text) if word in known)


def _ladders(design: Design, dotted: str) -> Iterator[list[Any]]:
    """Other values of a field: upwards, then downwards, each from the nearest to the farthest."""
    table, _, field = dotted.rpartition(".")
    owner = getattr(design, table) if table else design
    value, info = getattr(owner, field), type(owner).model_fields[field]
    if isinstance(value, bool):
        yield [not value]
    elif isinstance(value, int):
        yield [value - step for step in range(1, value)]
        yield [value + step for step in range(1, _STEPS)]
    elif isinstance(value, float):
        for sign in (1, -1):
            yield [float(f"{value * _STEP ** (sign * step):.3g}") for step in range(1, _STEPS)]
    elif table == "palette":
        yield [info.default]


def _lowest(ladder: Sequence[Any], helps: Callable[[Any], bool]) -> Any:
    """The first value that helps, where one that is twice as far does, too; None if none is found.

    Steps double until a value helps; then the interval is halved.
    """
    below, above, last = -1, 0, len(ladder) - 1
    while last >= 0 and not helps(ladder[above]):
        if above == last:
            return None
        below, above = above, min(2 * above + 1, last)
    if last < 0:
        return None
    while above - below > 1:
        middle = (above + below) // 2
        below, above = (below, middle) if helps(ladder[middle]) else (middle, above)
    return ladder[above]


def _with_value(fields: Mapping[str, Any], dotted: str, value: Any) -> dict[str, Any]:
    table, _, field = dotted.rpartition(".")
    if not table:
        return {**fields, field: value}
    return {**fields, table: {**fields.get(table, {}), field: value}}
