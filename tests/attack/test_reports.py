"""Reports of problems from strangers: ``tools.adopt_report`` writes checked content under its own names, or no file."""

from __future__ import annotations

import json
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmpdesign.files.images import to_png
from tests.attack.documents import wrong_documents
from tests.support.layouts import small_text
from tools import adopt_report
from tools.adopt_report import ReportError, adopt

PNG = to_png(np.full((32, 32, 3), 90, np.uint8))
SETTINGS = {"preset": "balanced", "response": None, "channels": "bgr", "min_share": 0.8}


def document(*files: str) -> dict[str, Any]:
    pictures = [{"file": file, "verdict": {}} for file in files]
    head = {"format": "cmp-problem-report", "version": 1, "settings": SETTINGS, "versions": {}}
    return {**head, "pictures": pictures}


def write_report(path: Path, told: Any, members: dict[str, bytes]) -> Path:
    text = told if isinstance(told, str | bytes) else json.dumps(told)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in {"report.json": text, "layout.json": small_text(), **members}.items():
            bundle.writestr(name, content)
    return path


def refused(report: Path, name: str | None = None) -> str:
    cases = report.parent / "cases"
    with pytest.raises(ReportError) as caught:
        adopt(report, name, cases)
    assert not cases.exists()
    return str(caught.value)


@pytest.mark.parametrize(
    "name", ["conftest.py", "test_x.py", "a.so", "../../a.png", "__init__.py", "x" * 280]
)
def test_a_foreign_name_is_no_name_of_a_file(tmp_path: Path, name: str) -> None:
    file = f"pictures/{name}"
    case = adopt(write_report(tmp_path / "r.zip", document(file), {file: PNG}), cases=tmp_path / "cases")
    assert sorted(path.name for path in case.iterdir()) == ["case.json", "layout.json", "picture-1.png"]
    assert (case / "picture-1.png").read_bytes() == PNG


@pytest.mark.parametrize("content", [b"import os\nos.abort()\n", b"", PNG[:40], b"\x89PNG\r\n\x1a\nprint()"])
def test_content_that_is_no_picture_is_not_written(tmp_path: Path, content: bytes) -> None:
    file = "pictures/conftest.py"
    assert "no picture that can be opened" in refused(
        write_report(tmp_path / "r.zip", document(file), {file: content})
    )


def test_edited_documents_are_one_line(tmp_path: Path) -> None:
    refusals = 0
    for number, text in enumerate(wrong_documents(document("pictures/a.png"))):
        report = write_report(tmp_path / f"r{number}.zip", text, {"pictures/a.png": PNG})
        try:
            adopt(report, cases=tmp_path / "cases")
        except ReportError as error:
            refusals += 1
            assert "\n" not in str(error)
    assert refusals > 0.9 * number


def test_an_edited_layout_is_one_line(tmp_path: Path) -> None:
    members = {"pictures/a.png": PNG, "layout.json": b'{"format": "cmp-layout"}'}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of zipfile, on two files of one name
        report = write_report(tmp_path / "r.zip", document("pictures/a.png"), members)
    assert "layout.json: version is missing" in refused(report)


@pytest.mark.parametrize("name", ["..", "a/b", ".git", "x" * 61, "", "a b", "conftest.py"])
def test_a_case_has_a_plain_name(tmp_path: Path, name: str) -> None:
    report = write_report(tmp_path / "r.zip", document("pictures/a.png"), {"pictures/a.png": PNG})
    assert "is no name of a folder" in refused(report, name)


@pytest.mark.parametrize("stated", [10, 3 << 20, 2**31])
def test_sizes_are_counted_and_not_believed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stated: int
) -> None:
    """Whatever size the directory of the bundle states: a member of 3 MiB is too large where the limit is 2 MiB."""
    monkeypatch.setattr(adopt_report, "MAX_BYTES", 2 << 20)
    report = write_report(tmp_path / "r.zip", document("pictures/a.png"), {"pictures/a.png": bytes(3 << 20)})
    data = bytearray(report.read_bytes())
    entry = data.rindex(b"pictures/a.png") - 46
    assert data[entry : entry + 4] == b"PK\1\2"
    data[entry + 24 : entry + 28] = struct.pack("<I", stated)
    report.write_bytes(data)
    assert ("unpacks to more than 2 MiB" in refused(report)) is (stated > 10)


def test_a_member_that_is_named_30_times_is_refused(tmp_path: Path) -> None:
    file = "pictures/a.png"
    assert "pictures = a list of 30" in refused(
        write_report(tmp_path / "r.zip", document(*[file] * 30), {file: PNG})
    )
    assert "named twice" in refused(write_report(tmp_path / "s.zip", document(*[file] * 3), {file: PNG}))


def _encrypted(data: bytearray) -> None:
    for start in (b"PK\1\2", b"PK\3\4"):
        flags = data.index(start) + (8 if start == b"PK\1\2" else 6)
        data[flags] |= 1


def _unknown_method(data: bytearray) -> None:
    for start in (b"PK\1\2", b"PK\3\4"):
        at = data.index(start) + (10 if start == b"PK\1\2" else 8)
        data[at] = 77


def _cut(data: bytearray) -> None:
    del data[len(data) // 2 :]


def _damaged(data: bytearray) -> None:
    for at in range(60, 120):
        data[at] ^= 0xFF


@pytest.mark.parametrize("damage", [_encrypted, _unknown_method, _cut, _damaged, bytearray.clear])
def test_a_damaged_bundle_is_one_line(tmp_path: Path, damage: Callable[[bytearray], None]) -> None:
    report = write_report(tmp_path / "r.zip", document("pictures/a.png"), {"pictures/a.png": PNG})
    data = bytearray(report.read_bytes())
    damage(data)
    report.write_bytes(data)
    assert "is no report of a problem" in refused(report)
