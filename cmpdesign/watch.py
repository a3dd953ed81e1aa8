"""Progress of long work: the work reports the number of finished parts to a function of the caller."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar


def _ignore(done: int, total: int | None, unit: str) -> None:
    """Nobody watches."""


# (number of finished parts, number of all parts, name of the parts, as in "frames"); a step of a name begins without a
# number of all parts: (0, None, "reading of pads")
Watch = Callable[[int, int | None, str], None]
Item = TypeVar("Item")
_WATCH: ContextVar[Watch] = ContextVar("watch", default=_ignore)


@contextmanager
def watched(watch: Watch) -> Iterator[None]:
    """Within this context, ``watch`` is called after every finished part."""
    token = _WATCH.set(watch)
    try:
        yield
    finally:
        _WATCH.reset(token)


def begin(step: str) -> None:
    """Report that a step begins; the parts that are told next are parts of this step."""
    _WATCH.get()(0, None, step)


def tell(done: int, total: int, unit: str = "parts") -> None:
    """Report the number of finished parts."""
    _WATCH.get()(done, total, unit)


def told(parts: Iterable[Item], total: int, unit: str = "parts") -> Iterator[Item]:
    """The parts one after the other; each is reported when the next part is requested."""
    for done, part in enumerate(parts, start=1):
        yield part
        tell(done, total, unit)
