"""Makes a test of a report of a problem: ``python -m tools.adopt_report report.zip [--name NAME]``.

``cmpdesign verify --report report.zip`` writes the report. Its pictures, layout and settings become the folder NAME in
``tests/extractor/reported/cases``, where ``test_reported.py`` beside that folder finds them: every picture must be
verified. For a picture with another result, ``case.json`` states the result under "expected".

A report comes from somebody else. Only checked content is written, under names that this program makes: pictures as
``picture-1.png`` and so on, with the ending of their content.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from cmpdesign.errors import CmpDesignError
from cmpdesign.files.atomic import write_folder
from cmpdesign.files.image_header import open_header
from cmpdesign.files.images import ImageFileError, decode_bytes
from cmpdesign.inputs.files import MAX_TEXT_BYTES, open_file, require_size
from cmpdesign.inputs.texts import one_line, visible
from cmpdesign.reading.problem_report import ReportDocument, parse_report
from extractor import ExtractorError, parse_layout

ROOT = Path(__file__).resolve().parents[1]
CASES = ROOT / "tests" / "extractor" / "reported" / "cases"
MAX_BYTES = 1 << 28  # 256 MiB: of a report, and of its files together
MAX_MEMBERS = 1000
NAME = re.compile("[A-Za-z0-9][A-Za-z0-9_-]{0,59}")
# What zipfile raises on a damaged, encrypted or unknown member.
ZIP_ERRORS = (OSError, EOFError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error)


class ReportError(Exception):
    """A file that is no report of a problem, or a name that is taken."""


def adopt(report: Path, name: str | None = None, cases: Path = CASES) -> Path:
    """Write a report's pictures, layout and settings as a case; the case's folder.

    Args:
        report: a file of ``cmpdesign verify --report``.
        name: of the case; by default that of the file.
        cases: the folder of all cases.

    Raises:
        ReportError: the file is no report, holds no picture that can be opened, or the case exists already.
    """
    name = report.stem if name is None else name
    if not NAME.fullmatch(name):
        raise ReportError(f"--name {name}: is no name of a folder; give up to 60 letters, digits, - and _")
    folder = cases / name
    if folder.exists():
        raise ReportError(f"{folder} exists already; give another --name")
    try:
        with open_file(report) as file:
            require_size(file, report, MAX_BYTES)
            with zipfile.ZipFile(file) as bundle:
                contents = _checked_contents(_Members(bundle))
        write_folder(folder, contents)
    except (*ZIP_ERRORS, CmpDesignError, ExtractorError, ReportError) as error:
        raise ReportError(f"{report} is no report of a problem ({error})") from None
    return folder


class _Members:
    """The files of a bundle, read up to a common limit of bytes: the sizes that the bundle states are not believed."""

    def __init__(self, bundle: zipfile.ZipFile) -> None:
        self._bundle, self._left = bundle, MAX_BYTES
        names = bundle.namelist()
        if len(names) > MAX_MEMBERS or len(set(names)) < len(names):
            raise ReportError(f"holds more than {MAX_MEMBERS} files, or two files of one name")

    def read(self, name: str, most_bytes: int = 1 << 62) -> bytes:
        """The content of a file; raises ``ReportError`` without such a file, or beyond a limit."""
        if name not in self._bundle.namelist():
            raise ReportError(f"holds no file {name}")
        most = min(self._left, most_bytes)
        with self._bundle.open(name) as file:
            data = file.read(most + 1)
        if len(data) > most:
            raise ReportError(f"{name} unpacks to more than {min(MAX_BYTES, most_bytes) >> 20} MiB")
        self._left -= len(data)
        return data


def _checked_contents(members: _Members) -> dict[str, bytes]:
    """The files of the case by their new names."""
    report = parse_report(members.read("report.json", MAX_TEXT_BYTES).decode("utf-8"), "report.json")
    layout = members.read("layout.json")
    parse_layout(layout.decode("utf-8"), "layout.json")
    pictures = dict(_new_pictures(members, report))
    if not pictures:
        raise ReportError("it holds no picture that can be opened, so there is no content for a test")
    case = {
        "settings": report.settings.model_dump(),
        "versions": report.versions,
        "expected": {name: {"verified": True} for name in pictures},
    }
    text = json.dumps(case, indent=2, ensure_ascii=False) + "\n"
    return {**pictures, "layout.json": layout, "case.json": text.encode()}


def _new_pictures(members: _Members, report: ReportDocument) -> Iterator[tuple[str, bytes]]:
    """(new name, content) of the pictures that can be opened."""
    files = [picture.file for picture in report.pictures]
    if len(set(files)) < len(files):
        raise ReportError("a picture is named twice")
    for number, picture in enumerate(report.pictures, start=1):
        content = members.read(picture.file)
        header = open_header(content)
        try:
            decode_bytes(content, picture.file)
        except ImageFileError:
            continue
        ending = (header.format or "tiff").lower() if header is not None else "tiff"
        yield f"picture-{number}.{ending}", content


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("report", type=Path)
    parser.add_argument("--name", help="of the case; by default that of the file")
    words = parser.parse_args()
    try:
        folder = adopt(words.report, words.name)
    except ReportError as error:
        sys.exit(f"error: {one_line(error)}")
    print(
        f"wrote {visible(str(folder))}; it is tested by: python -m pytest tests/extractor/reported -k {folder.name}"
    )


if __name__ == "__main__":
    main()
