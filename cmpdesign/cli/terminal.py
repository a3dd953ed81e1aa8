"""Output to the terminal for all commands. No other module prints: a test holds this.

Texts of files, paths and options are foreign: they may hold escape sequences that move the cursor, change the title of
the window or hide what was printed. ``visible`` replaces them, and every function here calls it.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.texts import visible

if TYPE_CHECKING:
    from rich.console import Console

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
MOST_LINE_LETTERS = 300  # of an error or a warning
_HEAD_LETTERS = 200  # of them before the cut; the remedy stands at the end of a line


def shortened(text: str) -> str:
    """The text, cut in the middle at ``MOST_LINE_LETTERS``."""
    if len(text) <= MOST_LINE_LETTERS:
        return text
    gap = " ... "
    return text[:_HEAD_LETTERS] + gap + text[len(text) - (MOST_LINE_LETTERS - _HEAD_LETTERS - len(gap)) :]


def console(stderr: bool = False) -> Console:
    """A console on stdout or stderr: plain text without a terminal; no markup, and texts are made ``visible``."""
    from rich.console import Console

    class VisibleConsole(Console):
        """Shows the unprintable characters of every text that it is given, also in the cells of tables."""

        def render_str(self, text: str, **options: Any) -> Any:
            return super().render_str(visible(text, keep="\n"), **options)

    return VisibleConsole(stderr=stderr, highlight=False, markup=False, emoji=False, soft_wrap=True)


def is_expected(error: BaseException) -> bool:
    """True for errors that either package raises on purpose; does not import the extractor."""
    from_extractor = sys.modules.get("extractor.errors")
    if from_extractor is not None and isinstance(error, from_extractor.ExtractorError):
        return True
    return isinstance(error, CmpDesignError)


def error_on_one_line(error: BaseException | str) -> str:
    """The error's message: one line of printable characters, at most ``MOST_LINE_LETTERS``."""
    return shortened(visible(" ".join(str(error).split())))


def print_error(error: BaseException | str) -> None:
    """Print an error on stderr."""
    print(f"error: {error_on_one_line(error)}", file=sys.stderr)


def print_warning(text: str) -> None:
    """Print a warning on stderr."""
    print(f"warning: {shortened(visible(text))}", file=sys.stderr)


def print_document(text: str) -> None:
    """Print lines, such as a document of JSON, on stdout as they are, without wrapping."""
    sys.stdout.write(visible(text, keep="\n"))


def printable_path(path: object) -> str:
    """The path as text, with unprintable characters escaped."""
    return visible(str(path))
