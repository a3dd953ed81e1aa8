"""A simulated sensor in one TOML file: views, patterns, elastomer, and the ranges of imaging conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError, DesignError, InputError
from cmpdesign.inputs.documents import parse_toml
from cmpdesign.inputs.files import path_exists, read_text
from cmpdesign.inputs.names import Line, Name, nearest_name
from cmpdesign.inputs.validation import validation_message
from extractor.image.response import light_of_values

if TYPE_CHECKING:
    from cmpdesign.contact import Elastomer
    from cmpdesign.scene import Medium, Pinhole
    from extractor.space.rig import Rig

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, lt=1)]
Pixels = Annotated[int, Field(ge=16, le=20_000)]
Counts = tuple[Annotated[int, Field(ge=0, le=100)], Annotated[int, Field(ge=0, le=100)]]
SensorResponse = Literal["srgb", "linear"] | float | tuple[float, ...]
METHODS = ("square", "multicolor")
OBJECTS = ("ball", "ring", "cylinder", "rib", "wedge", "large_ball", "cube")


class SensorError(CmpDesignError, ValueError):
    """A sensor file that cannot be used."""


class _StrictTable(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ElastomerTable(_StrictTable):
    """The elastic layer, bonded to the sensor's window."""

    thickness_mm: Positive
    young_mpa: Positive
    poisson: float = Field(0.5, ge=0, le=0.5)
    marker_depth_mm: float = Field(0.0, ge=0)

    @model_validator(mode="after")
    def _within(self) -> ElastomerTable:
        if self.marker_depth_mm >= self.thickness_mm:
            raise ValueError(
                f"marker_depth_mm is {self.marker_depth_mm:g}; it must be below thickness_mm, {self.thickness_mm:g}"
            )
        return self


class ContactTable(_StrictTable):
    """The solver's parameters of contacts."""

    friction: float = Field(ge=0)
    size_mm: tuple[Positive, Positive]
    grid: int = Field(256, ge=16, le=2048)
    steps: int = Field(8, ge=1, le=1000)


class LoadTable(_StrictTable):
    """One contact of the set for comparing designs; a positive twist is counter-clockwise from the front."""

    object: str
    press_mm: float = Field(ge=0)
    shear_mm: tuple[float, float] = (0.0, 0.0)
    twist_deg: float = Field(0.0, ge=-180, le=180)

    @field_validator("object")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in OBJECTS:
            raise ValueError(f"{value!r} is no object; there are {', '.join(OBJECTS)}")
        return value


class ConditionRanges(_StrictTable):
    """Ranges of imaging conditions, sampled uniformly in every trial."""

    level: tuple[Positive, Positive] = (1.0, 1.0)
    tint: Share = 0.0
    gradient: Share = 0.0
    vignetting: tuple[Share, Share] = (0.0, 0.0)
    lamps: Counts = (0, 0)
    lamp_level: Annotated[float, Field(ge=0)] = 0.0
    blur_px: tuple[Annotated[float, Field(ge=0.1, le=20)], Annotated[float, Field(ge=0.1, le=20)]] = (1, 1)
    noise: tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)]] = (2.0, 2.0)
    specks: Counts = (0, 0)
    speck_radius_mm: tuple[Positive, Positive] = (0.1, 0.1)

    @model_validator(mode="after")
    def _in_order(self) -> ConditionRanges:
        for name in ("level", "vignetting", "lamps", "blur_px", "noise", "specks", "speck_radius_mm"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} is [{low:g}, {high:g}]; give the smaller limit first")
        return self


