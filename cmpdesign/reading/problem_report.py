"""The bundle of a problem with pictures: all files that are needed to repeat the reading, in one ZIP file.

    report.json          format, version, settings, versions of the programs, pictures with their verdicts
    layout.json          the layout of the reading
    pictures/NAME        the pictures, as they were given
    stages/NAME/N-STAGE.png   the result of each stage of the extraction

``python -m tools.adopt_report report.zip`` makes a test of a bundle.
"""

from __future__ import annotations

import io
import json
import platform
import sys
import zipfile
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from cmpdesign import __version__
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.files.atomic import write_file
from cmpdesign.files.images import Image, to_png
from cmpdesign.inputs.names import Name
from cmpdesign.inputs.options import Preset
from cmpdesign.inputs.records import Record, parse_record
from cmpdesign.libraries import OPENCV_DISTRIBUTIONS

FORMAT, VERSION = "cmp-problem-report", 1
MAX_PICTURES = 20
_LIBRARIES = ("numpy", *OPENCV_DISTRIBUTIONS, "scipy")
_OLDEST_TIME = (1980, 1, 1, 0, 0, 0)  # the same bundle has the same bytes


class ReaderSettings(Record):
    """Options of the reading."""

    preset: Preset
    response: Name | float | None
    channels: Literal["bgr", "rgb"]
    min_share: float = Field(ge=0, le=1)


class ReportedPicture(Record):
    """A picture and its verdict; no program depends on the verdict."""

    file: Annotated[str, Field(pattern="^pictures/", max_length=300)]
    verdict: dict[str, Any]


class ReportDocument(Record):
    """report.json."""

    format: Literal["cmp-problem-report"]
    version: Literal[1]
    settings: ReaderSettings
    versions: dict[Name, Name] = Field(max_length=50)
    pictures: list[ReportedPicture] = Field(min_length=1, max_length=MAX_PICTURES)


def parse_report(text: str, name: str) -> ReportDocument:
    """The document of report.json; ``name`` is the prefix of messages.

    Raises:
        InputError: no JSON, or not of the schema.
    """
    return parse_record(text, name, ReportDocument)


class ProblemReport:
    """Collects pictures, and writes the bundle.

    Args:
        layout_text: text of the layout file.
        settings: options of the reading, as JSON values.
    """

    def __init__(self, layout_text: str, settings: Mapping[str, Any]) -> None:
        self._settings = dict(settings)
        self._files: dict[str, bytes] = {"layout.json": layout_text.encode("utf-8")}
        self._pictures: list[dict[str, Any]] = []

    def add(self, name: str, content: bytes, verdict: Mapping[str, Any], stages: Mapping[str, Image]) -> None:
        """Add a picture.

        Args:
            name: name of the picture's file, without a folder; different for each picture.
            content: content of the file.
            verdict: verdict on the picture, as JSON values.
            stages: name of a stage -> (H, W, 3) BGR picture of the stage's result.

        Raises:
            CmpDesignError: there are ``MAX_PICTURES`` pictures already.
        """
        if len(self._pictures) == MAX_PICTURES:
            raise CmpDesignError(
                f"a report of a problem holds at most {MAX_PICTURES} pictures; give those that show the problem, "
                f"or fewer {parameter('frames')}"
            )
        file = f"pictures/{name}"
        self._files[file] = content
        self._pictures.append({"file": file, "verdict": dict(verdict)})
        for number, (stage, picture) in enumerate(stages.items(), start=1):
            self._files[f"stages/{Path(name).stem}/{number}-{stage}.png"] = to_png(picture)

    def write(self, path: Path) -> None:
        """Write the bundle.

        Raises:
            CmpDesignError: no picture was added.
            OutputError: the file cannot be written.
        """
        if not self._pictures:
            raise CmpDesignError(f"{path}: no picture could be read, so there is no content for the report")
        document = {
            "format": FORMAT,
            "version": VERSION,
            "settings": self._settings,
            "versions": _versions(),
            "pictures": self._pictures,
        }
        text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as bundle:
            for name, content in {"report.json": text.encode("utf-8"), **self._files}.items():
                bundle.writestr(zipfile.ZipInfo(name, _OLDEST_TIME), content, zipfile.ZIP_DEFLATED)
        write_file(path, data.getvalue())


def _versions() -> dict[str, str]:
    """The versions of the programs that read the pictures, and the kind of machine."""
    found = {"cmpdesign": __version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return {**found, "system": sys.platform, "machine": platform.machine()}
