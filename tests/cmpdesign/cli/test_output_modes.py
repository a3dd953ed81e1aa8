"""--json, --quiet and --verbose: the output of each command on standard output and standard error."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from cmpdesign import build_layout, load, write_layout
from tests.support.command import refused, run

COMMANDS = {
    "templates": ("templates", "--kind", "scenes"),
    "init": ("init", "mine"),
    "build": ("build", "honeycomb", "--set", "layers=2", "--only", "layout", "-o", "out"),
    "check": ("check", "honeycomb", "--set", "layers=3"),
    "render": ("render", "layout.json", "-o", "image.png"),
    "verify": ("verify", "layout.json", "seen.png"),
    "track": ("track", "layout.json", "seen.png", "-o", "run.npz"),
}
ROOT = Path(__file__).parents[3]
every_command = pytest.mark.parametrize("name", COMMANDS)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_layout(build_layout(load("honeycomb", {"layers": "3"})), tmp_path / "layout.json")
    assert run("render", "layout.json", "-o", "seen.png").exit_code == 0


@every_command
def test_quiet_prints_nothing(name: str) -> None:
    result = run(*COMMANDS[name], "--quiet")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


@every_command
def test_verbose_prints_steps_with_their_times(name: str) -> None:
    result = run(*COMMANDS[name], "--verbose")
    steps = result.stderr.splitlines()
    assert result.exit_code == 0 and result.stdout
    assert all(re.fullmatch(r"step: .+ \(\d+ ms\)", step) for step in steps)
    assert steps[-1].startswith("step: done (")


@every_command
def test_json_and_verbose_print_one_document_and_messages(name: str) -> None:
    result = run(*COMMANDS[name], "--json", "--verbose")
    assert result.exit_code == 0
    jsonschema.validate(json.loads(result.stdout), json.loads(run("schema", name).stdout))
    messages = [json.loads(line) for line in result.stderr.splitlines()]
    schema = json.loads(run("schema", "message").stdout)
    for message in messages:
        jsonschema.validate(message, schema)
    assert [message["level"] for message in messages] == ["step"] * len(messages)
    assert messages[-1]["text"].startswith("done (")


def test_errors_are_printed_in_every_mode() -> None:
    words = ("verify", "layout.json", "none.toml")
    assert run(*words, "--quiet").stderr == run(*words).stderr
    origin = run("build", "none.toml", "--verbose").stderr
    assert origin.startswith("Traceback") and origin.endswith(refused("build", "none.toml") + "\n")
    (line,) = run("build", "none.toml", "--json").stderr.splitlines()
    assert json.loads(line)["level"] == "error" and json.loads(line)["exit_code"] == 2
    assert "exclude each other" in refused("templates", "--quiet", "--verbose")


def output_to(words: str, standard_output: str) -> tuple[int, str]:
    """Exit code and standard error of the program in a shell, which opens its standard output."""
    result = subprocess.run(
        f"{sys.executable} -m cmpdesign {words} {standard_output}",
        shell=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    return result.returncode, result.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no file that is always full")
@pytest.mark.parametrize("words", ["check honeycomb --set layers=2", "--version", "build --help"])
def test_output_that_cannot_be_written_is_one_line(words: str) -> None:
    expected = "error: standard output: cannot be written (No space left on device)\n"
    assert output_to(words, "> /dev/full") == (2, expected)


@pytest.mark.skipif(sys.platform == "win32", reason="a shell of another kind")
def test_closed_output_is_no_error() -> None:
    assert output_to("check honeycomb --set layers=2 --json", ">&-") == (0, "")
