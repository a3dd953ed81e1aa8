"""What all commands share: refused paths, and errors, missing libraries and Ctrl-C as one line and an exit code."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from cmpdesign.cli.missing_library import missing_library_text
from cmpdesign.cli.terminal import EXIT_BAD_INPUT, EXIT_INTERRUPTED, is_expected, print_error, shortened
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.texts import visible

INTERRUPTED = "interrupted; every file that was written is complete"


class Command(TyperCommand):
    """A command that refuses "-" for a file or folder: no command reads standard input or writes files to output."""

    def invoke(self, ctx: Any) -> Any:
        for parameter in self.params:
            given = ctx.params.get(parameter.name)
            values: Iterable[Any] = given if isinstance(given, list | tuple) else (given,)
            if any(isinstance(value, Path) and str(value) == "-" for value in values):
                raise CmpDesignError(
                    f"{parameter.opts[-1]} -: standard input and output are not supported; give a name"
                )
        return super().invoke(ctx)


class OneLineErrors(TyperGroup):
    """Prints expected errors as one line on stderr with exit code 2, and Ctrl-C as one line with exit code 130."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        try:
            return super().make_context(*arguments, **options)
        except Exception as error:
            _make_visible(error)
            raise

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            print_error(INTERRUPTED)
            raise typer.Exit(EXIT_INTERRUPTED) from None
        except ModuleNotFoundError as error:
            text = missing_library_text(error)
            if text is None:
                raise
            print_error(text)
        except Exception as error:
            if not is_expected(error):
                _make_visible(error)
                raise
            print_error(error)
        raise typer.Exit(EXIT_BAD_INPUT)


def _make_visible(error: Exception) -> None:
    """Replace the message of a usage error, which quotes the command line, by its printable form."""
    if hasattr(error, "format_message"):
        text = shortened(visible(error.format_message(), keep="\n"))
        error.format_message = lambda: text
