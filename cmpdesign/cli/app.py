"""The application: its commands, and the conversion of errors into a line and an exit code."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from cmpdesign import __version__
from cmpdesign.cli.commands import (
    build,
    check,
    evaluate,
    kerf,
    reconstruct,
    render,
    schema,
    templates,
    track,
    verify,
)
from cmpdesign.cli.terminal import EXIT_BAD_INPUT, is_expected, print_error


class OneLineErrors(TyperGroup):
    """Prints expected errors as one line on stderr, with exit code 2 and without a traceback."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except Exception as error:
            if not is_expected(error):
                raise
            print_error(error)
            raise typer.Exit(EXIT_BAD_INPUT) from None


app = typer.Typer(
    cls=OneLineErrors,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Design, make and read multicolor continuous marker patterns for vision-based tactile sensors.",
)
app.command("templates")(templates.templates)
app.command("build")(build.build)
app.command("check")(check.check)
app.command("render")(render.render)
app.command("verify")(verify.verify)
app.command("track")(track.track)
app.command("reconstruct")(reconstruct.reconstruct)
app.add_typer(evaluate.app, name="evaluate")
app.command("kerf")(kerf.kerf)
app.command("schema")(schema.schema)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"cmpdesign {__version__}")
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
    app()
