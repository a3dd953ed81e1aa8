"""Times of work, of the processor and by the clock; the least of runs in turns, so that load affects all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Generic, NamedTuple, TypeVar

Result = TypeVar("Result")


class Timed(NamedTuple, Generic[Result]):
    """The result of some work, with the processor's time of all threads of this process, and the time by the clock."""

    result: Result
    cpu_ms: float
    clock_ms: float


def timed(work: Callable[[], Result]) -> Timed[Result]:
    """Do some work."""
    clock_s, cpu_s = time.perf_counter(), time.process_time()
    result = work()
    return Timed(result, 1e3 * (time.process_time() - cpu_s), 1e3 * (time.perf_counter() - clock_s))


class Least(NamedTuple):
    """The least times of some work."""

    cpu_ms: float
    clock_ms: float


def least_in_turns(work: Mapping[str, Callable[[int], object]], rounds: int) -> dict[str, Least]:
    """By name; every piece of work is done in each round, with the round's number."""
    times: dict[str, list[Timed[object]]] = {name: [] for name in work}
    for number in range(rounds):
        for name, one in work.items():
            times[name].append(timed(partial(one, number)))
    return {
        name: Least(min(one.cpu_ms for one in runs), min(one.clock_ms for one in runs))
        for name, runs in times.items()
    }
