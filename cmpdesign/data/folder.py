"""The folder of a data set: its plan, one record for each finished shard, and the manifest.

    plan.json              all values that determine the frames, with their digest
    layouts/NAME.json      the patterns
    inputs/                height maps and pictures that the plan names
    images/000012.tar      WebDataset: the pictures of shard 12
    tables/000012.parquet  truth, markers, forces and parameters of the same frames, one row a frame
    shards/000012.json     the record of the shard: the names, sizes and digests of its files. The record is written
    last: a shard
                           with a record is done
    manifest.json          all records

Files are complete under ``unfinished/`` before they are renamed into place. A record whose files are missing or of
another size does not count, and the shard is made again.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from cmpdesign.data.named_files import check_named_files
from cmpdesign.data.records import (
    FORMAT_EXTRACTION,
    FORMAT_FRAMES,
    FORMAT_MANIFEST,
    FORMAT_RECORD,
    MAX_DIGITS,
    PLAN_KINDS,
    Manifest,
    ShardRecord,
)
from cmpdesign.errors import CmpDesignError, InputError, OutputError
from cmpdesign.files.atomic import (
    STAGE_PREFIX,
    Stage,
    remove_abandoned_stages,
    write_file,
    write_folder,
    write_new_file,
)
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import open_file, path_exists, read_text
from cmpdesign.inputs.records import checked_record, parse_record

PLAN, MANIFEST, UNFINISHED = "plan.json", "manifest.json", "unfinished"
# Keys on which no frame depends.
OUTSIDE_DIGEST = ("digest", "frames", "name", "description")
BLOCK_BYTES = 1 << 20
_RECORD_NAME = re.compile(rf"([0-9]{{{MAX_DIGITS},9}})\.json")


@dataclass(frozen=True, eq=False)
class Prepared:
    """A checked plan: the object of plan.json, and other files of the folder by their names."""

    document: Mapping[str, Any]
    files: Mapping[str, bytes]

    @property
    def shards(self) -> int:
        """Number of shards."""
        return number_of_shards(self.document)


def number_of_shards(plan: Mapping[str, Any]) -> int:
    """Number of shards of a plan."""
    if plan["format"] == FORMAT_EXTRACTION:
        return sum(len(source["ranges"]) for source in plan["sources"])
    return int(plan["frames"]) // int(plan["frames_a_shard"])


def plan_digest(plan: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of the values of a plan that determine the frames: without its name and the number of frames."""
    rest = {
        key: _without_locations(value) if key == "sources" else value
        for key, value in plan.items()
        if key not in OUTSIDE_DIGEST
    }
    return hashlib.sha256(json.dumps(rest, sort_keys=True, allow_nan=False).encode()).hexdigest()


def _without_locations(sources: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in source.items() if key != "location"} for source in sources]