class SensorTable(_StrictTable):
    """The file without its [[view]] tables and its [medium], which the extractor's reader checks."""

    name: Name = ""
    description: Line = ""
    source: Line = ""
    size_px: tuple[Pixels, Pixels]
    patterns: dict[str, dict[str, Any]] = Field(default_factory=dict)
    elastomer: ElastomerTable
    contact: ContactTable
    response: str | float | tuple[float, ...] = "srgb"
    load: tuple[LoadTable, ...] = ()
    conditions: ConditionRanges = ConditionRanges()

    @field_validator("patterns")
    @classmethod
    def _known_patterns(cls, value: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        for name, design in value.items():
            if name not in METHODS:
                raise ValueError(
                    f"{name} is unknown{nearest_name(name, METHODS)}; there are {', '.join(METHODS)}"
                )
            try:
                Design(**design)
            except DesignError as error:
                raise ValueError(f"{name}: {error}") from None
        return value

    @field_validator("response")
    @classmethod
    def _known_response(cls, value: str | float | tuple[float, ...]) -> str | float | tuple[float, ...]:
        light_of_values(cast(SensorResponse, value))
        return value


@dataclass(frozen=True, eq=False)
class SimulatedSensor:
    """The content of a sensor file.

    Attributes:
        table: the tables.
        rig: the views, with their poses.
        text: the file's text.
    """

    table: SensorTable
    rig: Rig
    text: str

    @property
    def size_px(self) -> tuple[int, int]:
        return self.table.size_px

    @property
    def response(self) -> SensorResponse:
        """The relation of light and the picture's values, as of a scene's sensor."""
        return cast(SensorResponse, self.table.response)

    @cached_property
    def cameras(self) -> tuple[Pinhole, ...]:
        """The views as pinholes of the renderer."""
        from cmpdesign.scene import Pinhole, WindowPlane

        return tuple(
            Pinhole(
                focal_px=(view.focal_px[0], view.focal_px[1]),
                centre_px=(view.centre_px[0], view.centre_px[1]),
                distortion=view.distortion,
                lens=view.lens,
                R_camera_from_layout=view.R_camera_from_layout,
                t_camera_from_layout_mm=view.t_camera_from_layout_mm,
                area_px=view.area_px,
                name=view.name,
                window=WindowPlane(*view.window) if view.window else None,
            )
            for view in self.rig.views
        )

    @cached_property
    def medium(self) -> Medium | None:
        """Window and gel between the pattern and the cameras; None: air."""
        from cmpdesign.scene import Medium

        found = self.rig.views[0].medium
        if found is None:
            return None
        return Medium(found.gel_mm, found.gel_index, found.window_mm, found.window_index)

    @cached_property
    def elastomer(self) -> Elastomer:
        from cmpdesign.contact import Elastomer

        table = self.table.elastomer
        return Elastomer(table.thickness_mm, table.young_mpa, table.poisson, table.marker_depth_mm)

    def pattern(self, method: str) -> Mapping[str, Any]:
        """The design of ``square`` or ``multicolor``.

        Raises:
            SensorError: the file has no such pattern.
        """
        if method not in self.table.patterns:
            raise SensorError(
                f"the sensor has no [patterns.{method}]; give one to compare {', '.join(METHODS)}"
            )
        return self.table.patterns[method]


def find_sensor(name_or_path: str | Path) -> Path:
    """The file of a sensor template, or of a path.

    Raises:
        SensorError: neither.
    """
    from cmpdesign.design.templates import templates_folder

    shipped = {path.stem: path for path in sorted((templates_folder() / "sensors").glob("*.toml"))}
    if str(name_or_path) in shipped:
        return shipped[str(name_or_path)]
    path = Path(name_or_path)
    if path_exists(path):
        return path
    raise SensorError(
        f"{name_or_path}: no such sensor{nearest_name(name_or_path, shipped)}; there are {', '.join(shipped)}, "
        "or give a TOML file"
    )


def load_sensor(name_or_path: str | Path = "tac3d") -> SimulatedSensor:
    """Read a sensor file.

    Raises:
        SensorError: no such file, or a value cannot be used; the message names the value on one line.
    """
    path = find_sensor(name_or_path)
    try:
        text = read_text(path)
    except InputError as error:
        raise SensorError(str(error)) from None
    return parse_sensor(text, str(path))


def parse_sensor(text: str, where: str = "sensor") -> SimulatedSensor:
    """The sensor in a TOML text; ``where`` is the prefix of every error's message.

    Raises:
        SensorError: see ``load_sensor``.
    """
    from extractor.errors import ExtractorError
    from extractor.space.rig import parse_rig

    try:
        document = parse_toml(text, where)
        rig = parse_rig(text, where)
        for name in ("view", "medium"):
            document.pop(name, None)
        table = SensorTable.model_validate(document)
    except (InputError, ExtractorError) as error:
        raise SensorError(str(error)) from None
    except ValidationError as error:
        raise SensorError(f"{where}: {validation_message(error, SensorTable)}") from None
    for view in rig.views:
        if not view.placed:
            raise SensorError(
                f"{where}: view {view.name!r} has no pose; give R_camera_from_layout and t_camera_from_layout_mm"
            )
    return SimulatedSensor(table, rig, text)
