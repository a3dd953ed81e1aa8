"""The application: its commands."""

from __future__ import annotations

import errno
import sys
from pathlib import Path
from typing import Annotated

import typer

from cmpdesign import __version__
from cmpdesign.cli.command import Command, OneLineErrors, examples, exit_interrupted
from cmpdesign.cli.commands import (
    build,
    check,
    evaluate,
    kerf,
    reconstruct,
    render,
    size,
    track,
    verify,
)
from cmpdesign.cli.commands.calibrate import group as calibrate
from cmpdesign.cli.commands.data import dataset, extract
from cmpdesign.cli.commands.export import group as export
from cmpdesign.cli.commands.pages import serve, studio, view
from cmpdesign.cli.commands.starting import cameras, init, schema, templates
from cmpdesign.cli.terminal import EXIT_BAD_INPUT, discard_output, print_document, print_error
from cmpdesign.errors import OutputError

app = typer.Typer(
    cls=OneLineErrors,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would remove text in brackets from a help text
    help="Design, make and read multicolor continuous marker patterns for vision-based tactile sensors.\n\n"
    "Exit codes: 0 done; 1 done, with a negative verdict or an early end; 2 bad input, or a file that cannot be "
    "written; 130 stopped by Ctrl-C.",
    epilog=examples("cmpdesign build tac3d -o mine", "cmpdesign verify --help"),
)
for module, function in (
    (templates, templates.templates),
    (init, init.init),
    (size, size.size),
    (studio, studio.studio),
    (view, view.view),
    (build, build.build),
    (check, check.check),
    (render, render.render),
    (verify, verify.verify),
    (cameras, cameras.cameras),
    (track, track.track),
    (reconstruct, reconstruct.reconstruct),
    (serve, serve.serve),
    (dataset, dataset.dataset),
    (extract, extract.extract),
    (kerf, kerf.kerf),
    (schema, schema.schema),
):
    app.command(function.__name__, cls=Command, epilog=examples(*module.EXAMPLES))(function)
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
        exit_interrupted()
    except OutputError as error:  # the version
        print_error(error)
        sys.exit(EXIT_BAD_INPUT)
    except OSError as error:  # help texts
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        discard_output()
        print_error(f"standard output: cannot be written ({error.strerror})")
        sys.exit(EXIT_BAD_INPUT)
