"""Makes a test of a report of a problem: ``python -m tools.adopt_report report.zip [--name NAME]``.

``cmpdesign verify --report report.zip`` writes the report. Its pictures, layout and settings become the folder NAME in
``tests/extractor/reported/cases``, where ``test_reported.py`` beside that folder finds them: every picture must be
verified. For a picture with another result, ``case.json`` states the result under "expected".
"""

from __future__ import annotations

import argparse
import json
import sys
import zipfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CASES = ROOT / "tests" / "extractor" / "reported" / "cases"
MOST_BYTES = 1 << 28  # 256 MiB: of a report's files together
FORMAT, VERSION = "cmp-problem-report", 1


class ReportError(Exception):
    """A file that is no report of a problem, or a name that is taken."""


def adopt(report: Path, name: str | None = None, cases: Path = CASES) -> Path:
    """Write a report's pictures, layout and settings as a case; the case's folder.

    Args:
        report: a file of ``cmpdesign verify --report``.
        name: of the case; by default that of the file.
        cases: the folder of all cases.

    Raises:
        ReportError: the file is no report, holds files that it does not name, or the case exists already.
    """
    folder = cases / (name or report.stem)
    if folder.parent != cases or folder.name.startswith("."):
        raise ReportError(f"--name {name}: is no name of a folder")
    if folder.exists():
        raise ReportError(f"{folder} exists already; give another --name")
    try:
        with zipfile.ZipFile(report) as bundle:
            if sum(info.file_size for info in bundle.infolist()) > MOST_BYTES:
                raise ReportError(f"{report}: unpacks to more than {MOST_BYTES >> 20} MiB")
            document = json.loads(bundle.read("report.json"))
            pictures = _named_pictures(document, report)
            contents = {Path(file).name: bundle.read(file) for file in pictures}
            contents["layout.json"] = bundle.read("layout.json")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise ReportError(f"{report} is no report of a problem ({error})") from None
    case = {
        "settings": document["settings"],
        "versions": document["versions"],
        "expected": {Path(file).name: {"verified": True} for file in pictures},
    }
    folder.mkdir(parents=True)
    for file, content in contents.items():
        (folder / file).write_bytes(content)
    text = json.dumps(case, indent=2, ensure_ascii=False) + "\n"
    (folder / "case.json").write_text(text, encoding="utf-8")
    return folder


def _named_pictures(document: Any, report: Path) -> list[str]:
    """The pictures' files as the report names them; each has a plain name in the folder "pictures"."""
    if document.get("format") != FORMAT or document.get("version") != VERSION:
        raise ReportError(f"{report}: format and version are not {FORMAT}, {VERSION}")
    files = [str(picture["file"]) for picture in document["pictures"]]
    for file in files:
        name = file.removeprefix("pictures/")
        if not name or name != Path(name).name or "\\" in name or name.startswith("."):
            raise ReportError(f"{report}: {file!r} is no name of a picture")
        if name in ("layout.json", "case.json"):
            raise ReportError(f"{report}: a picture is called {name}")
    return files


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("report", type=Path)
    parser.add_argument("--name", help="of the case; by default that of the file")
    words = parser.parse_args()
    try:
        folder = adopt(words.report, words.name)
    except ReportError as error:
        sys.exit(f"error: {error}")
    print(f"wrote {folder}; it is tested by: python -m pytest tests/extractor/reported -k {folder.name}")


if __name__ == "__main__":
    main()
