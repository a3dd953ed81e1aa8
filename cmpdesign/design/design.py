"""The validated parameters of a design, and their TOML files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from cmpdesign.design.fiducials import Fiducials
from cmpdesign.design.laser_options import LaserOptions
from cmpdesign.design.mold_options import MoldOptions
from cmpdesign.design.quantities import Angle, Color, Length, LengthOrZero
from cmpdesign.design.sheet_options import SheetOptions
from cmpdesign.errors import DesignError, InputError
from cmpdesign.inputs.documents import parse_toml
from cmpdesign.inputs.names import MAX_NAME_LETTERS, Line, Name, nearest_name
from cmpdesign.inputs.validation import validation_message
from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.graphs import MAX_LAYERS, TRIANGULAR_GRAPHS
from cmpdesign.patterns.pad_code import DEFAULT_SHARE, MAX_CODE, MAX_SHARE, MIN_SHARE

# An ellipse flatter than 4 : 1 has cells with corners below 15 degrees, which cannot be printed or read.
ASPECT_MIN, ASPECT_MAX = 0.25, 4.0
SMALLEST_PITCH_MM = 0.001
MAX_VIRTUAL_PER_EDGE = 100


class _StrictModel(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise DesignError(validation_message(error, type(self))) from None


class Palette(BaseModel):
    """The inks, as "#rrggbb"."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    red: Color = "#c8322d"
    green: Color = "#28963c"
    blue: Color = "#2d3cbe"
    black: Color = "#141414"
    white: Color = "#f5f5f5"


class Design(_StrictModel):
    """Validated parameters of a pattern. Lengths in mm; texts such as "60mil" are converted.

    A size is given in one of these ways; every other combination is refused with a remedy:

    * ``pitch_mm`` and ``layers``;
    * ``width_mm`` and/or ``height_mm`` (overall) and ``layers``: the largest pitch that fits;
    * ``width_mm`` and/or ``height_mm`` and ``pitch_mm``: as many layers as fit;
    * ``pitch_mm`` and a clip outline: as many layers as cover the outline.

    Raises:
        DesignError: an unknown, missing, impossible or contradictory parameter.
    """

    name: Name = Field("", description="The design's name, for captions and reports.")
    description: Line = Field("", description="One sentence about the design.")
    source: Line = Field(
        "", description='Source of the dimensions; "assumed" for dimensions that are not published.'
    )

    pattern: str = Field(description="Name of the registered pattern.")
    layers: int | None = Field(
        None, ge=1, le=MAX_LAYERS, strict=True, description="Number of layers around the centre."
    )
    pitch_mm: Length | None = Field(None, description="Distance between neighbouring markers (layers).")
    width_mm: Length | None = Field(
        None, description="Overall width with border and rotation, before clipping."
    )
    height_mm: Length | None = Field(
        None, description="Overall height with border and rotation, before clipping."
    )
    aspect: float | None = Field(
        None, ge=ASPECT_MIN, le=ASPECT_MAX, description="Elliptical: height over width of a layer, b / a."
    )
    spacing: Literal["angle", "arc"] | None = Field(
        None, description="Elliptical: equal steps of the parameter angle, or of arc length."
    )
    border_mm: LengthOrZero = Field(1.0, description="Width of the black border around the pattern.")
    rotation_deg: Angle = Field(
        0.0, description="Counter-clockwise turn of the pattern, seen from the front."
    )
    mirrored: bool = Field(False, strict=True, description="True if the camera sees the pattern's back.")
    virtual_per_edge: int = Field(
        5, ge=0, le=MAX_VIRTUAL_PER_EDGE, strict=True, description="Number of virtual markers on every edge."
    )

    code: int = Field(
        0,
        ge=0,
        le=MAX_CODE,
        strict=True,
        description="Number of the pad's code: more black cells are white, and parts of the pad are numbered. 0: none.",
    )
    code_share: float = Field(
        DEFAULT_SHARE,
        ge=MIN_SHARE,
        le=MAX_SHARE,
        description="With a code: share of the black cells that are white.",
    )

    clip: Literal["none", "rectangle", "circle"] = Field(
        "none",
        description="Outline around the centre; cells that are not inside the outline (less the border) are removed.",
    )
    clip_width_mm: Length | None = Field(None, description="Width of a rectangular clip outline.")
    clip_height_mm: Length | None = Field(None, description="Height of a rectangular clip outline.")
    clip_diameter_mm: Length | None = Field(None, description="Diameter of a circular clip outline.")

    palette: Palette = Field(default_factory=Palette, description="The inks.")
    fiducials: Fiducials = Field(
        default_factory=lambda: Fiducials.model_validate({}),
        description="Marks around the pattern that align jobs, prints and molds.",
    )
    laser: LaserOptions = Field(
        default_factory=lambda: LaserOptions.model_validate({}),
        description="Parameters of the laser job; for --only laser.",
    )
    mold: MoldOptions = Field(
        default_factory=lambda: MoldOptions.model_validate({}),
        description="Parameters of the molds; for --only mold,mesh.",
    )
    sheet: SheetOptions = Field(
        default_factory=lambda: SheetOptions.model_validate({}),
        description="Parameters of the print sheet; for --only print.",
    )

    print_ids: bool = Field(False, strict=True, description="SVG: write the id beside every marker.")
    print_scale: bool = Field(
        False, strict=True, description="SVG: a scale bar and a caption below the pattern."
    )
    print_mirror: bool = Field(False, strict=True, description="SVG: mirror the drawing, for transfer film.")

    @field_validator("pattern")
    @classmethod
    def _known_pattern(cls, value: str) -> str:
        if value not in registered_patterns():
            raise ValueError(
                f"{value!r} is no pattern{nearest_name(value, registered_patterns())}; there are "
                f"{', '.join(registered_patterns())}"
            )
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Design:
        for problem in (self._size_problem(), self._clip_problem(), self._option_problem()):
            if problem:
                raise ValueError(problem)
        return self

    def _size_problem(self) -> str:
        overall = self.width_mm is not None or self.height_mm is not None
        given = (self.pitch_mm is not None, self.layers is not None, overall)
        if self.pitch_mm is not None and self.pitch_mm < SMALLEST_PITCH_MM:
            return f"pitch_mm = {self.pitch_mm:g} mm is below {SMALLEST_PITCH_MM} mm; is the unit right?"
        if all(given):
            return (
                "pitch_mm, layers and an overall size (width_mm, height_mm) fix the size twice; "
                "leave one of the three out (a value of a template by layers=none)"
            )
        if sum(given) == 2 or (self.pitch_mm is not None and self.clip != "none"):
            return ""
        missing = "pitch_mm or width_mm" if self.layers is not None else "layers"
        if not any(given):
            missing = "pitch_mm and layers"
        elif overall:
            missing = "layers or pitch_mm"
        return (
            f"the size is not fixed; add {missing} "
            "(a size is pitch_mm + layers, overall size + layers, or overall size + pitch_mm)"
        )

    def _clip_problem(self) -> str:
        needed = {"rectangle": ("clip_width_mm", "clip_height_mm"), "circle": ("clip_diameter_mm",)}
        for field in ("clip_width_mm", "clip_height_mm", "clip_diameter_mm"):
            wanted, value = field in needed.get(self.clip, ()), getattr(self, field)
            if wanted and value is None:
                return f'clip = "{self.clip}" needs {field}'
            if not wanted and value is not None:
                owner = next(clip for clip, fields in needed.items() if field in fields)
                return f'{field} needs clip = "{owner}", but clip is "{self.clip}"'
            if value is not None and value <= 2 * self.border_mm:
                return (
                    f"{field} = {value:g} mm leaves no area inside a border of {self.border_mm:g} mm "
                    f"on both sides; make it larger than {2 * self.border_mm:g} mm or the border smaller"
                )
        return ""

    def _option_problem(self) -> str:
        if self.code and registered_patterns()[self.pattern].graph is not TRIANGULAR_GRAPHS:
            return (
                f"code = {self.code} is an option of triangular patterns, not of {self.pattern}; leave it out"
            )
        for option in ("aspect", "spacing"):
            if getattr(self, option) is None or option in registered_patterns()[self.pattern].options:
                continue
            takers = ", ".join(
                name for name, pattern in registered_patterns().items() if option in pattern.options
            )
            return f"{option} is an option of the pattern {takers}, not of {self.pattern}; leave it out"
        return ""


