"""The tables of a sensor file, version 1: checked values; the rig's own tables are checked by the extractor."""

from __future__ import annotations

import datetime
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError, DesignError, SourceError
from cmpdesign.inputs.cameras import CameraSettings
from cmpdesign.inputs.names import Line, Name, nearest_name
from extractor.image.response import light_of_values

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
    young_mpa: Positive | None = None
    young_sigma_mpa: float = Field(0.0, ge=0)
    poisson: float = Field(0.5, ge=0, le=0.5)
    marker_depth_mm: float = Field(0.0, ge=0)
    friction: Positive | None = Field(None, description="Coefficient of friction, for the utilisation.")
    gel: str | None = Field(None, min_length=1, description="The file of calibrate gel.")

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


class CameraCalibrationTable(_StrictTable):
    """What ``calibrate camera`` found."""

    date: datetime.date | None = None
    model: Line = ""
    pictures: int = 0
    refused: tuple[Line, ...] = ()
    points: int = 0
    rms_px: float = Field(0.0, ge=0)
    scale: float = Field(1.0, ge=0)
    ray_px: float = Field(0.0, ge=0)
    sheet_bend_mm: float = 0.0
    held: tuple[Line, ...] = ()
    parameters: tuple[Line, ...] = ()
    covariance: tuple[tuple[float, ...], ...] = ()

    @model_validator(mode="after")
    def _covariance(self) -> CameraCalibrationTable:
        count = len(self.parameters)
        if any(len(row) != count for row in self.covariance) or len(self.covariance) not in (0, count):
            raise ValueError(
                f"covariance has {len(self.covariance)} rows; expected {count} rows of {count} numbers"
            )
        if self.covariance:
            found = np.array(self.covariance)
            if not np.allclose(found, found.T, rtol=1e-4) or np.linalg.eigvalsh(_unit(found))[0] <= 0:
                raise ValueError("covariance is not symmetric and positive; copy it from the camera file")
        return self


class RigCalibrationTable(_StrictTable):
    """What ``calibrate rig`` found."""

    date: datetime.date | None = None
    layout_digest: Line = ""
    pictures: int = 0
    steps_mm: tuple[float, ...] = ()
    rms_px: tuple[float, ...] = ()
    scale: float = Field(1.0, ge=0)
    depth_share: float = Field(0.0, ge=0)
    parameters: tuple[Line, ...] = ()
    stated: tuple[float, ...] = ()
    deviations: tuple[float, ...] = ()
    held: tuple[Line, ...] = ()


class Calibrations(_StrictTable):
    """The sensor's calibrations."""

    camera: CameraCalibrationTable | None = None
    rig: RigCalibrationTable | None = None


class CameraTable(_StrictTable):
    """The camera, and what its driver is asked for; None: as the driver has it. Its size is the file's ``size_px``."""

    source: Line = Field(
        default="", description="As on the command line; of several cameras joined by commas."
    )
    fps: Positive | None = None
    format: Line | None = Field(default=None, description="Four letters of the pixel format, as MJPG.")
    exposure_ms: Positive | None = None
    gain: float | None = Field(default=None, ge=0)
    white_balance_k: Positive | None = None
    focus: float | None = Field(default=None, ge=0)

    @field_validator("format")
    @classmethod
    def _is_format(cls, value: str | None) -> str | None:
        try:
            CameraSettings(camera_format=value)
        except SourceError:
            raise ValueError(f"{value!r} is no pixel format; expected four letters, as in MJPG") from None
        return value


class LimitsTable(_StrictTable):
    """What a user of the sensor accepts; ``calibrate check`` and the running sensor report what lies beyond.

    Attributes:
        max_age_ms: Chosen: 100, three frames of a camera of 30 frames a second.
        max_rest_error_px: None: by the stated deviations of the markers.
        min_share_read: Chosen: 0.9, since a rest frame shows nearly all markers.
    """

    max_age_ms: Positive = Field(default=100.0, description="Of a result, from the middle of its exposure.")
    max_rest_error_px: Positive | None = Field(default=None, description="RMS at rest, per axis.")
    min_share_read: float = Field(
        default=0.9, ge=0, le=1, description="Markers measured, of those in view at rest."
    )


class SensorTable(_StrictTable):
    """The file without the tables of its rig, which the extractor's reader checks.

    ``patterns``, ``contact``, ``load`` and ``conditions`` serve simulations alone.
    """

    format: Literal["cmp-sensor"] = "cmp-sensor"
    version: Literal[1] = 1
    name: Name = ""
    description: Line = ""
    source: Line = ""
    layout: Annotated[str, Field(min_length=1)] | None = None
    size_px: tuple[Pixels, Pixels] | None = None
    patterns: dict[str, dict[str, Any]] = Field(default_factory=dict)
    camera: CameraTable = CameraTable()
    limits: LimitsTable = LimitsTable()
    elastomer: ElastomerTable | None = None
    contact: ContactTable | None = None
    calibration: Calibrations = Calibrations()
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

    @property
    def camera_settings(self) -> CameraSettings:
        """What the camera's driver is asked for."""
        asked = self.camera
        return CameraSettings(
            self.size_px,
            asked.fps,
            asked.format,
            asked.exposure_ms,
            asked.gain,
            asked.white_balance_k,
            asked.focus,
        )

    @field_validator("response")
    @classmethod
    def _known_response(cls, value: str | float | tuple[float, ...]) -> str | float | tuple[float, ...]:
        light_of_values(cast(SensorResponse, value))
        return value


def _unit(covariance: Any) -> Any:
    root = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    root[root == 0] = 1.0
    return covariance / root / root[:, None]
