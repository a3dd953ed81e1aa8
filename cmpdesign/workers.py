"""Worker processes that end when this process ends, also when this process is killed."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

MAX_ON_WINDOWS = 61


@contextmanager
def worker_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes, each with an interpreter of its own.

    The processes ignore Ctrl-C, which reaches all processes of a terminal: this process handles Ctrl-C. The processes
    end

    - with the block, after the work that was submitted;
    - at once when an exception leaves the block: unfinished work is lost;
    - at once when this process has ended, as after ``kill -9``.

    Args:
        workers: number of processes, 1 or more.

    Yields:
        The pool; submitted functions and arguments must be picklable.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import active_children, get_context

    others = set(active_children())
    with ProcessPoolExecutor(possible_workers(workers), get_context("spawn"), initializer=_begin) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            mine = set(active_children()) - others
            for process in mine:
                process.kill()
            for process in mine:  # until its end, a process holds the locks of its files
                process.join()
            raise


def possible_workers(workers: int) -> int:
    """The number of processes, or the most that Python can wait for on Windows."""
    return min(workers, MAX_ON_WINDOWS) if sys.platform == "win32" else workers


def _begin() -> None:
    """Begin a worker: ignore Ctrl-C, and watch the process that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, name="end with parent", daemon=True).start()


def _end_with_parent() -> None:
    """Wait until the parent process has ended, and end this process."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