def load_design(name_or_path: str | Path, overrides: Mapping[str, object] | None = None) -> Design:
    """Load a design from a template's name or a TOML file, with all that the file extends, and values overridden.

    Args:
        name_or_path: a template's name ("tac3d") or the path of a TOML file.
        overrides: field -> value, or a text as ``--set`` takes it. "palette.red" names a field of a table. None and the
            text "none" remove the field.

    Raises:
        DesignError: no such template or file, not TOML, a circle of files that extend each other, or a parameter
            that ``Design`` refuses.

    >>> design = load_design("honeycomb", {"pitch_mm": "60mil", "layers": 3})
    >>> design.pitch_mm, design.layers
    (1.524, 3)
    """
    from cmpdesign.design.extends import read_design_file
    from cmpdesign.design.templates import find_design

    path = find_design(name_or_path)
    data = read_design_file(path)
    try:
        _update_overrides(data, overrides or {})
        data.setdefault("name", path.stem[:MAX_NAME_LETTERS])
        return Design(**data)
    except DesignError as error:
        raise DesignError(f"{name_or_path}: {error}") from None


def design_schema() -> dict[str, Any]:
    """The JSON Schema of a design's TOML, for editors; stored in ``templates/design.schema.json``."""
    schema = Design.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "cmpdesign design"
    schema["properties"]["pattern"]["enum"] = list(registered_patterns())
    extends = {
        "type": "string",
        "minLength": 1,
        "description": "A template, or a file's path relative to this file's folder: the design that gives all fields "
        "which this file does not set.",
    }
    schema["properties"] = {"extends": extends, **schema["properties"]}
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["extends"]}]
    return schema


def design_schema_text() -> str:
    """The text of the file ``design.schema.json``."""
    return json.dumps(design_schema(), indent=2, ensure_ascii=False) + "\n"


def _update_overrides(data: dict[str, Any], overrides: Mapping[str, object]) -> None:
    """Write the overrides into the document."""
    for dotted, value in overrides.items():
        *tables, field = dotted.split(".")
        target = data
        for table in tables:
            target = target.setdefault(table, {})
            if not isinstance(target, dict):
                raise DesignError(
                    f"{dotted}: {table} is not a table{nearest_name(dotted, Design.model_fields)}"
                )
        if value is None or value == "none":
            target.pop(field, None)
        elif isinstance(value, Mapping):
            _update_overrides(data, {f"{dotted}.{name}": inner for name, inner in value.items()})
        else:
            target[field] = _parse_toml_value(value) if isinstance(value, str) else value


def _parse_toml_value(text: str) -> object:
    """The TOML value of a text, or the text itself: "3" is a number, "60mil" a text."""
    try:
        document = parse_toml(f"value = {text}", "")
    except InputError:
        return text
    return document["value"] if document.keys() == {"value"} else text
