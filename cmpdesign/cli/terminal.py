"""Output to the terminal for all commands. No other module prints; a test checks this rule.

Texts of files, paths and options come from others. They may hold escape sequences that move the cursor, change the
title of the window or hide what was printed. ``visible`` replaces them, and every function here calls it.
"""

from __future__ import annotations

import errno
import json
import os
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import typer

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.inputs.texts import one_line, shortened, visible

if TYPE_CHECKING:
    from rich.console import Console

    from cmpdesign.documents.document import Document

EXIT_NEGATIVE = 1  # done, with a negative verdict or an early end
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
_STARTED = time.perf_counter()


class Mode(NamedTuple):
    """The options that every command has.

    Attributes:
        as_json: one JSON document on stdout, errors and warnings as JSON lines on stderr.
        quiet: errors and warnings only.
        verbose: each step with its time on stderr, and the place in the code where an error arose.
    """

    as_json: bool = False
    quiet: bool = False
    verbose: bool = False

    @property
    def prints_text(self) -> bool:
        """Results and progress are printed for people."""
        return not (self.as_json or self.quiet)


_TEXT = Mode()
_MODE: ContextVar[Mode] = ContextVar("mode", default=_TEXT)


def current_mode() -> Mode:
    """The mode of the running command."""
    return _MODE.get()


def use_mode(mode: Mode) -> None:
    """Set the mode of the running command."""
    _MODE.set(mode)


def console(stderr: bool = False) -> Console:
    """A console on stdout or stderr: plain text without a terminal; no markup, and texts are made ``visible``."""
    from rich.console import Console

    class VisibleConsole(Console):
        """Makes the unprintable characters of every printed text visible, also in the cells of tables."""

        def render_str(self, text: str, **options: Any) -> Any:
            return super().render_str(visible(text, keep="\n"), **options)

    return VisibleConsole(stderr=stderr, highlight=False, markup=False, emoji=False, soft_wrap=True)


def is_expected(error: BaseException) -> bool:
    """True for errors that one of the packages raises on purpose; the function does not import the extractor."""
    from_extractor = sys.modules.get("extractor.errors")
    if from_extractor is not None and isinstance(error, from_extractor.ExtractorError):
        return True
    return isinstance(error, CmpDesignError)


def print_error(error: BaseException | str, exit_code: int = EXIT_BAD_INPUT) -> None:
    """Print an error on stderr."""
    _print_message("error", one_line(error), exit_code=exit_code)


def print_warning(text: str) -> None:
    """Print a warning on stderr."""
    _print_message("warning", shortened(visible(text)))


def print_step(text: str) -> None:
    """Print a finished step on stderr, with the time since the start, if the command is verbose."""
    if current_mode().verbose:
        _print_message(
            "step", f"{shortened(visible(text))} ({1e3 * (time.perf_counter() - _STARTED):.0f} ms)"
        )


def print_origin(error: BaseException) -> None:
    """Print the place in the code where an error arose on stderr, if the command is verbose."""
    if current_mode().verbose and not current_mode().as_json:
        sys.stderr.write(visible("".join(traceback.format_exception(error)), keep="\n"))


def _print_message(level: str, line: str, **fields: Any) -> None:
    """One line on stderr; its JSON is described by ``Message``."""
    if current_mode().as_json:
        message = {"format": "cmp-message", "version": 1, "level": level, "text": line, **fields}
        line = visible(json.dumps(message, ensure_ascii=False))
    else:
        line = f"{level}: {line}"
    if sys.stderr is not None:  # None: the caller closed it
        print(line, file=sys.stderr)


def say(*objects: Any, **options: Any) -> None:
    """Print texts and tables for people on stdout; nothing with ``--quiet`` or ``--json``.

    Args:
        objects, options: as of rich's ``Console.print``.
    """
    if current_mode().prints_text and sys.stdout is not None:
        with _writing_output():
            console().print(*objects, **options)


def say_table(rows: Mapping[str, str]) -> None:
    """Print names and their values for people."""
    say_columns(("", ""), rows.items(), folds=True)


def say_columns(headings: Sequence[str], rows: Iterable[Sequence[str]], *, folds: bool = False) -> None:
    """Print a table for people.

    Args:
        headings: of the columns; one that begins with ">" is of numbers, on the right.
        rows: a text for each column.
        folds: lines that are longer than the terminal is wide fold within their column.
    """
    from rich.table import Table

    table = Table(box=None, show_header=any(headings), pad_edge=False)
    for heading in headings:
        justify: Literal["left", "right"] = "right" if heading.startswith(">") else "left"
        table.add_column(heading.removeprefix(">"), justify=justify, overflow="fold" if folds else "ellipsis")
    for row in rows:
        table.add_row(*row)
    say(table, soft_wrap=not folds)


def say_text(text: str) -> None:
    """Print lines for people on stdout without wrapping; nothing with ``--quiet`` or ``--json``."""
    if current_mode().prints_text:
        print_document(text)


def print_document(text: str) -> None:
    """Print lines, such as a document of JSON, on stdout as they are, without wrapping.

    Raises:
        OutputError: standard output cannot be written, as on a full disk.
    """
    if sys.stdout is not None:  # None: the caller closed it
        with _writing_output():
            sys.stdout.write(visible(text, keep="\n"))
            sys.stdout.flush()


@contextmanager
def _writing_output() -> Iterator[None]:
    """Within this context, an error of standard output is an ``OutputError``, and the rest of the output is lost."""
    try:
        yield
    except OSError as error:
        if (
            error.errno == errno.EPIPE
        ):  # the reading program, as head, has closed the pipe; click ends the program
            raise
        discard_output()
        raise OutputError(f"standard output: cannot be written ({error.strerror or error})") from None


def discard_output() -> None:
    """Discard the rest of standard output: Python would try to write the rest at exit, and fail again."""
    with suppress(OSError, ValueError), Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def print_written(done: object) -> None:
    """Print the written files or folders of a record for people."""
    written = getattr(done, "written", None) or ()
    for path in (written,) if isinstance(written, str) else written:
        say(f"wrote {path}")


def finish(done: Document, exit_code: int = 0) -> None:
    """End a command: print its document with ``--json``, and exit with its code.

    Raises:
        typer.Exit: the exit code is not 0.
    """
    if current_mode().as_json:
        print_document(done.to_json())
    print_step("done")
    if exit_code:
        raise typer.Exit(exit_code)
