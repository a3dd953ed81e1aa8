"""The application: its commands."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from cmpdesign import __version__
from cmpdesign.cli.command import INTERRUPTED, Command, OneLineErrors
from cmpdesign.cli.commands import (
    build,
    check,
    evaluate,
    kerf,
    reconstruct,
    render,
    size,
    templates,
    track,
    verify,
)
from cmpdesign.cli.commands.calibrate import group as calibrate
from cmpdesign.cli.commands.export import group as export
from cmpdesign.cli.commands.starting import schema
from cmpdesign.cli.terminal import EXIT_INTERRUPTED, print_document, print_error

app = typer.Typer(
    cls=OneLineErrors,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would swallow what stands in brackets in a help text
    help="Design, make and read multicolor continuous marker patterns for vision-based tactile sensors.",
)
for function in (
    templates.templates,
    size.size,
    build.build,
    check.check,
    render.render,
    verify.verify,
    track.track,
    reconstruct.reconstruct,
    kerf.kerf,
    schema.schema,
):
    app.command(function.__name__, cls=Command)(function)
app.add_typer(evaluate.app, name="evaluate")
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(export.app, name="export")


def _print_version(wanted: bool) -> None:
    if wanted:
        print_document(f"cmpdesign {__version__}\n")
        raise typer.Exit()


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options that belong to no command."""


def main() -> None:
    """Entry point of the ``cmpdesign`` program."""
    try:
        app()
    except KeyboardInterrupt:  # before or after a command
        print_error(INTERRUPTED)
        sys.exit(EXIT_INTERRUPTED)
