"""The same design gives the same bytes in every format, in another process and with other hashes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from cmpdesign.cli import app

# The job sheet and the report are text; every other suffix is a writer's format.
SUFFIXES = {".svg", ".json", ".png", ".step", ".stl", ".glb", ".3mf", ".html", ".pdf", ".csv"}


def test_every_format_is_the_same_in_another_process(tmp_path: Path) -> None:
    arguments = ["build", "honeycomb", "--set", "layers=2", "--set", "mold.vents=3"]
    arguments += ["--only", "svg,layout,preview,mold,mesh,print,report", "-o"]
    code = "from cmpdesign.cli import main; main()"
    there = subprocess.Popen(
        [sys.executable, "-c", code, *arguments, str(tmp_path / "there")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONHASHSEED": "7"},
    )
    assert CliRunner().invoke(app, [*arguments, str(tmp_path / "here")]).exit_code == 0
    _, errors = there.communicate(timeout=300)
    assert there.returncode == 0, errors
    files = {name: all_files(tmp_path / name) for name in ("here", "there")}
    assert list(files["here"]) == list(files["there"])
    assert {Path(name).suffix for name in files["here"]} == SUFFIXES
    assert [name for name, data in files["here"].items() if data != files["there"][name]] == []


def all_files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
