"""A sensor file read and checked; a rig file without other tables is a sensor file, too."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from cmpdesign.errors import InputError
from cmpdesign.inputs.documents import parse_toml
from cmpdesign.inputs.files import path_exists, read_text
from cmpdesign.inputs.validation import validation_message
from cmpdesign.sensor.tables import SensorError, SensorTable
from extractor import Reference, Rig, parse_rig
from extractor.errors import ExtractorError, RigError
from extractor.space.rig import READ_TABLES


@dataclass(frozen=True, eq=False)
class SensorFile:
    """The content of a sensor file.

    Attributes:
        table: all tables but the rig's.
        rig: the views, the medium and their deviations.
        text: the file's text.
        path: the file; other files are named relative to its folder.
    """

    table: SensorTable
    rig: Rig
    text: str
    path: Path

    @property
    def layout(self) -> Path:
        """The layout file of the sensor's pad.

        Raises:
            SensorError: the file names none, or there is none of this name.
        """
        if self.table.layout is None:
            raise SensorError(f'{self.path}: layout is missing; name the pad\'s file: layout = "layout.json"')
        return self._named("layout", self.table.layout)

    @property
    def gel(self) -> Path | None:
        """The file of ``calibrate gel``; None: none is named.

        Raises:
            SensorError: there is no file of this name.
        """
        elastomer = self.table.elastomer
        return (
            None
            if elastomer is None or elastomer.gel is None
            else self._named("elastomer.gel", elastomer.gel)
        )

    def require_layout(self, layout: Reference) -> None:
        """Check that the rig was calibrated with the pad of this layout.

        Raises:
            SensorError: the calibration is older than the pad.
        """
        try:
            self.rig.require_layout(layout)
        except RigError as error:
            raise SensorError(f"{self.path}: {error}") from None

    def _named(self, field: str, name: str) -> Path:
        path = self.path.parent / name
        if not path_exists(path):
            raise SensorError(
                f"{self.path}: {field} is {name!r}; there is no {path}; names are relative to this file"
            )
        return path


def load_sensor_file(path: str | Path) -> SensorFile:
    """Read a sensor file.

    Raises:
        SensorError: the file cannot be read, or a value cannot be used; the message names the value on one line.
    """
    try:
        text = read_text(Path(path))
    except InputError as error:
        raise SensorError(str(error)) from None
    return parse_sensor_file(text, str(path))


def parse_sensor_file(text: str, where: str = "sensor") -> SensorFile:
    """The sensor in a TOML text; ``where`` is the file, and the prefix of every error's message.

    Raises:
        SensorError: see ``load_sensor_file``.
    """
    try:
        document = parse_toml(text, where)
        rig = parse_rig(text, where)
        table = SensorTable.model_validate(
            {name: value for name, value in document.items() if name not in READ_TABLES}
        )
    except (InputError, ExtractorError) as error:
        raise SensorError(str(error)) from None
    except ValidationError as error:
        raise SensorError(f"{where}: {validation_message(error, SensorTable)}") from None
    _require_areas(table, rig, where)
    return SensorFile(table, rig, text, Path(where))


def _require_areas(table: SensorTable, rig: Rig, where: str) -> None:
    if table.size_px is None:
        return
    for view in rig.views:
        x, y, width, height = view.area_px or (0, 0, 0, 0)
        if x + width > table.size_px[0] or y + height > table.size_px[1]:
            raise SensorError(
                f"{where}: view {view.name!r}: area_px {[x, y, width, height]} reaches beyond size_px "
                f"{list(table.size_px)}"
            )
