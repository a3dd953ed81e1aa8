"""The common behaviour of all commands: help texts, refused paths, Ctrl-C, missing libraries."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any, get_type_hints

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from cmpdesign.cli import app
from tests.support.command import commands, run, words_for

ROOT = Path(__file__).parents[3]
COMMANDS = dict(commands())
PROGRAM = "from cmpdesign.cli import main; main()"
every_command = pytest.mark.parametrize("name", COMMANDS, ids=" ".join)


def without_spaces(text: str) -> str:
    return re.sub(r"\s+", "", text)


# -- help


@every_command
def test_help_shows_every_word_and_every_default(name: tuple[str, ...]) -> None:
    shown = without_spaces(run(*name, "--help").stdout)
    assert without_spaces(COMMANDS[name].help) in shown
    assert "list[" not in shown
    for parameter in COMMANDS[name].params:
        assert without_spaces(parameter.help or "") in shown, parameter.name
        default = parameter.default
        if default is not None and not isinstance(default, bool) and parameter.show_default:
            # Options choose the type of their default, as in 20 for 20.0.
            assert re.search(rf"\[default:{re.escape(str(default))}[];]", shown), parameter.name


def test_help_of_groups_shows_every_command() -> None:
    for words in [(), *{name[:-1] for name in COMMANDS}]:
        listed = re.findall(r"^  (\w+)  ", run(*words, "--help").stdout, re.MULTILINE)
        below = {name[len(words)] for name in COMMANDS if name[: len(words)] == words}
        assert sorted(listed) == sorted(below)


# -- paths


@every_command
def test_a_dash_is_no_file(name: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    types = get_type_hints(COMMANDS[name].callback)
    paths = [p for p in COMMANDS[name].params if "Path" in str(types.get(p.name))]
    for parameter in paths:
        result = run(*name, *words_for(COMMANDS[name], parameter))
        assert result.exit_code == 2 and "standard input and output are not supported" in result.stderr
        assert len(result.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
    assert paths or name in {("templates",), ("schema",), ("check",), ("cameras",), ("studio",)}


# -- Ctrl-C


@every_command
def test_ctrl_c_is_one_line(name: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever it comes in the command's own code."""

    def interrupt(**_: Any) -> None:
        raise KeyboardInterrupt

    program: Any = get_command(app)
    group = program
    for word in name[:-1]:
        group = group.commands[word]
    monkeypatch.setattr(group.commands[name[-1]], "callback", interrupt)
    monkeypatch.setattr("typer.testing._get_command", lambda _: program)
    result = CliRunner().invoke(app, [*name, *words_for(COMMANDS[name])])
    assert result.exit_code == 130 and result.stdout == ""
    assert re.fullmatch(r"error: interrupted; .*\n", result.stderr)


IMPORTING = """
import builtins, sys
from cmpdesign.__main__ import main
left, usual = int(sys.argv.pop(1)), builtins.__import__
def importing(*words, **options):
    global left
    left -= 1
    if left == 0:
        raise KeyboardInterrupt
    return usual(*words, **options)
builtins.__import__ = importing
main()
"""


@pytest.mark.parametrize("imports", [1, 40, 400])
def test_ctrl_c_while_the_program_loads_is_one_line(imports: int) -> None:
    command = [sys.executable, "-c", IMPORTING, str(imports), "templates"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stdout) == (130, "")
    assert re.fullmatch(r"error: interrupted; .*\n", done.stderr)


def interrupted(folder: Path, *words: object, wait_s: float) -> tuple[int, str, float]:
    """Exit code, standard error and time to the end of a program that gets Ctrl-C as from a terminal."""
    command = [sys.executable, "-c", PROGRAM, *map(str, words)]
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        # where the tests run in the background, SIGINT is ignored, and children inherit that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    try:
        time.sleep(wait_s)
        assert process.poll() is None, "the program ended too early for this test"
        started = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        took_s = time.monotonic() - started
        assert is_gone(process.pid)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    return process.returncode, errors, took_s


def is_gone(group: int, within_s: float = 5) -> bool:
    """Whether no process of a group is left after some time."""
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


