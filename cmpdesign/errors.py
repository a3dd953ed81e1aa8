"""Errors for users. Every message names the value, the limit, the unit and the remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class CmpDesignError(Exception):
    """Base of every error that cmpdesign raises on purpose; the command line prints it on one line."""


class DesignError(CmpDesignError, ValueError):
    """A design whose parameters are unknown, out of range or contradict each other."""


class InputError(CmpDesignError, ValueError):
    """A file that cannot be read, is no document of its format, or exceeds a limit."""


class SourceError(CmpDesignError, ValueError):
    """A picture, folder, video, camera or stream that does not exist, or cannot be opened."""


class OutputError(CmpDesignError, OSError):
    """A file or folder that could not be written. Its previous content is unchanged."""


def _as_argument(name: str, value: str | None) -> str:
    return name if value is None else f"{name}={value!r}"


_SPELLING: ContextVar[Callable[[str, str | None], str]] = ContextVar("spelling", default=_as_argument)


def parameter(name: str, value: str | None = None) -> str:
    """A parameter of a call as the caller writes it: ``fps`` and ``side='back'``; ``--fps`` and ``--side back`` for a
    caller on the command line.
    """
    return _SPELLING.get()(name, value)


@contextmanager
def spelled(spelling: Callable[[str, str | None], str]) -> Iterator[None]:
    """Within this context, ``spelling`` writes the names of parameters."""
    token = _SPELLING.set(spelling)
    try:
        yield
    finally:
        _SPELLING.reset(token)
