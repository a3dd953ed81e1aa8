"""The check of a data set: every file of its shards, layouts and inputs against the digests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmpdesign.data.folder import (
    file_digest,
    find_record,
    finished_records,
    number_of_shards,
    read_plan,
    recorded_shards,
    shard_name,
)
from cmpdesign.data.named_files import check_inputs, named_layouts
from cmpdesign.data.records import ShardRecord
from cmpdesign.errors import CmpDesignError, InputError
from cmpdesign.watch import tell
from extractor import ExtractorError


@dataclass(frozen=True)
class CheckedDataSet:
    """The result of a check.

    Attributes:
        shards, of_shards: numbers of whole shards, and of shards of the plan.
        frames: number of frames in the whole shards.
        bytes: size of the whole shards' files.
        problems: one sentence on each damaged file.
    """

    shards: int
    of_shards: int
    frames: int
    bytes: int
    problems: tuple[str, ...]


def check(folder: str | Path) -> CheckedDataSet:
    """Compare every file of a data set with its digest: layouts, inputs, and all files of the finished shards.

    The digests are in the data set itself: they show damage, and not who made the files.

    Raises:
        CmpDesignError: the folder holds no data set, or its plan was changed.
    """
    folder = Path(folder).resolve()
    plan = read_plan(folder)
    problems = list(_named_file_problems(folder, plan))
    numbers, whole = recorded_shards(folder, plan), []
    for done, number in enumerate(numbers):
        tell(done, len(numbers), "shards")
        record = find_record(folder, plan, number)
        if record is None:
            problems.append(
                f"shards/{shard_name(number)}.json: the record, or a file of the shard, was changed or is missing; "
                "the command that made the data set makes the shard again"
            )
            continue
        found = [f"{name}: {_remedy(number)}" for name in _changed_files(folder, record)]
        problems += found
        if not found:
            whole.append(record)
    problems += _manifest_problems(folder, whole, numbers)
    sizes = [about.bytes for record in whole for about in record.files.values()]
    frames = sum(record.frames for record in whole)
    return CheckedDataSet(len(whole), number_of_shards(plan), frames, sum(sizes), tuple(problems))


def _named_file_problems(folder: Path, plan: Mapping[str, Any]) -> Iterator[str]:
    for look in (named_layouts, check_inputs):
        try:
            look(folder, plan)
        except (CmpDesignError, ExtractorError) as error:
            yield str(error)


def _changed_files(folder: Path, record: ShardRecord) -> Iterator[str]:
    for name, about in record.files.items():
        try:
            if file_digest(folder / name) == about.sha256:
                continue
        except (InputError, OSError):
            pass
        yield name


def _remedy(number: int) -> str:
    record = f"shards/{shard_name(number)}.json"
    return f"the content was changed; delete {record}, and the command that made the data set makes the shard again"


def _manifest_problems(folder: Path, whole: list[ShardRecord], numbers: list[int]) -> list[str]:
    """Whether the manifest, from which a complete data set is read, has other records than the shards."""
    listed = finished_records(folder)
    if len(whole) < len(numbers) or listed == whole:
        return []
    return [
        "manifest.json: differs from the records of the shards; the command that made the data set writes it again"
    ]
