"""Work on a dask cluster that was started by hand, over SSH, by SLURM, or on Kubernetes.

The scheduler gives the work of a lost worker to another worker. The results of the work are small: shards are files in
a folder that all workers can write.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from cmpdesign.data.schedule.processes import installed_versions, limit_threads, require_versions
from cmpdesign.errors import CmpDesignError
from cmpdesign.libraries import extra

CONNECT_S = 10
RETRIES = 2  # of work that raised an error, as file systems of clusters do at times
PLUGIN, KEY = "cmpdesign-threads", "cmpdesign"


def cluster_results(
    work: Callable[[Any], Any], items: Sequence[Any], address: str
) -> Generator[Any, None, None]:
    """The result of every item in the order of completion.

    Args:
        work: a function at the top of a module, installed on the workers.
        items: its arguments.
        address: of the scheduler, as "tcp://10.0.0.1:8786", or the path of its scheduler file (.json).

    Raises:
        CmpDesignError: the scheduler cannot be reached or was lost, a worker has other versions or was lost too
            often; or an error of the work.
    """
    with extra("dask"):
        distributed: Any = import_module("distributed")
    done = 0
    try:
        with _quiet(), _client(address) as client:
            client.register_plugin(_thread_plugin(), name=PLUGIN)
            futures = client.map(
                _Checked(work, installed_versions()), list(items), retries=RETRIES, pure=False, key=KEY
            )
            completed = distributed.as_completed(futures, loop=client.loop)
            del futures  # a result is dropped after its use
            for future in completed:
                result = future.result()
                future.release()
                done += 1
                yield result
    except distributed.KilledWorker as error:
        raise CmpDesignError(
            f"a part of the work was lost with {error.allowed_failures + 1} workers one after another, {done} of "
            f"{len(items)} parts are done; check the memory of the workers"
        ) from None
    except (distributed.client.FutureCancelledError, distributed.comm.CommClosedError, CancelledError):
        raise CmpDesignError(
            f"the scheduler at {address} was lost, {done} of {len(items)} parts are done; the same command continues "
            "with the other parts"
        ) from None


class _Checked:
    """Work that is refused where the versions differ."""

    def __init__(self, work: Callable[[Any], Any], versions: Mapping[str, str]) -> None:
        self._work, self._versions = work, versions

    def __call__(self, item: Any) -> Any:
        require_versions(self._versions)
        return self._work(item)


def _client(address: str) -> Any:
    """A client of the scheduler.

    Raises:
        CmpDesignError: the scheduler cannot be reached.
    """
    with extra("dask"):
        distributed: Any = import_module("distributed")
    is_file = address.endswith(".json")
    if is_file and not Path(address).is_file():
        raise CmpDesignError(f"{address}: no such scheduler file; start the scheduler first")
    where = {"scheduler_file": address} if is_file else {"address": address}
    try:
        return distributed.Client(**where, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # OSError: also a time-out
        raise CmpDesignError(
            f"no dask scheduler answers at {address} ({type(error).__name__}); start one with: dask scheduler"
        ) from None


def _thread_plugin() -> Any:
    """A plugin that limits the threads of all workers, also of those that join later."""
    with extra("dask"):
        distributed: Any = import_module("distributed")

    class Threads(distributed.WorkerPlugin):  # type: ignore[misc]
        def setup(self, worker: Any) -> None:
            limit_threads()

    return Threads()


@contextmanager
def _quiet() -> Iterator[None]:
    """Within this context, the log of distributed is off; its events are stated in one line at the end."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