def open_folder(folder: Path, prepared: Prepared) -> None:
    """Make the folder with its plan, or check that the folder has the same plan and the files that the plan names.

    Of two processes with different plans, the first makes plan.json, and the other one changes no file.

    Raises:
        CmpDesignError: the folder holds another plan, or other files; or a layout or an input was changed.
        OutputError: a file cannot be written.
    """
    path = folder / PLAN
    text = json.dumps(prepared.document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    others = path_exists(folder) and any(not _is_of_start(inner.name) for inner in folder.iterdir())
    if others and not path_exists(path):
        raise CmpDesignError(f"{folder}: is not empty and holds no plan.json; give a new folder")
    if path_exists(path) or not write_new_file(path, text):
        there = read_plan(folder)
        if there["digest"] != prepared.document["digest"]:
            raise CmpDesignError(
                f"{folder}: holds a data set of another plan (digest {there['digest'][:12]}, this one "
                f"{prepared.document['digest'][:12]}); give a new folder"
            )
    files: dict[str, str | bytes] = {
        name: content for name, content in prepared.files.items() if not path_exists(folder / name)
    }
    if read_text(path) != text:
        files[PLAN] = text  # of more frames, or with another description
    if files:
        write_folder(folder, files)
    check_named_files(folder, prepared.document)


def _is_of_start(name: str) -> bool:
    """Whether another process, which starts at the same time, may have made this before or with plan.json."""
    return name in (PLAN, "layouts", "inputs") or name.startswith(STAGE_PREFIX)


def read_plan(folder: Path) -> Mapping[str, Any]:
    """The object of plan.json.

    Raises:
        CmpDesignError: there is no plan, or its digest is not that of its content.
    """
    path = folder / PLAN
    if not path_exists(path):
        raise CmpDesignError(f"{folder}: holds no {PLAN}; give the folder of cmpdesign dataset or extract")
    return _parse_plan(read_text(path), str(path))


@lru_cache(maxsize=4)
def _parse_plan(text: str, name: str) -> Mapping[str, Any]:
    plan = parse_json(text, name)
    form = plan.get("format") if isinstance(plan, dict) else None
    if not isinstance(form, str) or form not in PLAN_KINDS or plan.get("version") != 1:
        raise InputError(f"{name} is no plan of this version; expected {FORMAT_FRAMES}, version 1")
    checked_record(plan, name, PLAN_KINDS[form])
    if plan_digest(plan) != plan["digest"]:
        raise InputError(f"{name} was changed: the digest is not that of the content; make a new data set")
    return dict(plan)


def shard_frames(plan: Mapping[str, Any], number: int) -> int:
    """Number of frames of a shard."""
    if plan["format"] == FORMAT_FRAMES:
        return int(plan["frames_a_shard"])
    for source in plan["sources"]:
        if number < len(source["ranges"]):
            return int(source["ranges"][number][1])
        number -= len(source["ranges"])
    raise InputError(f"shard {number} does not exist")


def shard_files(plan: Mapping[str, Any], number: int) -> set[str]:
    """The names of a shard's files in the folder."""
    name = shard_name(number)
    tables = {f"tables/{name}.parquet"}
    return tables | {f"images/{name}.tar"} if plan["format"] == FORMAT_FRAMES else tables


def shard_name(number: int) -> str:
    """The name of a shard's files, without ending."""
    return f"{number:0{MAX_DIGITS}d}"


def find_record(folder: Path, plan: Mapping[str, Any], number: int) -> ShardRecord | None:
    """The record of a finished shard; None if the shard is not done: without a record of this plan with its files.

    Args:
        folder: the data set.
        plan: the object of plan.json.
        number: of the shard.
    """
    path = folder / "shards" / f"{shard_name(number)}.json"
    try:
        record = parse_record(read_text(path), str(path), ShardRecord)
        sizes = {name: (folder / name).stat().st_size for name in shard_files(plan, number)}
    except (InputError, OSError):
        return None
    is_whole = sizes == {name: about.bytes for name, about in record.files.items()}
    return record if is_whole and record.shard == number and _is_of_plan(record, plan) else None


def _is_of_plan(record: ShardRecord, plan: Mapping[str, Any]) -> bool:
    return (
        record.digest == plan["digest"]
        and record.shard < number_of_shards(plan)
        and record.frames == shard_frames(plan, record.shard)
        and record.files.keys() == shard_files(plan, record.shard)
    )


@contextmanager
def unfinished_shard(folder: Path, number: int) -> Iterator[Stage]:
    """A place for the files of one shard until they are complete; files of a killed worker in this place are removed.

    Raises:
        OutputError: a file cannot be written; no file of the shard has its name.
    """
    parent = folder / UNFINISHED / shard_name(number)
    try:
        with Stage(parent) as stage:
            yield stage
    except OutputError:
        raise
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(
            f"{folder}: shard {number} cannot be written ({reason}); finished shards are kept, and the same command "
            "makes the other shards"
        ) from error
    finally:
        with suppress(OSError):
            parent.rmdir()


def commit_shard(folder: Path, stage: Stage, number: int, about: Mapping[str, Any]) -> ShardRecord:
    """Move the staged files of a shard to their names, and write its record last.

    Args:
        folder: the data set.
        stage: the place of the files; each has the name of its folder and ending, as in "images.tar".
        number: of the shard.
        about: further fields of the record: the plan's digest, and numbers of frames.

    Raises:
        OSError: the disk is full, for example.
    """
    files = {}
    for staged in sorted(stage.folder.iterdir()):
        path = folder / staged.stem / f"{shard_name(number)}{staged.suffix}"
        files[f"{staged.stem}/{path.name}"] = {"bytes": staged.stat().st_size, "sha256": file_digest(staged)}
        path.parent.mkdir(parents=True, exist_ok=True)
        stage.commit(staged, path)
    document = {"format": FORMAT_RECORD, "version": 1, "shard": number, **about, "files": files}
    record = checked_record(document, f"shard {number}", ShardRecord)
    staged = stage.folder / "shards.json"
    staged.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    (folder / "shards").mkdir(exist_ok=True)
    stage.commit(staged, folder / "shards" / f"{shard_name(number)}.json")
    return record


def file_digest(path: Path) -> str:
    """SHA-256 (hex) of a file.

    Raises:
        InputError: the file cannot be opened.
    """
    digest = hashlib.sha256()
    with open_file(path) as file:
        while block := file.read(BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def clear_unfinished(folder: Path, numbers: Iterable[int]) -> None:
    """Remove files of killed workers for some shards; files of running workers are kept."""
    for number in numbers:
        parent = folder / UNFINISHED / shard_name(number)
        if path_exists(parent):
            remove_abandoned_stages(parent)
            with suppress(OSError):
                parent.rmdir()
    with suppress(OSError):
        (folder / UNFINISHED).rmdir()


@dataclass(frozen=True)
class Progress:
    """The finished part of a data set.

    Attributes:
        shards, frames: numbers of finished shards and frames.
        of_shards: shards of the plan.
        redrawn: number of draws that could not be rendered and were drawn anew.
        bytes: size of the finished shards' files.
    """

    shards: int
    frames: int
    of_shards: int
    redrawn: int
    bytes: int


def recorded_shards(folder: Path, plan: Mapping[str, Any]) -> list[int]:
    """The numbers of the shards of a plan for which the folder holds a record, also a wrong one."""
    try:
        names = [_RECORD_NAME.fullmatch(path.name) for path in (folder / "shards").iterdir()]
    except OSError:
        return []
    count = number_of_shards(plan)
    return sorted(int(name[1]) for name in names if name and int(name[1]) < count)


def _find_records(folder: Path, plan: Mapping[str, Any]) -> list[ShardRecord]:
    found = (find_record(folder, plan, number) for number in recorded_shards(folder, plan))
    return [record for record in found if record is not None]


def finished_records(folder: Path) -> list[ShardRecord]:
    """The records of the finished shards of a data set, from its manifest where this is complete.

    Raises:
        CmpDesignError: the folder holds no plan.
    """
    plan = read_plan(folder)
    listed = _listed_records(folder, plan)
    in_order = [record.shard for record in listed] == list(range(len(listed)))
    is_complete = in_order and len(listed) == number_of_shards(plan)
    return listed if is_complete else _find_records(folder, plan)


def _listed_records(folder: Path, plan: Mapping[str, Any]) -> list[ShardRecord]:
    """The records in the manifest; none where the manifest cannot be read or contradicts the plan."""
    try:
        manifest = parse_record(read_text(folder / MANIFEST), MANIFEST, Manifest)
    except InputError:
        return []
    records = [shard.record(manifest.plan) for shard in manifest.shards]
    return records if all(_is_of_plan(record, plan) for record in records) else []


def write_manifest(folder: Path) -> Progress:
    """Write manifest.json with the records of all finished shards, in their order.

    Raises:
        CmpDesignError: the folder holds no plan.
        OutputError: the file cannot be written.
    """
    plan = read_plan(folder)
    count = number_of_shards(plan)
    records = _find_records(folder, plan)
    frames = sum(record.frames for record in records)
    head = {
        "format": FORMAT_MANIFEST,
        "version": 1,
        "plan": plan["digest"],
        "complete": len(records) == count,
        "frames": frames,
    }
    lines = ",\n".join(f"  {json.dumps(record.listed())}" for record in records)
    text = json.dumps(head, indent=1)[:-2] + f',\n "shards": [\n{lines}\n ]\n}}\n'
    write_file(folder / MANIFEST, text)
    sizes = [about.bytes for record in records for about in record.files.values()]
    redrawn = sum(record.redrawn or 0 for record in records)
    return Progress(len(records), frames, count, redrawn, sum(sizes))
