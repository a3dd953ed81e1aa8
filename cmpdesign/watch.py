"""How far long work is: the work tells how many of its parts are done, and whoever called it may watch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar


def _ignore(done: int, total: int, unit: str) -> None:
    """Nobody watches."""


# (number of parts that are done, number of all parts, what a part is, as in "frames")
Watch = Callable[[int, int, str], None]
Item = TypeVar("Item")
_WATCH: ContextVar[Watch] = ContextVar("watch", default=_ignore)


@contextmanager
def watched(watch: Watch) -> Iterator[None]:
    """Within this context, ``watch`` is called after every part that is done."""
    token = _WATCH.set(watch)
    try:
        yield
    finally:
        _WATCH.reset(token)


def tell(done: int, total: int, unit: str = "parts") -> None:
    """Tell how many parts of the work are done."""
    _WATCH.get()(done, total, unit)


def told(parts: Iterable[Item], total: int, unit: str = "parts") -> Iterator[Item]:
    """The parts one after the other; each is told when the next one is asked for."""
    for done, part in enumerate(parts, start=1):
        yield part
        tell(done, total, unit)
