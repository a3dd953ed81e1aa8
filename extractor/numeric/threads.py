"""Calls at the same time: native loops run without the lock of Python, so that two calls use two cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

Result = TypeVar("Result")


def available_cores() -> int:
    """The number of cores that this process may use; all cores if the system does not state it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Threads:
    """Threads that are started at the first use and kept. Copies and pickles start their own.

    Args:
        count: of calls at the same time; the caller's thread is one of them.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool: ThreadPoolExecutor | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.count,)

    def results(self, calls: Sequence[Callable[[], Result]]) -> list[Result]:
        """The results in the order of the calls; an exception is raised when all calls have ended."""
        if self.count < 2 or len(calls) < 2:
            return [call() for call in calls]
        if self._pool is None:
            from concurrent.futures import ThreadPoolExecutor

            self._pool = ThreadPoolExecutor(self.count - 1, "extractor")
        others = [self._pool.submit(call) for call in calls[1:]]
        try:
            first = calls[0]()
        finally:
            for other in others:
                other.exception()
        return [first, *(other.result() for other in others)]
