"""The command line without pictures: templates, build, check, schema; and the messages for bad input."""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from cmpdesign import __version__
from cmpdesign.design.templates import scene_templates, templates
from cmpdesign.files.earlier_files import LIST_NAME
from extractor import load_layout
from tests.support.command import refused, run


def test_templates_are_listed() -> None:
    result = run("templates")
    assert result.exit_code == 0
    for name in templates():
        assert name in result.stdout


@pytest.mark.parametrize("name", templates())
def test_build_every_template(name: str, tmp_path: Path) -> None:
    result = run("build", name, "-o", tmp_path)
    # The extractor does not read the baseline.
    assert result.exit_code == (1 if name == "square" else 0), result.output
    written = {"pattern.svg", "layout.json", "preview.png", "report.json"}  # and the list of them
    assert {path.name for path in tmp_path.iterdir()} == {*written, LIST_NAME}
    assert all(file in result.stdout for file in written)
    reference = load_layout(tmp_path / "layout.json")
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["digest"] == reference.digest
    for figure in (report["present_markers"], report["virtual_markers"], sum(report["cells"].values())):
        assert str(figure) in result.stdout
    assert "{:.2f} x {:.2f} mm".format(*report["size_mm"]) in result.stdout


def test_build_again_writes_the_same_bytes(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        assert run("build", "tac3d", "-o", tmp_path / folder).exit_code == 0
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_build_only_and_set(tmp_path: Path) -> None:
    arguments = ("--set", "layers=3", "--set", "pitch_mm=60mil", "--set", "palette.red=#ff0000")
    result = run("build", "round", "-o", tmp_path, "--only", "layout, svg", *arguments)
    assert result.exit_code == 0, result.output
    assert {path.name for path in tmp_path.iterdir()} == {"pattern.svg", "layout.json", LIST_NAME}
    reference = load_layout(tmp_path / "layout.json")
    assert reference.layers == 3
    assert reference.parameters["pitch_mm"] == pytest.approx(1.524)
    assert reference.palette["red"] == "#ff0000"


def test_build_from_a_file_with_print_options(tmp_path: Path) -> None:
    design = tmp_path / "mine.toml"
    design.write_text('pattern = "honeycomb"\nlayers = 2\npitch_mm = "2mm"\nprint_ids = true\n')
    assert run("build", design, "-o", tmp_path / "made").exit_code == 0
    assert 'id="ids"' in (tmp_path / "made" / "pattern.svg").read_text(encoding="utf-8")


def test_build_warns(tmp_path: Path) -> None:
    result = run("build", "honeycomb", "-o", tmp_path, "--set", "pitch_mm=0.1", "--only", "layout")
    assert result.exit_code == 1
    assert (tmp_path / "layout.json").is_file()
    assert "warning: will not work: smallest cell" in result.stderr


def test_files_of_another_design_are_pointed_out(tmp_path: Path) -> None:
    assert (
        run("build", "honeycomb", "-o", tmp_path, "--set", "layers=2", "--only", "layout,print").exit_code
        == 0
    )
    again = run("build", "honeycomb", "-o", tmp_path, "--set", "layers=2", "--only", "layout")
    assert "another design" not in again.stderr
    drawn_on, made = tmp_path / "print" / "sheet.svg", tmp_path / "as-made" / "print.json"
    for path in (drawn_on, made):  # changed files are not removed
        path.write_text(path.read_text() + "\n")
    other = run("build", "honeycomb", "-o", tmp_path, "--set", "layers=3", "--only", "layout")
    assert other.exit_code == 0 and drawn_on.exists()
    assert f"{made} belongs to another design" in other.stderr
    assert "layout.json belongs" not in other.stderr


def test_a_clip_that_leaves_too_few_cells_is_an_error(tmp_path: Path) -> None:
    """Five colored cells are read; without those around the white cell nothing is."""
    flags = ["--set", "aspect=0.6", "--set", "clip=circle", "--set", "border_mm=0.3", "--set"]
    few = run("build", "elliptical", "-o", tmp_path, *flags, "clip_diameter_mm=4")
    assert few.exit_code == 2 and "cuts cells around the reference cell away" in few.stderr
    enough = run("build", "elliptical", "-o", tmp_path, *flags, "clip_diameter_mm=4.25")
    assert enough.exit_code == 0


def test_check() -> None:
    assert "no findings" in run("check", "tac3d").stdout
    result = run("check", "honeycomb", "--set", "pitch_mm=0.1")
    assert result.exit_code == 1
    assert "smallest cell" in result.stdout and "mm" in result.stdout
    assert run("check", "honeycomb", "--set", "pitch_mm=0.3").exit_code == 0
    assert "px" in run("check", "tac3d", "--camera", "160x120").stdout
    for same in ("160X120", " 160 x 120 ", "160×120"):
        assert (
            run("check", "tac3d", "--camera", same).stdout
            == run("check", "tac3d", "--camera", "160x120").stdout
        )


def test_schema_is_one() -> None:
    schema = json.loads(run("schema").stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate({"pattern": "round", "layers": 3, "pitch_mm": "60mil"}, schema)


def test_version_and_help() -> None:
    assert run("--version").stdout == f"cmpdesign {__version__}\n"
    assert run("--help").exit_code == 0
    for command in ("templates", "build", "check", "render", "verify", "schema"):
        assert command in run("--help").stdout
        assert run(command, "--help").exit_code == 0
    assert run("evaluate").stderr.strip() == run("evaluate", "--help").stdout.strip()
    shown = re.sub(r"\s+", " ", run("render", "--help").stdout)
    assert f"scene template: {', '.join(scene_templates())}." in shown


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("build", "honeycom"), "did you mean honeycomb?"),
        (("build", "none.toml"), "no such file"),
        (("build", "honeycomb", "--set", "pitch_mm=-1"), "pitch_mm"),
        (("build", "honeycomb", "--set", "pitch_mm=3 parsec"), "parsec"),
        (("build", "honeycomb", "--set", "layers=0"), "layers"),
        (("build", "honeycomb", "--set", "pich_mm=1"), "did you mean pitch_mm?"),
        (("build", "honeycomb", "--set", "layers"), "expected NAME=VALUE"),
        (("build", "honeycomb", "--only", "pdf"), "--only pdf: unknown; there are svg"),
        (("build", "honeycomb", "--only", ","), "names no file"),
        (("init", "."), "is a folder; give a design's name"),
        (("check", "honeycomb", "--camera", "640"), "expected WIDTHxHEIGHT"),
        (("render", "none.json", "-o", "image.png"), "none.json: cannot be read: No such file"),
        (("verify", "none.json", "image.png"), "none.json: cannot be read: No such file"),
    ],
)
def test_bad_input_is_one_line(
    arguments: tuple[str, ...], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert expected in refused(*arguments)
    assert list(tmp_path.iterdir()) == []


def test_bad_toml(tmp_path: Path) -> None:
    design = tmp_path / "design.toml"
    for content in (
        b"pattern = ",
        b"pattern = 3",
        b"\xff\xfe",
        b"",
        b'pattern = "honeycomb"\nlayers = "many"',
    ):
        design.write_bytes(content)
        assert str(design) in refused("build", design, "-o", tmp_path / "made")
    assert not (tmp_path / "made").exists()


def test_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here before")
    assert "cannot be written" in refused("build", "honeycomb", "-o", tmp_path / "file" / "made")
    assert "cannot be written" in refused("build", "honeycomb", "-o", tmp_path / "file")
    assert (tmp_path / "file").read_text() == "here before"


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_full_disk_changes_nothing(call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is full when the second file is synced, or when the first is renamed."""
    assert run("build", "honeycomb", "-o", tmp_path, "--set", "layers=2").exit_code == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    working, calls = getattr(os, call), iter([call == "fsync", False, False, False])

    def full(*arguments: Any, **options: Any) -> None:
        if not next(calls):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        working(*arguments, **options)

    monkeypatch.setattr(os, call, full)
    message = refused("build", "honeycomb", "-o", tmp_path, "--set", "layers=3")
    assert "No space left on device" in message
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def process(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The result of a whole process."""
    command = [sys.executable, "-c", "from cmpdesign.cli import main; main()", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_no_traceback_from_a_real_process(tmp_path: Path) -> None:
    result = process("verify", str(tmp_path / "none.json"), "image.png")
    assert result.returncode == 2
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
