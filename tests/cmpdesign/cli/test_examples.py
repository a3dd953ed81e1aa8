"""The end of every help text: two examples, which are run unchanged in a folder with the files that they name."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.support.command import commands, run
from tests.support.made.example_files import prepare_files

GROUPS = {"evaluate", "calibrate", "export"}
SLOW = {"evaluate"}
SERVERS = {"serve", "studio", "view"}  # run until Ctrl-C; tests/cmpdesign/studio and runtime run them


def examples(*words: str) -> list[str]:
    """The lines below "Examples:" in a help text, without the prompt."""
    shown = run(*words, "-h").stdout
    head, below = shown.rsplit("\nExamples:\n", 1)
    assert "Options:" in head
    return [line.removeprefix("  $ ") for line in below.rstrip().splitlines()]


def every_example() -> list[Any]:
    found = []
    for name, _ in commands():
        for line in () if SERVERS & set(name) else examples(*name):
            marks = [pytest.mark.slow] if SLOW & set(name) else []
            found.append(pytest.param(line, marks=marks, id=line))
    return found


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder with the files of a command."""
    return cache(lambda command: prepare_files(tmp_path_factory.mktemp("prepared") / "files", command))


def test_every_command_has_two_examples() -> None:
    groups = sorted({name[:-1] for name, _ in commands()})
    assert [" ".join(name) for name in groups] == ["", *sorted(GROUPS)]
    for name in [*groups, *(name for name, _ in commands())]:
        lines = examples(*name)
        assert len(lines) == 2 and lines[0] != lines[1], name
        assert all(line.startswith(" ".join(("cmpdesign", *name))) for line in lines)
        assert all(len(line) <= 110 for line in lines)
    run_by_commands = {line for name, _ in commands() for line in examples(*name)}
    assert {line for name in groups if name for line in examples(*name)} <= run_by_commands


@pytest.mark.parametrize("line", every_example())
def test_an_example_runs(
    line: str, prepared: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each example is run unchanged. One example of each command also prints the document of its schema with
    ``--json``.
    """
    program, *words = shlex.split(line)
    command = " ".join(words[:2]) if words[0] in GROUPS else words[0]
    others = examples(*command.split())
    if command != "schema" and line == others[0] and not any("--json" in other for other in others):
        check_run(prepared(words[0]), tmp_path / "json", [*words, "--json"], monkeypatch)
    folder = check_run(prepared(words[0]), tmp_path / "work", words, monkeypatch)
    outputs = re.findall(r"(?:-o|--overlay|--truth) (\S+)", line)
    assert program == "cmpdesign" and all((folder / name).exists() for name in outputs)


def check_run(prepared: Path, folder: Path, words: list[str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """Run the words in a copy of the prepared files: without an error, and no file that was there changes."""
    shutil.copytree(prepared, folder)
    monkeypatch.chdir(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    result = run(*words)
    assert result.exit_code == 0, result.output + repr(result.exception)
    assert all(path.read_bytes() == content for path, content in before.items())
    if "--json" in words:
        assert result.stderr == ""
        check_document(" ".join(words[:2]) if words[0] in GROUPS else words[0], result.stdout)
    return folder


def check_document(command: str, text: str) -> None:
    """There is one document on standard output, and the schema that the program prints describes it."""
    document = json.loads(text)
    jsonschema.validate(document, json.loads(run("schema", *command.split()).stdout))
    assert document["format"].startswith("cmp-") and document["version"] >= 1
