"""Items by worker processes, with progress on stderr."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TypeVar

from cmpdesign.workers import worker_pool

Item, Result = TypeVar("Item"), TypeVar("Result")
PROCESSES = min(2, os.cpu_count() or 1)


def results_of(
    function: Callable[[Item], Result], items: Sequence[Item], processes: int, chunk: int = 4
) -> list[Result]:
    """The results in the order of the items; one process is this one."""
    with ExitStack() as stack:
        found: Iterable[Result]
        if processes == 1:
            found = map(function, items)
        else:
            pool = stack.enter_context(worker_pool(processes))
            found = pool.map(partial(_on_one_thread, function), items, chunksize=chunk)
        return list(_told(found, len(items)))


def _on_one_thread(function: Callable[[Item], Result], item: Item) -> Result:
    import cv2

    cv2.setNumThreads(1)
    return function(item)


def _told(results: Iterable[Result], total: int) -> Iterator[Result]:
    started, is_terminal = time.perf_counter(), sys.stderr.isatty()
    for count, result in enumerate(results, start=1):
        if is_terminal or count % 200 == 0:
            text = f"{count}/{total}, {time.perf_counter() - started:.0f} s"
            print(text, end="\r" if is_terminal else "\n", file=sys.stderr, flush=True)
        yield result
