"""Output to the terminal for all commands."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from rich.console import Console

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def console(stderr: bool = False) -> Console:
    """A console on stdout or stderr: plain text without a terminal; markup in values is not interpreted."""
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, markup=False, soft_wrap=True)


def is_expected(error: BaseException) -> bool:
    """True for errors that either package raises on purpose; does not import the extractor."""
    from_extractor = sys.modules.get("extractor.errors")
    if from_extractor is not None and isinstance(error, from_extractor.ExtractorError):
        return True
    return isinstance(error, CmpDesignError)


def error_on_one_line(error: BaseException | str) -> str:
    return " ".join(str(error).split())


def print_error(error: BaseException | str) -> None:
    print(f"error: {error_on_one_line(error)}", file=sys.stderr)


def print_warning(text: str) -> None:
    print(f"warning: {text}", file=sys.stderr)


def printable_path(path: object) -> str:
    """The path as text, with unprintable characters escaped."""
    text = str(path)
    return text if text.isprintable() else ascii(text)
