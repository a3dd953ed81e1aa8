"""The rig file: the views of a sensor. TOML, one [[view]] table for each view; unknown names are refused.

A scene file or a sensor file can also be used as a rig: only its [[view]] tables and its [medium] are read.

[[view]]
name = "left"
focal_px = [900.0, 900.0]
centre_px = [319.5, 239.5]
lens = "perspective"                       # or "fisheye"; may be left out
distortion = [0.0, 0.0, 0.0, 0.0, 0.0]     # 5, 8 or 12 coefficients, of a fisheye lens 4; may be left out
area_px = [0, 0, 320, 480]                 # x, y, width, height; left out: the whole image
mirrored = false                           # an odd number of mirrors in between; may be left out
# R_camera_from_layout = [[...], [...], [...]], t_camera_from_layout_mm = [...]: left out: from the rest frame
# window_normal = [0, 0, 1], window_distance_mm = 30.0: left out: parallel to the pattern at rest, behind the gel

[medium]                                   # between pattern and camera; left out: air
gel_mm = 4.0                               # from the pattern at rest to the window; 0: none
gel_index = 1.41
window_mm = 2.0
window_index = 1.49

[medium_deviation]                         # standard deviations of these numbers; left out: exact
gel_mm = 0.05

[[deviation]]                              # instead: as a calibration found them, independent of each other
name = "gel_index"                         # what it is, mostly
medium = [0.0, 0.004, 0.0, 0.0]            # gel_mm, gel_index, window_mm, window_index
lens = [[0.02, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]   # of each view: focal_px, centre_px, distortion
pose = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.01]]   # of each view: turn (rad) and shift (mm) along the camera's axes

[calibration.rig]                          # left out: the numbers hold for any pad
layout_digest = "..."                      # of the layout.json of the pad that was calibrated
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, NoReturn

from extractor.errors import RigError
from extractor.layout.json_fields import nearest_name, shown
from extractor.layout.reference import Reference
from extractor.layout.text_file import printable_path, read_text_file
from extractor.space.camera import View, counts_text
from extractor.space.lens import COUNTS
from extractor.space.medium import Medium, WindowPlane

NUMBER_COUNTS = {
    "focal_px": 2,
    "centre_px": 2,
    "area_px": 4,
    "t_camera_from_layout_mm": 3,
    "window_normal": 3,
}
REQUIRED_FIELDS = ("focal_px", "centre_px")
KNOWN_FIELDS = (
    "name",
    *NUMBER_COUNTS,
    "lens",
    "distortion",
    "mirrored",
    "R_camera_from_layout",
    "window_distance_mm",
)
MEDIUM_FIELDS = ("gel_mm", "gel_index", "window_mm", "window_index")
DEVIATION_FIELDS = ("name", "medium", "lens", "pose")
READ_TABLES = ("view", "medium", "medium_deviation", "deviation")
# Other tables in the files of scenes and of sensors; they have no properties of the views.
OTHER_TABLES = (
    "size_px", "seed", "camera", "surface", "contact", "light", "background", "optics", "sensor", "damage", "inks",
    "sequence", "name", "description", "source", "patterns", "elastomer", "response", "load", "conditions",
    "layout", "calibration", "format", "version", "limits",
)  # fmt: skip
MAX_BYTES = 1 << 24  # of a rig file
MAX_VIEWS = 64
MAX_DEVIATIONS = 100
MAX_NUMBER = 1e9  # of a rig's numbers, px or mm


@dataclass(frozen=True)
class Deviation:
    """One standard deviation of a rig of V views from its numbers, independent of the rig's other ones.

    Attributes:
        name: what it is, mostly.
        medium: offsets of the medium's ``gel_mm``, ``gel_index``, ``window_mm``, ``window_index``.
        lens: V times the offsets of fx, fy, cx, cy (px) and of the coefficients; empty: none.
        pose: V times a turn (rad) and a shift (mm) along the camera's axes, see ``Linearisation``; empty: none.
    """

    name: str
    medium: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    lens: tuple[tuple[float, ...], ...] = ()
    pose: tuple[tuple[float, ...], ...] = ()

    def applied(self, views: Sequence[View]) -> tuple[View, ...]:
        """The views with this deviation; a pose changes where the view has one."""
        return tuple(self._applied(view, number) for number, view in enumerate(views))

    def _applied(self, view: View, number: int) -> View:
        if any(self.medium):
            view = replace(view, medium=deviated_medium(view.medium, self.medium))
        if self.lens:
            view = deviated_lens(view, self.lens[number])
        return view.turned(self.pose[number]) if self.pose and view.placed else view


def deviated_medium(medium: Medium | None, offsets: Sequence[float]) -> Medium | None:
    """The medium with its numbers changed by offsets (4,); a layer that is absent stays absent."""
    if medium is None:
        return None
    changed = {
        name: getattr(medium, name) + offset
        for name, offset in zip(MEDIUM_FIELDS, map(float, offsets), strict=True)
        if offset and getattr(medium, name)
    }
    return replace(medium, **changed)


def deviated_lens(view: View, offsets: Sequence[float]) -> View:
    """The view with fx, fy, cx, cy and its coefficients changed by offsets (4 + K,)."""
    values = [
        a + float(b)
        for a, b in zip((*view.focal_px, *view.centre_px, *view.distortion), offsets, strict=True)
    ]
    return replace(
        view, focal_px=(values[0], values[1]), centre_px=(values[2], values[3]), distortion=tuple(values[4:])
    )


@dataclass(frozen=True, eq=False)
class Rig:
    """A sensor's views, in the order of the file.

    Attributes:
        views: the views.
        medium_deviation: standard deviations of the medium's numbers, by the fields of ``Medium``; absent: exact.
        deviations: what a calibration says instead, with lenses and poses.
        layout_digest: of the pad that was calibrated; "": the rig holds for any pad.

    Raises:
        RigError: no view, two of one name, or a deviation of a number that the medium does not have.
    """

    views: tuple[View, ...]
    medium_deviation: Mapping[str, float] = dataclasses.field(default_factory=dict)
    deviations: tuple[Deviation, ...] = ()
    layout_digest: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "views", tuple(self.views))
        names = [view.name for view in self.views]
        if not names:
            raise RigError("view is missing; expected at least one [[view]] table")
        for name in names:
            if names.count(name) > 1:
                raise RigError(
                    f"the view's name {name!r} is given {names.count(name)} times; give each view a different name"
                )
        deviations = {name: float(value) for name, value in self.medium_deviation.items() if value}
        for name, value in deviations.items():
            if not 0 < value < float("inf"):
                raise RigError(f"medium_deviation.{name} is {value:g}; expected a number from 0")
            if any(view.medium is None or not getattr(view.medium, name) for view in self.views):
                raise RigError(f"medium_deviation.{name} is given, but [medium] has no {name}; give it there")
        object.__setattr__(self, "medium_deviation", deviations)
        for index, one in enumerate(self.deviations):
            _check_deviation(one, self.views, f"deviation[{index}].")

    @property
    def independent_deviations(self) -> tuple[Deviation, ...]:
        """``deviations``, or else those of the medium's numbers, each alone."""
        if self.deviations:
            return self.deviations
        return tuple(
            Deviation(name, tuple(value if field == name else 0.0 for field in MEDIUM_FIELDS))
            for name, value in self.medium_deviation.items()
        )

    def require_layout(self, layout: Reference) -> None:
        """Check that the rig was calibrated with this pad, as it is made or as it was designed.

        Raises:
            RigError: the calibration is older than the pad.
        """
        own = {layout.digest} if layout.as_made is None else {layout.digest, layout.as_made.of}
        if self.layout_digest and self.layout_digest not in own:
            raise RigError(
                f"[calibration.rig] was made with the layout {self.layout_digest[:12]}, the layout here is "
                f"{layout.digest[:12]}; repeat cmpdesign calibrate rig with this pad"
            )

    def without_poses(self) -> Rig:
        """The same views without poses, which follow from a rest frame; ``mirrored`` is kept."""
        poseless = {"R_camera_from_layout": None, "t_camera_from_layout_mm": None}
        return replace(self, views=tuple(replace(view, **poseless) for view in self.views))  # type: ignore[arg-type]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the views."""
        return tuple(view.name for view in self.views)


