"""A simulated sensor in one TOML file: views, patterns, elastomer, and the ranges of imaging conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from pydantic import ValidationError

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import path_exists, read_text
from cmpdesign.inputs.names import nearest_name
from cmpdesign.inputs.validation import validation_message
from cmpdesign.sensor.sensor_file import parse_sensor_file
from cmpdesign.sensor.tables import (
    METHODS,
    ContactTable,
    ElastomerTable,
    Pixels,
    Positive,
    SensorError,
    SensorResponse,
    SensorTable,
)

if TYPE_CHECKING:
    from cmpdesign.contact import Elastomer
    from cmpdesign.scene import Medium, Pinhole
    from extractor.space.rig import Rig


class SimulatedElastomer(ElastomerTable):
    """An elastic layer whose modulus is needed."""

    young_mpa: Positive


class SimulatedTable(SensorTable):
    """What a simulation needs of a sensor file."""

    size_px: tuple[Pixels, Pixels]
    elastomer: SimulatedElastomer
    contact: ContactTable


@dataclass(frozen=True, eq=False)
class SimulatedSensor:
    """The content of a sensor file.

    Attributes:
        table: the tables.
        rig: the views, with their poses.
        text: the file's text.
    """

    table: SimulatedTable
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
    sensor = parse_sensor_file(text, where)
    rig = sensor.rig
    try:
        table = SimulatedTable.model_validate(sensor.table.model_dump(exclude_unset=True))
    except ValidationError as error:
        raise SensorError(f"{where}: {validation_message(error, SimulatedTable)}") from None
    for view in rig.views:
        if not view.placed:
            raise SensorError(
                f"{where}: view {view.name!r} has no pose; give R_camera_from_layout and t_camera_from_layout_mm"
            )
    return SimulatedSensor(table, rig, text)
