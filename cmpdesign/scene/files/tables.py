"""The tables of a scene file: every name and number is checked before drawing.

A part's table has the names of its dataclass (``Camera``, ``Light`` ...), so every part has one definition.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from types import UnionType
from typing import Any, Literal, Self, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from cmpdesign.inputs.names import nearest_name
from cmpdesign.inputs.validation import shown_value
from cmpdesign.scene.camera.lens import LensKind
from cmpdesign.scene.camera.medium import Medium, WindowPlane
from cmpdesign.scene.camera.pinhole import Pinhole
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.errors import STRICT, SceneError
from cmpdesign.scene.parts.background import Busy, Gradient, Paper, Plain
from cmpdesign.scene.parts.damage import Damage
from cmpdesign.scene.parts.light import Light
from cmpdesign.scene.parts.optics import Optics
from cmpdesign.scene.parts.sensor import Sensor
from cmpdesign.scene.parts.surface import Dent, Press, Shear, Twist

Row = tuple[float, float, float]
RGB = tuple[float, float, float]
POSE_KEYS = ("focal_px", "centre_px", "R_camera_from_layout", "t_camera_from_layout_mm")
LOOKING_KEYS = (
    "distance_mm",
    "field_of_view_deg",
    "tilt_deg",
    "azimuth_deg",
    "roll_deg",
    "target_mm",
    "back",
)
BACKGROUNDS = {"plain": Plain, "gradient": Gradient, "paper": Paper, "busy": Busy}
UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")  # pydantic's kinds of errors
MAX_ERRORS, MAX_VALUE_LETTERS = 20, 80  # of a message
MUST_BE = "; it must be "  # between a value and the type that it must have
TYPE_NAME = re.compile(r"float|str|[a-z-]+\[.*\]", re.DOTALL)  # as pydantic writes the types of a union
# A key frame's value is a number, or a position as [x, y] or [x, y, z].
Value = float | tuple[float, ...]


class SceneTable(BaseModel):
    """Base of all tables: strict and frozen."""

    model_config = ConfigDict(frozen=True, **STRICT)  # type: ignore[typeddict-item]


class ViewTable(SceneTable):
    """[[view]]: a pinhole, placed by its pose or by its target."""

    name: str = ""
    area_px: tuple[int, int, int, int] | None = None
    lens: LensKind = "perspective"
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    mirrored: bool | None = None
    focal_px: tuple[float, float] | None = None
    centre_px: tuple[float, float] | None = None
    R_camera_from_layout: tuple[Row, Row, Row] | None = None
    t_camera_from_layout_mm: Row | None = None
    distance_mm: float | None = None
    field_of_view_deg: float | None = None
    tilt_deg: float = 0.0
    azimuth_deg: float = 0.0
    roll_deg: float = 0.0
    target_mm: Row = (0.0, 0.0, 0.0)
    back: bool = False
    window_normal: Row | None = None
    window_distance_mm: float | None = None

    @model_validator(mode="after")
    def _one_window(self) -> Self:
        if (self.window_normal is None) != (self.window_distance_mm is None):
            raise ValueError("window_normal and window_distance_mm go together; give both or none")
        return self

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = self.model_fields_set
        aimed = [name for name in LOOKING_KEYS if name in given]
        posed = [name for name in POSE_KEYS if name in given]
        if aimed and posed:
            raise ValueError(f"{posed[0]} and {aimed[0]} place the camera twice; leave one of the two out")
        needed = LOOKING_KEYS[:2] if aimed else POSE_KEYS
        for name in needed:
            if name not in given:
                other = POSE_KEYS if aimed else LOOKING_KEYS[:2]
                raise ValueError(f"{name} is missing (or give {', '.join(other)} alone)")
        return self

    def pinhole(self, size: tuple[int, int]) -> Pinhole:
        """The camera in an image of ``size`` (width, height) px.

        Raises:
            SceneError: a value is out of range, or ``mirrored`` contradicts the pose.
        """
        window = None
        if self.window_normal is not None and self.window_distance_mm is not None:
            window = WindowPlane(self.window_normal, self.window_distance_mm)
        if self.distance_mm is None:
            camera = Pinhole(
                cast(tuple[float, float], self.focal_px),
                cast(tuple[float, float], self.centre_px),
                self.distortion,
                np.array(self.R_camera_from_layout),
                np.array(self.t_camera_from_layout_mm),
                self.area_px,
                self.name,
                window,
                self.lens,
            )
            reflects = bool(np.linalg.det(camera.R_camera_from_layout) < 0)
            if self.mirrored is not None and self.mirrored != reflects:
                raise SceneError(
                    f"mirrored is {str(self.mirrored).lower()}, but the determinant of R_camera_from_layout is "
                    f"{-1 if reflects else 1}; it is -1 where an odd number of mirrors stands between, leave one out"
                )
            return camera
        looking = {
            name: getattr(self, name) for name in (*LOOKING_KEYS, "distortion", "lens", "area_px", "name")
        }
        return replace(Pinhole.looking(size, mirror=bool(self.mirrored), **looking), window=window)


class SurfaceTable(SceneTable):
    """[surface]: deformations, applied in the file's order."""

    press: Press | None = None
    twist: Twist | None = None
    shear: Shear | None = None
    dent: Dent | None = None


