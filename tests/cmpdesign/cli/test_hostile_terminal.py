"""Foreign text is made printable before the terminal: names, paths, options and values with escape sequences."""

from __future__ import annotations

import csv
import json
import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cmpdesign.design.templates import templates_folder
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.texts import MAX_LINE_LETTERS, one_line, visible
from tests.support.command import run

ESCAPE = "\x1b]0;owned\x07\x1b[2J"
ODD = f"a{ESCAPE}\x9b31m\u202e\nb"


def clean(*arguments: object, code: int | None = None) -> str:
    """The printed text of the command: no control characters but line breaks, and no traceback."""
    result = run(*arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    printed = result.stdout + result.stderr
    assert all(letter.isprintable() for line in printed.split("\n") for letter in line), ascii(printed)
    for line in result.stderr.splitlines():
        if line.startswith(("error: ", "warning: ")):
            assert len(line) <= MAX_LINE_LETTERS + len("warning: ")
    if code is not None:
        assert result.exit_code == code, printed
    return printed


@given(st.text())
@settings(max_examples=200, deadline=None)
def test_any_text_becomes_visible(text: str) -> None:
    shown = visible(text)
    assert shown.isprintable() and (shown == text) == text.isprintable()
    line = one_line(CmpDesignError(text * 40))
    assert line.isprintable() and len(line) <= MAX_LINE_LETTERS


def test_a_long_line_keeps_its_remedy() -> None:
    line = one_line(CmpDesignError(f"out.toml: {'x' * 10_000} is too long; make it shorter"))
    assert line.startswith("out.toml: xxx") and line.endswith("; make it shorter")
    assert len(line) == MAX_LINE_LETTERS


@pytest.mark.parametrize(
    "arguments",
    [
        (ODD,),
        ("build", ODD),
        ("build", "honeycomb", f"--{ODD}"),
        ("build", "honeycomb", "--only", ODD),
        ("build", "honeycomb", "--set", ODD),
        ("build", "honeycomb", "--set", f"{ODD}=3"),
        ("build", "honeycomb", "--set", f"name={ODD}"),
        ("build", "honeycomb", "--set", f"pitch_mm={ODD}"),
        ("build", "honeycomb", "--set", "layers=" + "9" * 400),
        ("build", "honeycomb", "--set", f"pitch_mm={'9' * 5000}"),
        ("build", "honeycomb", "--set", "a." * 3000 + "a=1"),
        ("build", "honeycomb", "--set", f"x={'[' * 3000}"),
        ("build", "honeycomb", "--set", f"laser.machine={ODD}", "--only", "laser"),
        ("build", "honeycomb", "-o", f"{ODD}/\0"),
        ("check", "honeycomb", "--camera", ODD),
        ("render", ODD, "-o", f"{ODD}.png"),
        ("verify", ODD, ODD),
        ("track", ODD, ODD, "-o", f"{ODD}.npz"),
        ("reconstruct", ODD, ODD, ODD, ODD, "-o", f"{ODD}.npz"),
        ("kerf", ODD, ODD),
        ("evaluate", ODD),
        ("evaluate", "response", "-o", "x", "--sensor", ODD),
        ("evaluate", "response", "-o", "x", "--preset", ODD),
        ("evaluate", "designs", ODD, "-o", "x"),
    ],
)
def test_no_option_reaches_the_terminal(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    clean(*arguments, code=2)


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@SUM(1)"])
def test_foreign_text_in_a_table_is_no_formula(
    name: str, layout_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reason of an unreadable frame begins with its path."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / name
    folder.mkdir()
    (folder / "a.png").write_bytes(b"no image")
    # After "--", a path may begin with a hyphen.
    clean("track", "-o", "run.csv", "--", layout_file, name)
    with (tmp_path / "run.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows and all(row["reason"].startswith(f"'{name}/a.png: ") for row in rows)


def test_names_of_files_and_frames(layout_file: Path, tmp_path: Path) -> None:
    """Also one whose bytes are no UTF-8."""
    folder = tmp_path / f"frames{ESCAPE}"
    folder.mkdir()
    image = cv2.imencode(".png", np.full((64, 64, 3), 90, np.uint8))[1].tobytes()
    for name in (f"1{ESCAPE}.png", "2\n.png", os.fsdecode(b"3\xff.png")):
        (folder / name).write_bytes(image if name.startswith("2") else b"no image")
    images = sorted(folder.iterdir())
    assert "\\u001b]0;owned" in clean("verify", layout_file, *images, "-o", tmp_path / "report", code=2)
    assert json.loads(clean("verify", layout_file, images[1], "--json"))["verified"] is False
    assert json.loads((tmp_path / "report" / "verify.json").read_text(encoding="utf-8"))["images"]
    for kind in ("csv", "npz", "parquet"):
        clean("track", layout_file, folder, "-o", tmp_path / f"run{ESCAPE}.{kind}", code=1)


@pytest.mark.parametrize("kind", ["machines/co2-40w", "materials/pdms"])
def test_names_of_laser_jobs(kind: str, tmp_path: Path) -> None:
    """Letters that XML escapes are written so that readers find them again; control characters are refused."""
    text = (templates_folder() / f"{kind}.toml").read_text(encoding="utf-8")
    name = next(line for line in text.splitlines() if line.startswith("name = "))
    table = "machine" if "machine" in kind else "material"
    path = tmp_path / f"{Path(kind).name}.toml"
    other = ("--set", "laser.material=pdms") if table == "machine" else ("--set", "laser.machine=co2-40w")
    arguments = (
        "build",
        "tac3d",
        "--only",
        "laser",
        "-o",
        tmp_path / "made",
        "--set",
        f"laser.{table}={path}",
        *other,
    )
    path.write_text(text.replace(name, 'name = "a\\u0007b"'), encoding="utf-8")
    assert "control characters" in clean(*arguments, code=2)
    path.write_text(text.replace(name, "name = '''<a & \"b\"]]>é'''"), encoding="utf-8")
    clean(*arguments, code=0)
    for made in (tmp_path / "made").rglob("*"):
        if made.suffix in (".lbrn2", ".svg"):
            ElementTree.parse(made)
