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
from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    is_expected,
    print_document,
    print_error,
    shortened,
)
from cmpdesign.inputs.texts import visible


class OneLineErrors(TyperGroup):
    """Prints expected errors as one line on stderr, with exit code 2 and without a traceback."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        try:
            return super().make_context(*arguments, **options)
        except Exception as error:
            _make_visible(error)
            raise

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except Exception as error:
            if not is_expected(error):
                _make_visible(error)
                raise
            print_error(error)
            raise typer.Exit(EXIT_BAD_INPUT) from None


def _make_visible(error: Exception) -> None:
    """Replace the message of a usage error, which quotes the command line, by its printable form."""
    if hasattr(error, "format_message"):
        text = shortened(visible(error.format_message(), keep="\n"))
        error.format_message = lambda: text


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
    app()