class SequenceTable(SceneTable):
    """[sequence]: the number of frames, and the values that change.

    ``values`` holds, for a dotted path of names, key frames [time in s, value]. Values are linear between key frames.
    """

    frames: int = Field(ge=1, le=1_000_000)
    fps: float = Field(default=30.0, gt=0, le=10_000)
    values: dict[str, tuple[tuple[float, Value], ...]]

    @model_validator(mode="after")
    def _increasing(self) -> Self:
        for path, keys in self.values.items():
            times = [key[0] for key in keys]
            if not times or any(b <= a for a, b in pairwise(times)):
                raise ValueError(
                    f"values.{path}: the times are {times}; give at least one time, in increasing order"
                )
            if len({len(v) if isinstance(v, tuple) else -1 for _, v in keys}) != 1:
                raise ValueError(
                    f"values.{path}: the values have different shapes; give the same number of numbers for each time"
                )
        return self


class BackgroundTable(SceneTable):
    """[background] of a picture; generated backgrounds have the names of their dataclass."""

    kind: Literal["picture"]
    path: str


class SceneTables(SceneTable):
    """A whole scene file. Absent tables are None and not computed."""

    size_px: tuple[int, int] = (640, 480)
    seed: int = Field(default=0, ge=0)
    camera: Camera | None = None
    view: tuple[ViewTable, ...] | None = None
    surface: SurfaceTable | None = None
    contact: dict[str, Any] | None = None
    medium: Medium | None = None
    light: Light | None = None
    background: dict[str, Any] | None = None
    optics: Optics | None = None
    sensor: Sensor | None = None
    damage: Damage | None = None
    inks: dict[str, RGB | str] = {}
    sequence: SequenceTable | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.camera is not None and self.view is not None:
            raise ValueError("[camera] and [[view]] both place the camera; leave one out")
        if self.view is not None and not self.view:
            raise ValueError("view is empty; give at least one [[view]] table, or leave view out")
        if not all(10 <= side <= 9999 for side in self.size_px):
            raise ValueError(f"size_px is {list(self.size_px)}; each side must lie between 10 and 9999 px")
        return self


def read_tables(document: Mapping[str, Any]) -> SceneTables:
    """The checked tables of a TOML document.

    Raises:
        SceneError: the message names table, key, value and limit; for an unknown name a similar known one.
    """
    return cast(SceneTables, _validate_table(SceneTables, document, ""))


def read_background(table: Mapping[str, Any]) -> Any:
    """[background] as its part, or as a ``BackgroundTable`` for a picture.

    Raises:
        SceneError: see ``read_tables``.
    """
    kinds = [*BACKGROUNDS, "picture"]
    kind = table.get("kind")
    if kind not in kinds:
        raise SceneError(
            f"[background] kind is {kind!r}{nearest_name(kind, kinds)}; it is one of {', '.join(kinds)}"
        )
    if kind == "picture":
        return _validate_table(BackgroundTable, table, "background")
    return _validate_table(
        BACKGROUNDS[str(kind)], {key: table[key] for key in table if key != "kind"}, "background"
    )


