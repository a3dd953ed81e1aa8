"""Progress: on a terminal only, on standard error, with rate and remaining time; none with --quiet or --json."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cmpdesign import build_layout, load, write_layout
from cmpdesign.cli import app
from cmpdesign.watch import told, watched

TERMINAL = {"FORCE_COLOR": "1", "TERM": "xterm", "COLUMNS": "150"}


def progress_of(folder: Path, *words: str, terminal: bool = True) -> str:
    """The text of a command on standard error, without the codes that move the cursor."""
    env = TERMINAL if terminal else {"FORCE_COLOR": None}
    result = CliRunner().invoke(app, [word.replace("DIR", str(folder)) for word in words], env=env)
    assert result.exit_code == 0, result.output
    assert "remaining" not in result.stdout
    return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", result.stderr)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("progress")
    write_layout(build_layout(load("honeycomb", {"layers": "3"})), folder / "layout.json")
    for number in range(3):
        (folder / "frames").mkdir(exist_ok=True)
        words = ["render", f"{folder}/layout.json", "-o", f"{folder}/frames/{number}.png"]
        assert CliRunner().invoke(app, [*words, "--seed", str(number)]).exit_code == 0
    return folder


COMMANDS = {
    "parts": ("build", "honeycomb", "--set", "layers=2", "--only", "laser", "-o", "DIR/out"),
    "pads": ("check", "honeycomb", "--set", "layers=3", "--read"),
    "pictures": ("verify", "DIR/layout.json", "DIR/frames"),
    "frames": ("track", "DIR/layout.json", "DIR/frames", "-o", "DIR/run.npz"),
}


@pytest.mark.parametrize("unit", COMMANDS)
def test_progress_has_number_rate_and_remaining_time(unit: str, folder: Path) -> None:
    shown = progress_of(folder, *COMMANDS[unit])
    assert re.search(rf"\d+/\d+ [\d.e+]+ {unit}/s \d+:\d\d:\d\d remaining \d+:\d\d:\d\d", shown), shown


@pytest.mark.parametrize("silent", [["--quiet"], ["--json"], None], ids=str)
def test_progress_is_silent(silent: list[str] | None, folder: Path) -> None:
    words = [*COMMANDS["pictures"], *(silent or [])]
    assert progress_of(folder, *words, terminal=silent is not None) == ""


def test_whoever_calls_may_watch() -> None:
    seen: list[tuple[int, int, str]] = []
    with watched(lambda *step: seen.append(step)):
        assert list(told("ab", 2, "letters")) == ["a", "b"]
    list(told("ab", 2, "letters"))
    assert seen == [(1, 2, "letters"), (2, 2, "letters")]
