"""--json, --quiet and --verbose: what each command prints with them, and where."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest

from cmpdesign import build_layout, load_design, write_layout
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
every_command = pytest.mark.parametrize("name", COMMANDS)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_layout(build_layout(load_design("honeycomb", {"layers": "3"})), tmp_path / "layout.json")
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
