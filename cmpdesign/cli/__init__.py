"""The command line: parses, calls and prints. One file per command; heavy modules are imported when a command runs.

In: the words of a command line. Out: files, lines, an exit code.
"""

from __future__ import annotations

import errno
import sys
from pathlib import Path
from typing import Annotated

import typer

from cmpdesign import __version__
from cmpdesign.cli.command import INTERRUPTED, app
from cmpdesign.cli.commands import calibrate, datasets, evaluate, making, pages, reading
from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    discard_output,
    print_document,
    print_error,
)
from cmpdesign.errors import OutputError

__all__ = ["app", "main"]
UNGROUPED = (making, pages, reading)  # have added their commands to ``app``
app.add_typer(evaluate.app, name="evaluate")
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(datasets.export, name="export")


def _print_version(wanted: bool) -> None:
    if wanted:
        print_document(f"cmpdesign {__version__}\n")
        raise typer.Exit()


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    load: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Python file that registers patterns; run before the command."),
    ] = None,
) -> None:
    """Options that belong to no command."""
    if load is not None:
        from cmpdesign.patterns import load_patterns

        load_patterns(str(load))


def main() -> None:
    """Entry point of the ``cmpdesign`` program."""
    try:
        app()
    except KeyboardInterrupt:  # before or after a command
        print_error(INTERRUPTED, EXIT_INTERRUPTED)
        sys.exit(EXIT_INTERRUPTED)
    except OutputError as error:  # the version
        print_error(error)
        sys.exit(EXIT_BAD_INPUT)
    except OSError as error:  # help texts
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        discard_output()
        print_error(f"standard output: cannot be written ({error.strerror})")
        sys.exit(EXIT_BAD_INPUT)
