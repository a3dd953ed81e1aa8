"""Documents of the commands that take a design, and of the commands with which a design begins."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer, WithJsonSchema

from cmpdesign.documents.document import Document, DocumentPart
from cmpdesign.inputs.options import Make


class FindingPart(DocumentPart):
    """One feature that cannot be made or read."""

    severity: Literal["error", "warning"] = Field(
        description="error: the feature will not work. warning: the feature works under good conditions only."
    )
    subject: str
    value: float
    limit: float
    unit: str = Field(description="Unit of value and limit; empty for a plain number.")
    remedy: str


class PadReadingPart(DocumentPart):
    """The reading of the pad that a product makes; null where no marker was measured."""

    measured_share: float = Field(description="Measured markers over visible markers.")
    side_seen: Literal["front", "back"] | None
    rms_px: float | None = Field(description="Deviation of the markers from their nominal places.")
    rms_mm: float | None
    rms_pitch: float | None = Field(description="The same deviation, in distances of neighbouring markers.")
    worst_px: float | None
    worst_mm: float | None
    worst_pitch: float | None


class BuildDocument(Document):
    """What ``build`` made."""

    format: Literal["cmp-build"] = "cmp-build"
    version: Literal[1] = 1
    digest: str = Field(description="Of the layout, as in layout.json.")
    folder: str
    written: tuple[str, ...] = Field(description="Written files, with the folder.")
    removed: tuple[str, ...] = Field(description="Removed files of earlier builds.")
    report: dict[str, Any] = Field(description="Key figures, by the names of report.json.")
    as_made: dict[str, PadReadingPart] = Field(description="Product -> reading of its pad.")
    findings: tuple[FindingPart, ...]


class CheckDocument(Document):
    """What ``check`` found."""

    format: Literal["cmp-check"] = "cmp-check"
    version: Literal[1] = 1
    digest: str = Field(description="Of the layout, as in layout.json.")
    passed: bool = Field(description="True if no finding is an error.")
    as_made: dict[str, PadReadingPart] = Field(description="Product -> reading of its pad, with --read.")
    not_read: dict[str, str] = Field(description="Product -> why its pad cannot be made, with --read.")
    findings: tuple[FindingPart, ...]


def _rounded(digits: int) -> PlainSerializer:
    """A number is rounded in the document, not in the record."""
    return PlainSerializer(lambda value: round(value, digits))


def _given_fields(design: Any) -> dict[str, Any]:
    """The fields of a design's file, whose name is the design's."""
    given = design.model_fields_set - {"name"}
    return {name: getattr(design, name) for name in type(design).model_fields if name in given}


_OBJECT: dict[str, Any] = {"additionalProperties": True, "type": "object"}
Length = Annotated[float, _rounded(4)]


class SizeDocument(Document):
    """The design that ``size`` proposes, and the error that is predicted for it."""

    format: Literal["cmp-size"] = "cmp-size"
    version: Literal[1] = 1
    camera_px: tuple[int, int] = Field(description="Width and height of the camera's picture.")
    view_mm: tuple[float, float] = Field(description="Width and height of the field of view.")
    scale_px_per_mm: Length
    design: Annotated[Any, PlainSerializer(_given_fields), WithJsonSchema(_OBJECT)] = Field(
        description="The fields of a design file."
    )
    markers: int
    pitch_px: Annotated[float, _rounded(3)]
    error_px: Annotated[float, _rounded(5)] = Field(
        description="Predicted error per marker and axis, of inner markers."
    )
    error_um: Length
    rim_error_um: Length
    told_apart_mm: Length = Field(description="Smallest distance at which two touches can be told apart.")
    limit: str = Field(description="Limit that a finer pattern would exceed.")
    seen_mm: tuple[Length, Length] = Field(description="Width and height of what all pixels see.")
    make: Make | None = Field(description="Product that makes the pad.")
    next_command: str = Field(description="The command that makes the design's files.")


class TemplatePart(DocumentPart):
    """One template."""

    kind: str
    name: str
    description: str
    source: str = Field(description="Source of the values; empty where each value has a source of its own.")


class TemplatesDocument(Document):
    """The templates that ``templates`` lists."""

    format: Literal["cmp-templates"] = "cmp-templates"
    version: Literal[1] = 1
    templates: tuple[TemplatePart, ...]


class TemplateDocument(Document):
    """The template that ``templates --show`` shows."""

    format: Literal["cmp-template"] = "cmp-template"
    version: Literal[1] = 1
    kind: str
    name: str
    text: str = Field(description="The TOML file.")


class StudioDocument(Document):
    """The page that ``studio`` or ``view`` serves; printed when the page can be opened."""

    format: Literal["cmp-studio"] = "cmp-studio"
    version: Literal[1] = 1
    address: str = Field(description="Address of the page on this machine, with the token of this run.")


class InitDocument(Document):
    """The design file that ``init`` wrote."""

    format: Literal["cmp-init"] = "cmp-init"
    version: Literal[1] = 1
    written: str
    extends: str | None
