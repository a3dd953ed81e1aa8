"""The output of the running command: text or JSON; everything, or errors and warnings only."""

from __future__ import annotations

from contextvars import ContextVar
from typing import NamedTuple


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