def _validate_table(model: type, table: Mapping[str, Any], where: str) -> Any:
    try:
        # Strict validation of JSON accepts lists for tuples and tables for dataclasses, but no texts for numbers.
        return TypeAdapter(model).validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        messages = [_error_message(item, model, where) for item in error.errors()[:MAX_ERRORS]]
        raise SceneError("; ".join(_join_alternatives(messages))) from None


def _error_message(item: Any, model: type, where: str) -> str:
    *parents, last = item["loc"] or ("",)
    is_name = item["type"] in UNKNOWN or not _is_type_name(last)
    inner = [part for part in parents if not _is_type_name(part)] + ([last] if is_name else [])
    path: list[int | str] = [where, *inner] if where else inner
    text, kind = item["msg"].removeprefix("Value error, ").removeprefix("Input should be "), item["type"]
    if kind == "value_error":  # a part's own check: the message names the key
        return f"{_table_label(path)}{text}"
    table, key = _table_label(path[:-1]), str(path[-1])
    if kind in UNKNOWN:
        known = _known_names(model, inner[:-1])
        return f"{table}{key} is unknown{nearest_name(key, known)}; there are {', '.join(known)}"
    if kind == "too_long":
        found, most = item["ctx"]["actual_length"], item["ctx"]["max_length"]
        return f"{table}{key} has {found} values; it takes {most}"
    if kind in ("missing", "missing_argument"):
        few = isinstance(inner[-1], int)
        return (
            f"{_table_label(path[:-2])}{path[-2]} has too few values" if few else f"{table}{key} is missing"
        )
    unit = next((f" in {unit}" for unit in ("mm", "deg", "px") if key.endswith(f"_{unit}")), "")
    text = text.replace("an object", "a table").replace("a valid array", "a list")
    shown = "a table" if isinstance(item["input"], dict) else json.dumps(item["input"])
    shown = shown if len(shown) <= MAX_VALUE_LETTERS else shown_value(item["input"])
    return f"{table}{key} is {shown}{MUST_BE}{text}{unit}"


def _join_alternatives(messages: list[str]) -> list[str]:
    """One message a value: pydantic reports a value once for each type that does not fit."""
    wanted: dict[str, list[str]] = {}
    for message in messages:
        value, _, type_text = message.partition(MUST_BE)
        wanted.setdefault(value, []).append(type_text)
    return [
        value + (MUST_BE + " or ".join(dict.fromkeys(texts)) if any(texts) else "")
        for value, texts in wanted.items()
    ]


def _is_type_name(part: int | str) -> bool:
    """Whether a part of an error's path is a type: pydantic inserts the types of unions into paths."""
    return isinstance(part, str) and bool(TYPE_NAME.fullmatch(part))


def _table_label(path: list[int | str]) -> str:
    """The prefix of messages for the path of a table, such as "[light] leds.0."; empty for the document."""
    if not path:
        return ""
    if path[0] == "view" and len(path) > 1:
        return f"[[view]] {path[1]}: " + "".join(f"{part}." for part in path[2:])
    return f"[{path[0]}] " + "".join(f"{part}." for part in path[1:])


def _known_names(model: Any, path: list[int | str]) -> list[str]:
    """The names that are allowed in the table at a path."""
    for part in path:
        if not isinstance(part, int):
            model = _inner_table_class(_type_hints(model)[part])
    return list(_type_hints(model))


def _type_hints(model: Any) -> dict[str, Any]:
    if is_dataclass(model):
        hints = get_type_hints(model)
        return {field.name: hints[field.name] for field in fields(model)}
    return {name: field.annotation for name, field in model.model_fields.items()}


def _inner_table_class(hint: Any) -> Any:
    """The table's class in a type such as "Led | None" or "tuple[Led, ...]"."""
    if get_origin(hint) in (Union, UnionType, tuple):
        return next(
            found for found in map(_inner_table_class, get_args(hint)) if found not in (type(None), Ellipsis)
        )
    return hint
