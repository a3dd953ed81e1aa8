"""Making of data sets: preparation, work shard by shard, and the manifest."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cmpdesign.data.folder import (
    Prepared,
    Progress,
    clear_unfinished,
    find_record,
    open_folder,
    write_manifest,
)
from cmpdesign.data.frames.plan import prepare_plan
from cmpdesign.data.schedule.schedulers import Scheduler, results
from cmpdesign.data.shard import make_shard
from cmpdesign.data.videos.extraction import (
    FrameReading,
    SourceTask,
    index_source,
    name_tasks,
    prepare_extraction,
)
from cmpdesign.errors import CmpDesignError
from cmpdesign.libraries import require_libraries
from cmpdesign.watch import tell
from extractor import Reference

FRAMES_A_SHARD = 1000  # of an extraction


@dataclass(frozen=True)
class ShardRange:
    """Shards from ``first`` up to, and without, ``end``; None: up to the plan's last."""

    first: int = 0
    end: int | None = None


def parse_shards(text: str | int | None) -> ShardRange:
    """The shards from "N", the first N, or "A:B", those from A to below B; None for all.

    Raises:
        CmpDesignError: another text.
    """
    if text is None:
        return ShardRange()
    first, colon, end = str(text).partition(":")
    parts = (first, end) if colon else ("0", first)
    if not all(part.isdecimal() and len(part) < 10 for part in parts) or int(parts[0]) >= int(parts[1]):
        raise CmpDesignError(
            f"shards is {text}; it must be a number above 0, as in 8, or a range A:B with A below B, as in 8:16"
        )
    return ShardRange(int(parts[0]), int(parts[1]))


def make_dataset(
    plan: str | Path,
    folder: str | Path,
    shards: ShardRange,
    scheduler: Scheduler,
    inputs_from: Sequence[str | Path] = (),
) -> Progress:
    """Make the shards of a plan that are not done yet.

    Args:
        plan: the TOML file.
        folder: the data set: a new folder, or the folder of an interrupted run of the same plan.
        shards: the range of shards.
        scheduler: the workers.
        inputs_from: see ``prepare_plan``.

    Raises:
        CmpDesignError: the plan cannot be carried out, or the folder holds other files; workers were lost.
        OutputError: a file cannot be written. Finished shards are kept, and no shard is half-written.
    """
    return _carry_out(prepare_plan(plan, inputs_from), Path(folder).resolve(), shards, scheduler)


def extract_markers(
    layout: Reference,
    sources: Sequence[str],
    folder: str | Path,
    reading: FrameReading,
    scheduler: Scheduler,
    frames_a_shard: int = FRAMES_A_SHARD,
) -> Progress:
    """Read the markers of all frames of videos and folders of pictures, part by part.

    Args:
        layout: the pattern.
        sources: see ``name_tasks``.
        folder: see ``make_dataset``.
        reading: options of the reader.
        scheduler: the workers.
        frames_a_shard: smallest number of frames of a part, except for the last part of a source.

    Raises:
        CmpDesignError, OutputError: see ``make_dataset``; or a source cannot be read.
    """
    if frames_a_shard < 1:
        raise CmpDesignError(f"frames_a_shard is {frames_a_shard}; it must be 1 or more")
    tasks = name_tasks(sources, frames_a_shard)
    indexed = {source["name"]: source for source in _index(tasks, scheduler)}
    prepared = prepare_extraction(layout, [indexed[task.name] for task in tasks], reading)
    return _carry_out(prepared, Path(folder).resolve(), ShardRange(), scheduler)


def _index(tasks: Sequence[SourceTask], scheduler: Scheduler) -> list[dict[str, Any]]:
    """The sources, cut into parts; by threads, because most of the time is waiting for files."""
    names = [task.name for task in tasks]
    for name in names:
        if names.count(name) > 1:
            raise CmpDesignError(f"{name} is given twice; give each source once")
    if scheduler.address:
        return list(results(index_source, tasks, scheduler))
    with ThreadPoolExecutor(scheduler.workers) as pool:
        return list(pool.map(index_source, tasks))


def _carry_out(prepared: Prepared, folder: Path, shards: ShardRange, scheduler: Scheduler) -> Progress:
    require_libraries("data", "pyarrow", "scipy", "threadpoolctl")
    end = prepared.shards if shards.end is None else shards.end
    if end > prepared.shards:
        raise CmpDesignError(
            f"shards is {shards.first}:{end}; the plan has {prepared.shards} shards; give fewer"
        )
    open_folder(folder, prepared)
    wanted = range(shards.first, end)
    missing = [number for number in wanted if find_record(folder, prepared.document, number) is None]
    done = len(wanted) - len(missing)
    tell(done, len(wanted), "shards")
    try:
        with closing(results(partial(make_shard, str(folder)), missing, scheduler)) as made:
            for _ in made:
                done += 1
                tell(done, len(wanted), "shards")
    finally:
        clear_unfinished(folder, missing)
    return write_manifest(folder)