LONG = {
    "solids": ("build", "honeycomb", "--set", "layers=60", "--only", "mold", "-o", "out"),
    "meshes": ("build", "honeycomb", "--set", "layers=60", "--only", "mesh", "-o", "out"),
    "trials": ("evaluate", "precision", "-o", "out", "--workers", "2"),
    "one worker": ("evaluate", "reliability", "-o", "out", "--workers", "1"),
}


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=() if k in ("solids", "trials") else pytest.mark.slow) for k in LONG]
)
def test_long_work_ends_within_five_seconds(kind: str, tmp_path: Path) -> None:
    """Calls into the CAD kernel of more than five seconds, and trials in several processes."""
    code, errors, took_s = interrupted(tmp_path, *LONG[kind], wait_s=6)
    assert code == 130 and took_s < 5, (code, took_s, errors)
    lines = errors.splitlines()
    assert len(lines) == 1 and "interrupted" in lines[0]
    left = [path.name for path in tmp_path.rglob("*") if path.is_file()]
    assert left in ([], ["journal.jsonl"])


# -- libraries

MISSING = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == LIBRARY:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
"""
# Without these nothing runs at all.
BASE = {"numpy", "opencv-contrib-python-headless", "pydantic", "typer", "rich"}
SMALL = ("build", "honeycomb", "--set", "layers=1", "-o", "out", "--only")
LIBRARIES = {
    "svgwrite": ("svgwrite", (*SMALL, "svg")),
    "shapely": ("shapely", (*SMALL, "laser")),
    "ezdxf": ("ezdxf", (*SMALL, "laser")),
    "scipy": ("scipy", ("size", "--camera", "640x480", "--view", "20x15mm")),
    "threadpoolctl": ("threadpoolctl", ("evaluate", "precision", "--trials", "1", "-o", "out")),
    "cadquery-ocp-novtk": ("OCP", (*SMALL, "mold")),
    "lib3mf": ("lib3mf", (*SMALL, "mesh")),
    "trimesh": ("trimesh", (*SMALL, "mesh")),
    "segno": ("segno", (*SMALL, "print")),
    "reportlab": ("reportlab", (*SMALL, "print")),
    "pillow": ("PIL", ("verify", "layout.json", "sheet.png")),
    "pyarrow": ("pyarrow", ("track", "layout.json", ".", "-o", "a.parquet")),
}


def test_every_library_is_tried() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [line for name in ("laser", "cad", "print") for line in project["optional-dependencies"][name]]
    names = {re.split(r"[<>=~ ]", line)[0] for line in [*project["dependencies"], *extras]}
    assert names - BASE - {"build123d"} <= LIBRARIES.keys()  # build123d is for programs only


@pytest.mark.parametrize("distribution", LIBRARIES)
def test_a_missing_library_is_one_line(distribution: str, tmp_path: Path) -> None:
    library, words = LIBRARIES[distribution]
    if words[0] != "build":
        assert (
            run("build", "honeycomb", "--set", "layers=2", "--only", "layout,print", "-o", tmp_path).exit_code
            == 0
        )
        page = tmp_path / "sheet.png"
        page.write_bytes(sheet_png(tmp_path))
    # A module of this name is found first by all processes, those that work with the CAD kernel included.
    (tmp_path / "missing").mkdir()
    (tmp_path / "missing" / "sitecustomize.py").write_text(f"LIBRARY = {library!r}\n{MISSING}")
    before = sorted(tmp_path.rglob("*"))
    path = os.pathsep.join([str(tmp_path / "missing"), str(ROOT)])
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 2, result.stderr
    assert re.fullmatch(r"error: this needs .* not installed; .*pip install .*\n", result.stderr), (
        result.stderr
    )
    assert library in result.stderr and result.stdout == ""
    assert sorted(tmp_path.rglob("*")) == before


def sheet_png(folder: Path) -> bytes:
    """The printed page as a picture that shows the sheet's code."""
    import cv2
    import pypdfium2

    page = pypdfium2.PdfDocument(next((folder / "print").glob("*.pdf")))[0]
    return bytes(cv2.imencode(".png", page.render(scale=200 / 72).to_numpy()[..., :3])[1])
