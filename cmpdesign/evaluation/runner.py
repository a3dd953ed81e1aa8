"""Trials on several cores, each result written to the journal. Results do not depend on number and order."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluation.journal import Journal
from cmpdesign.libraries import extra
from cmpdesign.watch import tell
from cmpdesign.workers import worker_pool


@dataclass(frozen=True)
class Trial:
    """One trial.

    Attributes:
        key: the name in the journal, unique in a run.
        values: the arguments of the work, as JSON values.
    """

    key: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class RunOptions:
    """The user's options of a run.

    Attributes:
        trials: number of trials of each kind.
        seed: seed of all random values.
        sensor_text: the sensor file's content.
        preset: the extractor's preset.
        workers: number of processes.

    Raises:
        CmpDesignError: a value is out of range.
    """

    trials: int
    seed: int = 0
    sensor_text: str = ""
    preset: str = "balanced"
    workers: int = 1

    def __post_init__(self) -> None:
        for name in ("trials", "workers"):
            if getattr(self, name) < 1:
                raise CmpDesignError(f"{name} is {getattr(self, name)}; it must be at least 1")
        if self.seed < 0:
            raise CmpDesignError(f"seed is {self.seed}; it must be 0 or more")

    @property
    def values(self) -> dict[str, Any]:
        """The values that every trial receives. A journal is valid for one set of values."""
        return {"sensor": self.sensor_text, "seed": self.seed, "preset": self.preset}


Work = Callable[[Mapping[str, Any]], Mapping[str, Any]]


def trial_rng(seed: int, name: str, index: int) -> np.random.Generator:
    """The random stream of one trial, the same in every process and at any time."""
    return np.random.default_rng([seed, zlib.crc32(name.encode("utf-8")), index])


def run_trials(
    work: Work,
    trials: Sequence[Trial],
    journal: Journal,
    *,
    workers: int,
) -> list[Mapping[str, Any]]:
    """The results of all trials, in their order; trials in the journal are not run again.

    Args:
        work: a picklable function of a trial's values -> JSON values.
        trials: the trials.
        journal: the results of earlier runs; new results are added.
        workers: number of processes; 1: this process.

    Raises:
        CmpDesignError: two trials have the same key.
        OutputError: the journal cannot be written.
    """
    if len({trial.key for trial in trials}) < len(trials):
        raise CmpDesignError("two trials have the same name")
    open_trials = [trial for trial in trials if trial.key not in journal.results]
    done = len(trials) - len(open_trials)
    tell(done, len(trials), "trials")
    with closing(_iterate_results(work, open_trials, workers)) as results:
        for count, (key, result) in enumerate(results, start=done + 1):
            journal.add(key, result)
            tell(count, len(trials), "trials")
    return [journal.results[trial.key] for trial in trials]


def _iterate_results(
    work: Work, trials: Sequence[Trial], workers: int
) -> Generator[tuple[str, Any], None, None]:
    """(key, result) in the order of completion."""
    if workers == 1 or len(trials) < 2:
        for trial in trials:
            yield trial.key, _run_trial(work, trial.values)
        return
    from concurrent.futures import as_completed

    # At an early end, the pool ends unfinished trials, which would take up to a minute: their results are not kept.
    with worker_pool(workers) as pool:
        keys = {pool.submit(_run_trial, work, dict(trial.values)): trial.key for trial in trials}
        for done in as_completed(keys):
            yield keys[done], done.result()


def _run_trial(work: Work, values: Mapping[str, Any]) -> Any:
    """One result, converted to JSON and back, so that it equals the same result from the journal.

    The work runs on one thread: processes share the cores, and sums do not depend on the number of threads.
    """
    import cv2

    with extra("evaluate"):
        from threadpoolctl import threadpool_limits
    cv2.setNumThreads(1)
    with threadpool_limits(1):
        return json.loads(json.dumps(work(values), allow_nan=False))
