"""The ``cmpdesign`` program, run within the tests' process, and its commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from typer.main import get_command
from typer.testing import CliRunner, Result

from cmpdesign.cli import app


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(*arguments: object) -> str:
    """The one line that the command ends with."""
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), result.stderr
    return lines[0]


def commands(group: Any = None, names: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """(the words that call it, the command), for every command of the program."""
    for name, command in (group or get_command(app)).commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*names, name))
        else:
            yield (*names, name), command


def words_for(command: Any, chosen: Any = None, value: str = "-") -> list[str]:
    """Words for all required parameters, and for a chosen one its value."""
    words = []
    for parameter in command.params:
        if parameter is not chosen and not parameter.required:
            continue
        text = value if parameter is chosen else "x"
        words += [parameter.opts[-1], text] if parameter.param_type_name == "option" else [text]
    return words
