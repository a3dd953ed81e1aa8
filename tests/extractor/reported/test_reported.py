"""Pictures that users reported, which must be read; ``python -m tools.adopt_report`` adds them."""

from __future__ import annotations

import json
import shutil
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cmpdesign.files.images import read_image
from cmpdesign.reading.verify import Verdict, verify
from extractor import Extractor, load_layout
from tests.support.command import refused, run
from tools.adopt_report import ReportError, adopt

CASES = sorted((Path(__file__).parent / "cases").iterdir())


def verdicts(case: Path) -> dict[str, Verdict]:
    """Picture -> the verdict, with the settings of the report."""
    told = json.loads((case / "case.json").read_text(encoding="utf-8"))
    settings, reference = told["settings"], load_layout(case / "layout.json")
    response: Any = settings["response"]
    if response not in (None, "srgb", "linear"):
        response = float(response)
    extractor = Extractor(reference, settings["preset"], response, "either")
    found = {}
    for name in told["expected"]:
        image = read_image(case / name)
        swapped = image[:, :, ::-1].copy() if settings["channels"] == "rgb" else image
        found[name] = verify(extractor, swapped, settings["min_share"])
    return found


def expected(case: Path) -> dict[str, bool]:
    told = json.loads((case / "case.json").read_text(encoding="utf-8"))["expected"]
    return {name: wanted["verified"] for name, wanted in told.items()}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_reported_picture_is_read(case: Path) -> None:
    found = verdicts(case)
    reasons = {name: verdict.reason for name, verdict in found.items()}
    assert {name: verdict.verified for name, verdict in found.items()} == expected(case), reasons


# -- the way from a report to a case


@pytest.fixture
def made(layout_file: Path, tmp_path: Path) -> Path:
    """A layout, a picture that is read, and one far out of focus that is not."""
    folder = tmp_path / "made"
    folder.mkdir()
    shutil.copy(layout_file, folder / "layout.json")
    options = ("--pitch", "40", "--size", "320x240", "--noise", "2")
    assert run("render", layout_file, "-o", folder / "good.png", *options).exit_code == 0
    image = read_image(folder / "good.png")
    cv2.imwrite(str(folder / "bad.jpg"), cv2.GaussianBlur(image, (0, 0), 20.0))  # half an edge
    (folder / "broken.png").write_bytes(b"no picture")
    return folder


def test_a_report_becomes_a_test_that_fails_until_the_picture_is_read(made: Path, tmp_path: Path) -> None:
    report = tmp_path / "first.zip"
    words = ("verify", made / "layout.json", made / "good.png", made / "bad.jpg", "--report", report)
    assert run(*words, "--min-share", "0.8").exit_code == 1
    first = report.read_bytes()
    case = adopt(report, cases=tmp_path / "cases")
    assert case == tmp_path / "cases" / "first"
    assert expected(case) == {"picture-1.png": True, "picture-2.jpeg": True}
    found = verdicts(case)
    assert found["picture-1.png"].verified and not found["picture-2.jpeg"].verified
    copies = {"picture-1.png": "good.png", "picture-2.jpeg": "bad.jpg", "layout.json": "layout.json"}
    for name, original in copies.items():
        assert (case / name).read_bytes() == (made / original).read_bytes()
    with zipfile.ZipFile(report) as bundle:
        told = json.loads(bundle.read("report.json"))
        stages = [name for name in bundle.namelist() if name.startswith("stages/bad/")]
        assert stages and all(bundle.read(name).startswith(b"\x89PNG") for name in stages)
    assert told["settings"] == {"preset": "balanced", "response": None, "channels": "bgr", "min_share": 0.8}
    assert [picture["verdict"]["verified"] for picture in told["pictures"]] == [True, False]
    assert told["versions"]["numpy"] == np.__version__ and str(tmp_path) not in json.dumps(told)
    assert run(*words, "--min-share", "0.8").exit_code == 1
    again = zipfile.ZipFile(report)
    assert again.namelist() == zipfile.ZipFile(BytesIO(first)).namelist()


def test_a_picture_that_cannot_be_opened_is_reported_too(made: Path, tmp_path: Path) -> None:
    report = tmp_path / "r.zip"
    assert run("verify", made / "layout.json", made / "broken.png", "--report", report).exit_code == 2
    with zipfile.ZipFile(report) as bundle:
        assert bundle.read("pictures/broken.png") == b"no picture"
    with pytest.raises(ReportError, match="no picture that can be opened"):
        adopt(report, cases=tmp_path / "cases")
    assert "unknown ending; expected .zip" in refused(
        "verify", made / "layout.json", made / "good.png", "--report", tmp_path / "report.json"
    )
