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
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from cmpdesign.errors import CmpDesignError, InputError, OutputError
from cmpdesign.files.atomic import (
    STAGE_PREFIX,
    Stage,
    remove_abandoned_stages,
    write_file,
    write_folder,
)
from cmpdesign.inputs.documents import parse_json, read_json
from cmpdesign.inputs.files import open_file, path_exists, read_text

FORMAT_FRAMES, FORMAT_EXTRACTION = "cmp-dataset-plan", "cmp-extraction-plan"
FORMAT_RECORD, FORMAT_MANIFEST = "cmp-dataset-shard", "cmp-dataset"
PLAN, MANIFEST, UNFINISHED = "plan.json", "manifest.json", "unfinished"
# Keys on which no frame depends.
OUTSIDE_DIGEST = ("digest", "frames", "name", "description")
BLOCK_BYTES = 1 << 20
MOST_DIGITS = 6  # of a shard's number
Record = Mapping[str, Any]


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
    """Make the folder with its plan, or check that the folder has the same plan.

    Raises:
        CmpDesignError: the folder holds another plan, or other files.
        OutputError: a file cannot be written.
    """
    if path_exists(folder / PLAN):
        there = read_plan(folder)
        if there["digest"] != prepared.document["digest"]:
            raise CmpDesignError(
                f"{folder}: holds a data set of another plan (digest {there['digest'][:12]}, this one "
                f"{prepared.document['digest'][:12]}); give a new folder"
            )
    elif path_exists(folder) and any(not _is_of_start(path.name) for path in folder.iterdir()):
        raise CmpDesignError(f"{folder}: is not empty and holds no plan.json; give a new folder")
    text = json.dumps(prepared.document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    files: dict[str, str | bytes] = {
        name: content for name, content in prepared.files.items() if not path_exists(folder / name)
    }
    if not path_exists(folder / PLAN) or read_text(folder / PLAN) != text:
        files[PLAN] = text  # renamed last
    if files:
        write_folder(folder, files)


def _is_of_start(name: str) -> bool:
    """Whether another process, which starts at the same time, may have made this before plan.json."""
    return name in ("layouts", "inputs") or name.startswith(STAGE_PREFIX)


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
    known = isinstance(plan, dict) and plan.get("format") in (FORMAT_FRAMES, FORMAT_EXTRACTION)
    if not known or plan.get("version") != 1:
        raise InputError(f"{name} is no plan of this version; expected {FORMAT_FRAMES}, version 1")
    if plan_digest(plan) != plan.get("digest"):
        raise InputError(f"{name} was changed: the digest is not that of the content; make a new data set")
    return dict(plan)


def shard_name(number: int) -> str:
    """The name of a shard's files, without ending."""
    return f"{number:0{MOST_DIGITS}d}"


def find_record(folder: Path, digest: str, number: int) -> Record | None:
    """The record of a finished shard; None if the shard is not done.

    Args:
        folder: the data set.
        digest: of its plan.
        number: of the shard.
    """
    path = folder / "shards" / f"{shard_name(number)}.json"
    try:
        record = read_json(path)
        sizes = {name: int(about["bytes"]) for name, about in record["files"].items()}
        of_this_plan = record["format"] == FORMAT_RECORD and record["digest"] == digest
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return None
    try:
        complete = all((folder / name).stat().st_size == size for name, size in sizes.items())
    except OSError:
        return None
    return dict(record) if of_this_plan and complete else None


@contextmanager
def unfinished_shard(folder: Path, number: int) -> Iterator[Stage]:
    """A place for the files of one shard until they are complete; files of a killed worker in this place are removed.

    Raises:
        OutputError: a file cannot be written; no file of the shard has its name.
    """
    parent = folder / UNFINISHED / shard_name(number)
    try:
        parent.mkdir(parents=True, exist_ok=True)
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


def commit_shard(folder: Path, stage: Stage, number: int, about: Record) -> Record:
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
    record = {"format": FORMAT_RECORD, "version": 1, "shard": number, **about, "files": files}
    staged = stage.folder / "shards.json"
    staged.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
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


def _find_records(folder: Path, plan: Mapping[str, Any]) -> Iterator[Record]:
    for number in range(number_of_shards(plan)):
        record = find_record(folder, plan["digest"], number)
        if record is not None:
            yield record


def finished_records(folder: Path) -> list[Record]:
    """The records of the finished shards of a data set, from its manifest where this is complete.

    Raises:
        CmpDesignError: the folder holds no plan.
    """
    plan = read_plan(folder)
    listed = _listed_records(folder, plan["digest"])
    numbers = [record["shard"] for record in listed]
    return listed if numbers == list(range(number_of_shards(plan))) else list(_find_records(folder, plan))


def _listed_records(folder: Path, digest: str) -> list[Record]:
    """The records in the manifest; none where the manifest cannot be read or belongs to another plan."""
    try:
        manifest = read_json(folder / MANIFEST)
        if manifest["plan"] != digest:
            return []
        return [
            {**record, "shard": int(record["shard"]), "frames": int(record["frames"])}
            for record in manifest["shards"]
        ]
    except (InputError, KeyError, TypeError, ValueError):
        return []


def write_manifest(folder: Path) -> Progress:
    """Write manifest.json with the records of all finished shards, in their order.

    Raises:
        CmpDesignError: the folder holds no plan.
        OutputError: the file cannot be written.
    """
    plan = read_plan(folder)
    count = number_of_shards(plan)
    records = list(_find_records(folder, plan))
    shards = [
        {key: value for key, value in record.items() if key not in ("format", "version", "digest")}
        for record in records
    ]
    frames = sum(record["frames"] for record in records)
    head = {
        "format": FORMAT_MANIFEST,
        "version": 1,
        "plan": plan["digest"],
        "complete": len(records) == count,
        "frames": frames,
    }
    lines = ",\n".join(f"  {json.dumps(shard)}" for shard in shards)
    text = json.dumps(head, indent=1)[:-2] + f',\n "shards": [\n{lines}\n ]\n}}\n'
    write_file(folder / MANIFEST, text)
    sizes = [about["bytes"] for record in records for about in record["files"].values()]
    redrawn = sum(record.get("redrawn", 0) for record in records)
    return Progress(len(records), frames, count, redrawn, sum(sizes))
