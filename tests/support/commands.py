"""Every command of the program, with its parameters, and words that it can be called with."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from typer.main import get_command

from cmpdesign.cli import app


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
