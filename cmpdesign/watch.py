"""Progress of long work: the work reports finished parts, and what a user should know at once, to the caller."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar


def _ignore(*what: object) -> None:
    """Nobody watches."""


# (number of finished parts, number of all parts, name of the parts, as in "frames"); a step of a name begins without a
# number of all parts: (0, None, "reading of pads"). Of 0 parts: their number is not known.
Watch = Callable[[int, int | None, str], None]
# (a line of text, whether it gives reason to doubt the result)
Notice = Callable[[str, bool], None]
Item = TypeVar("Item")
_WATCH: ContextVar[Watch] = ContextVar("watch", default=_ignore)
_NOTICE: ContextVar[Notice] = ContextVar("notice", default=_ignore)


@contextmanager
def watched(watch: Watch, notice: Notice = _ignore) -> Iterator[None]:
    """Within this context, ``watch`` is called after every finished part, ``notice`` with what to know at once."""
    tokens = _WATCH.set(watch), _NOTICE.set(notice)
    try:
        yield
    finally:
        _WATCH.reset(tokens[0])
        _NOTICE.reset(tokens[1])


def begin(step: str) -> None:
    """Report that a step begins; the parts that are told next are parts of this step."""
    _WATCH.get()(0, None, step)


def tell(done: int, total: int, unit: str = "parts") -> None:
    """Report the number of finished parts."""
    _WATCH.get()(done, total, unit)


def notice(text: str) -> None:
    """Report what a user should know at once, as the address of a live view."""
    _NOTICE.get()(text, False)


def warn(text: str) -> None:
    """Report a reason to doubt the result, as soon as the reason is known."""
    _NOTICE.get()(text, True)


def told(parts: Iterable[Item], total: int, unit: str = "parts") -> Iterator[Item]:
    """The parts one after the other; each is reported when the next part is requested."""
    for done, part in enumerate(parts, start=1):
        yield part
        tell(done, total, unit)
