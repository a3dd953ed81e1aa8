"""One shard of a data set: a pure function of the plan's digest and the shard's number."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from cmpdesign.data.files.tables import PREFIX, Row, frame_columns, frame_key, frame_row, write_table
from cmpdesign.data.files.webdataset import TarWriter
from cmpdesign.data.folder import commit_shard, find_record, read_plan, unfinished_shard
from cmpdesign.data.frames.frame import FrameMaker
from cmpdesign.data.records import FORMAT_EXTRACTION, ShardRecord
from cmpdesign.data.videos.extraction import EXTRACTED, range_rows

IMAGES, TABLES = "images.tar", "tables.parquet"


def make_shard(folder: str, number: int) -> ShardRecord:
    """Make one shard of the data set in a folder, unless the shard is finished.

    Args:
        folder: the data set; it holds its plan.
        number: of the shard, from 0.

    Returns:
        The shard's record.

    Raises:
        CmpDesignError: the plan cannot be read or carried out.
        OutputError: a file cannot be written; no file of the shard has its name.
    """
    path = Path(folder)
    plan = read_plan(path)
    done = find_record(path, plan, number)
    if done is not None:
        return done
    with unfinished_shard(path, number) as stage:
        write = _write_extraction if plan["format"] == FORMAT_EXTRACTION else _write_frames
        about = write(path, plan, number, stage.folder)
        return commit_shard(path, stage, number, {"digest": plan["digest"], **about})


def _write_frames(folder: Path, plan: Mapping[str, Any], number: int, staged: Path) -> dict[str, Any]:
    maker = _frame_maker(folder, plan["digest"])
    columns = frame_columns(plan)
    ending = {"jpeg": "jpg", "png": "png"}[plan["image"]["kind"]]
    rows, redrawn = [], 0
    with TarWriter(staged / IMAGES) as tar:
        for place in range(plan["frames_a_shard"]):
            frame = maker.frame(number, place)
            row = frame_row(frame, columns)
            tar.add(frame_key(frame.number), {ending: frame.image, "json": _label(row)})
            rows.append(row)
            redrawn += frame.redrawn
    write_table(staged / TABLES, rows, columns, {"plan": plan["digest"], "shard": str(number)})
    return {"frames": len(rows), "redrawn": redrawn}


@lru_cache(maxsize=2)
def _frame_maker(folder: Path, digest: str) -> FrameMaker:
    """The maker of a plan's frames, kept from shard to shard; the digest distinguishes plans in one folder."""
    return FrameMaker(folder, read_plan(folder))


def _label(row: Row) -> bytes:
    """The values beside a picture in the tar file: number, design, forces and drawn values."""
    names = [name for name in row if name in ("frame", "design", "force_n", "moment_nmm")]
    label = {name: row[name] for name in [*names, *(name for name in row if name.startswith(PREFIX))]}
    return json.dumps(label, ensure_ascii=False, allow_nan=False).encode()


def _write_extraction(folder: Path, plan: Mapping[str, Any], number: int, staged: Path) -> dict[str, Any]:
    rows = range_rows(folder, plan, number)
    write_table(staged / TABLES, rows, EXTRACTED, {"plan": plan["digest"], "shard": str(number)})
    return {"frames": len(rows)}