def _check_deviation(one: Deviation, views: Sequence[View], prefix: str) -> None:
    counts = {
        "lens": [4 + len(view.distortion) for view in views],
        "pose": [6 for _ in views],
    }
    if len(one.medium) != len(MEDIUM_FIELDS):
        _raise_rig_error(prefix + "medium", f"{len(one.medium)} numbers", ", ".join(MEDIUM_FIELDS))
    for name, wanted in counts.items():
        found = [len(row) for row in getattr(one, name)]
        if found and found != wanted:
            _raise_rig_error(prefix + name, f"{found} numbers", f"a list for each view, of {wanted} numbers")


def load_rig(path: str | PathLike[str]) -> Rig:
    """Read and check a rig file, or the [[view]] tables of a scene file.

    Raises:
        RigError: one line that names the file, the field, the value and what is expected.
    """
    return parse_rig(read_text_file(path, MAX_BYTES, RigError), printable_path(path))


def parse_rig(text: str, name: str = "rig") -> Rig:
    """The rig in a TOML text; every error's message begins with ``name``.

    Raises:
        RigError: see ``load_rig``.
    """
    try:
        return _parse_document(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise RigError(f"{name}: not TOML: {error}") from None
    except RecursionError:
        raise RigError(
            f"{name}: nested too deeply; expected tables and lists at most a few levels deep"
        ) from None
    except RigError as error:
        raise RigError(f"{name}: {error}") from None
    except ValueError:  # the interpreter's limit on the digits of an integer
        raise RigError(f"{name}: holds a number of thousands of digits; expected at most 9 digits") from None


def _parse_document(document: Mapping[str, Any]) -> Rig:
    for field in document:
        if field not in (*READ_TABLES, *OTHER_TABLES):
            near = nearest_name(field, (*READ_TABLES, *OTHER_TABLES))
            _raise_rig_error(shown(field), f"unknown{near}", "[[view]] tables")
    tables = document.get("view")
    if not isinstance(tables, list) or not tables or not all(isinstance(t, dict) for t in tables):
        raise RigError("view is missing; expected at least one [[view]] table")
    if len(tables) > MAX_VIEWS:
        _raise_rig_error("view", f"a list of {len(tables)}", f"at most {MAX_VIEWS} [[view]] tables")
    medium = Medium(**_parse_medium_numbers(document["medium"], "medium")) if "medium" in document else None
    deviations = _parse_medium_numbers(document.get("medium_deviation", {}), "medium_deviation")
    views = tuple(_parse_view(table, index, medium) for index, table in enumerate(tables))
    return Rig(
        views, deviations, _parse_deviations(document.get("deviation", [])), _parse_layout_digest(document)
    )


def _parse_layout_digest(document: Mapping[str, Any]) -> str:
    table: object = document
    for name in ("calibration", "rig"):
        table = table.get(name) if isinstance(table, Mapping) else None
    digest = table.get("layout_digest", "") if isinstance(table, Mapping) else ""
    if not isinstance(digest, str) or not digest.isprintable():
        _raise_rig_error("calibration.rig.layout_digest", shown(digest), "the digest of a layout.json")
    return digest


def _parse_deviations(tables: object) -> tuple[Deviation, ...]:
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        _raise_rig_error("deviation", shown(tables), "[[deviation]] tables")
    if len(tables) > MAX_DEVIATIONS:
        _raise_rig_error("deviation", f"a list of {len(tables)}", f"at most {MAX_DEVIATIONS} tables")
    found = []
    for index, table in enumerate(tables):
        prefix = f"deviation[{index}]."
        _require_known_fields(table, prefix, DEVIATION_FIELDS)
        medium = _parse_row(table.get("medium", [0.0] * len(MEDIUM_FIELDS)), prefix + "medium")
        name = table.get("name", "")
        if not isinstance(name, str) or not name.isprintable():
            _raise_rig_error(prefix + "name", shown(name), "a printable text")
        rows = {field: _parse_rows(table.get(field, []), prefix + field) for field in ("lens", "pose")}
        found.append(Deviation(name, medium, **rows))
    return tuple(found)


def _parse_rows(value: object, field: str) -> tuple[tuple[float, ...], ...]:
    if not isinstance(value, list):
        _raise_rig_error(field, shown(value), "a list of numbers for each view")
    return tuple(_parse_row(row, f"{field}[{index}]") for index, row in enumerate(value))


def _parse_row(value: object, field: str) -> tuple[float, ...]:
    return _parse_numbers(value, field, len(value) if isinstance(value, list) else 0, False)


def _parse_medium_numbers(table: object, name: str) -> dict[str, float]:
    if not isinstance(table, dict):
        _raise_rig_error(name, shown(table), f"a table of {', '.join(MEDIUM_FIELDS)}")
    _require_known_fields(table, f"{name}.", MEDIUM_FIELDS)
    return {field: _parse_number(table[field], f"{name}.{field}", False) for field in table}


def _require_known_fields(table: Mapping[str, Any], prefix: str, known: tuple[str, ...]) -> None:
    for field in table:
        if field not in known:
            near = nearest_name(field, known)
            _raise_rig_error(prefix + shown(field), f"unknown{near}", f"only the fields {', '.join(known)}")


def _parse_view(table: Mapping[str, Any], index: int, medium: Medium | None) -> View:
    prefix = f"view[{index}]."
    _require_known_fields(table, prefix, KNOWN_FIELDS)
    for field in REQUIRED_FIELDS:
        if field not in table:
            _raise_rig_error(prefix + field, "missing", f"{NUMBER_COUNTS[field]} numbers")
    values: dict[str, Any] = {
        field: _parse_numbers(table[field], prefix + field, count, field == "area_px")
        for field, count in NUMBER_COUNTS.items()
        if field in table
    }
    if "window_normal" in table or "window_distance_mm" in table:
        for field in ("window_normal", "window_distance_mm"):
            if field not in table:
                _raise_rig_error(
                    prefix + field, "missing", "both of window_normal and window_distance_mm, or none"
                )
        distance_mm = _parse_number(table["window_distance_mm"], prefix + "window_distance_mm", False)
        values["window"] = WindowPlane(values.pop("window_normal"), distance_mm)
    values |= _parse_lens(table, prefix)
    name = table.get("name", f"view{index}")
    if not isinstance(name, str) or not name or not name.isprintable():
        _raise_rig_error(prefix + "name", shown(name), "a printable text")
    if "mirrored" in table:
        if not isinstance(table["mirrored"], bool):
            _raise_rig_error(prefix + "mirrored", shown(table["mirrored"]), "true or false")
        values["mirrored"] = table["mirrored"]
    if "R_camera_from_layout" in table:
        values["R_camera_from_layout"] = _parse_matrix(
            table["R_camera_from_layout"], prefix + "R_camera_from_layout"
        )
    return View(name=name, medium=medium, **values)


def _parse_lens(table: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    kind = table.get("lens", "perspective")
    if kind not in COUNTS:
        _raise_rig_error(prefix + "lens", shown(kind), " or ".join(f'"{name}"' for name in COUNTS))
    value, counts = table.get("distortion", [0.0] * COUNTS[kind][0]), COUNTS[kind]
    if not isinstance(value, list) or len(value) not in counts:
        _raise_rig_error(prefix + "distortion", shown(value), f"{counts_text(counts)} numbers")
    numbers = _parse_numbers(value, prefix + "distortion", len(value), False)
    return {"lens": kind, "distortion": numbers}


def _parse_matrix(value: object, field: str) -> list[tuple[float, ...]]:
    if not isinstance(value, list) or len(value) != 3:
        _raise_rig_error(field, shown(value), "3 rows of 3 numbers")
    return [_parse_numbers(row, f"{field}[{i}]", 3, False) for i, row in enumerate(value)]


def _parse_numbers(value: object, field: str, count: int, whole: bool) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        _raise_rig_error(field, shown(value), f"{count} numbers")
    return tuple(_parse_number(item, f"{field}[{i}]", whole) for i, item in enumerate(value))


def _parse_number(value: Any, field: str, whole: bool) -> float:
    kinds = (int,) if whole else (int, float)
    if type(value) not in kinds or not -MAX_NUMBER <= value <= MAX_NUMBER:
        kind = "a whole number" if whole else "a finite number"
        _raise_rig_error(field, shown(value), f"{kind} from {-MAX_NUMBER:g} to {MAX_NUMBER:g}")
    return value  # type: ignore[no-any-return]


def _raise_rig_error(field: str, value: str, expected: str) -> NoReturn:
    raise RigError(f"{field} is {value}; expected {expected}")
