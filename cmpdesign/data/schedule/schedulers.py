"""Work on all numbers of a data set: processes of this machine, or the workers of a dask cluster.

Results are returned in the order of completion; results do not depend on this order or on the number of workers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from cmpdesign.data.schedule.cluster import cluster_results
from cmpdesign.data.schedule.processes import one_thread, work_on_one_thread
from cmpdesign.errors import CmpDesignError
from cmpdesign.workers import worker_pool

MAX_LOSSES = 3  # of workers, one after another without a result in between
DASK = "dask="
MAX_WORKERS = 512
Work = Callable[[Any], Any]


@dataclass(frozen=True)
class Scheduler:
    """The workers.

    Attributes:
        address: of a dask scheduler, or the path of its scheduler file; "" for this machine.
        workers: number of processes on this machine.
    """

    address: str = ""
    workers: int = 1


def parse_scheduler(text: str, workers: int | None) -> Scheduler:
    """The scheduler from "local" or "dask=ADDRESS"; ``workers`` None: one for each core that this process may use.

    Raises:
        CmpDesignError: another text, or a number of workers that is not from 1 to ``MAX_WORKERS``.
    """
    if workers is not None and not 1 <= workers <= MAX_WORKERS:
        raise CmpDesignError(f"workers is {workers}; it must be from 1 to {MAX_WORKERS}")
    if text == "local":
        return Scheduler(workers=workers or _usable_cores())
    address = text.removeprefix(DASK)
    if not text.startswith(DASK) or not address:
        raise CmpDesignError(
            f"scheduler is {text!r}; it must be local or dask=ADDRESS, as in dask=tcp://10.0.0.1:8786 or "
            "dask=scheduler.json"
        )
    if workers is not None:
        raise CmpDesignError(
            "workers is not allowed with a dask scheduler, which has its own workers; leave it out"
        )
    return Scheduler(address)


def _usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def results(work: Work, items: Sequence[Any], scheduler: Scheduler) -> Generator[Any, None, None]:
    """The result of every item, in the order of completion.

    Args:
        work: a function at the top of a module.
        items: its arguments; each can be pickled.
        scheduler: where the work is done.

    Raises:
        CmpDesignError: an error of the work, or workers or the scheduler were lost. Work that has not begun is not
            done.
    """
    if scheduler.address:
        return cluster_results(work, items, scheduler.address)
    if min(scheduler.workers, len(items)) < 2:
        return _own_results(work, items)
    return _local_results(work, items, scheduler.workers)


def _own_results(work: Work, items: Sequence[Any]) -> Generator[Any, None, None]:
    """This process does the work of one worker."""
    with one_thread():
        for item in items:
            yield work(item)


def _local_results(work: Work, items: Sequence[Any], workers: int) -> Generator[Any, None, None]:
    """A killed worker ends its pool; another pool does the remaining work."""
    open_items, losses = list(range(len(items))), 0
    while open_items:
        before = len(open_items)
        with closing(_pool_results(work, items, tuple(open_items), min(workers, before))) as found:
            for place, result in found:
                open_items.remove(place)
                yield result
        losses = losses + 1 if len(open_items) == before else 1
        if open_items and losses > MAX_LOSSES:
            raise CmpDesignError(
                f"{losses} times a worker was killed without a result, the last time with "
                f"{len(open_items)} parts left; check that there is memory for {workers} workers"
            )


def _pool_results(
    work: Work, items: Sequence[Any], places: Iterable[int], workers: int
) -> Generator[tuple[int, Any], None, None]:
    """(place, result) in the order of completion, until a worker is killed."""
    from concurrent.futures import as_completed
    from concurrent.futures.process import BrokenProcessPool

    try:
        with worker_pool(workers) as pool:
            futures = {pool.submit(work_on_one_thread, work, items[place]): place for place in places}
            for done in as_completed(futures):
                if not isinstance(done.exception(), BrokenProcessPool):
                    yield futures[done], done.result()
    except BrokenProcessPool:  # while work was submitted
        return
