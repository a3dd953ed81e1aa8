"""A sink opened for the suffix of a file, and the table of a killed run completed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from cmpdesign.errors import CmpDesignError, OutputError, parameter
from cmpdesign.files.atomic import remove_abandoned_stages
from cmpdesign.files.locks import is_in_use
from cmpdesign.inputs.files import is_folder, is_regular_file, open_file
from cmpdesign.tracking.columns import FrameTable
from cmpdesign.tracking.recording.options import RecordedTable, Recording, is_recording
from cmpdesign.tracking.sinks.assembly import assemble_table
from cmpdesign.tracking.sinks.chunk_files import Chunk, find_chunks
from cmpdesign.tracking.sinks.chunk_sink import ChunkSink
from cmpdesign.tracking.sinks.csv_recovery import recover_csv
from cmpdesign.tracking.sinks.csv_sink import CsvSink
from cmpdesign.tracking.sinks.unfinished import Recovered, part_path, require_pyarrow

KINDS = (".npz", ".parquet", ".csv", ".mcap", ".rrd")


class FrameSink(Protocol):
    """A table that is written frame by frame.

    ``add`` takes a tracked frame and its image; only a recording that was opened for images keeps these. ``add`` and
    ``close`` raise ``OutputError``. ``kept`` states the number of written frames and their file.
    """

    def add(self, frame: Any, image: Any = None) -> None: ...

    def close(self) -> None: ...

    def kept(self) -> str: ...


def open_sink(path: Path, table: FrameTable, recording: Recording | None = None) -> FrameSink:
    """Open the sink for the suffix of a file. Unfinished files of a killed run without a frame are removed.

    Args:
        path: a file's name with an ending of ``KINDS``; or a name without ending, for a rosbag2 folder.
        table: the frames' columns.
        recording: the options of a recording.

    Raises:
        CmpDesignError: another suffix, Parquet or a recording without its library, images for a table, or frames of
            an interrupted or another run exist.
        OutputError: the file cannot be written.
    """
    recording = recording or Recording()
    _require_kind(path)
    if recording.with_images and not is_recording(path):
        raise CmpDesignError(
            f"{parameter('with_images')}: {path} is a table and holds no images; "
            "give a name that ends in .mcap or .rrd, or without ending"
        )
    part = part_path(path)
    if is_folder(path):
        raise OutputError(f"{path} is a folder; give a file's name, or that of a new folder")
    if os.path.lexists(part):
        _require_not_in_use(part, path)
        if _holds_frames(part):
            raise CmpDesignError(
                f"{part} holds the frames of an interrupted run; call with {parameter('recover')}, or delete it"
            )
    try:
        _remove(part)
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".csv":
            return CsvSink(path, table)
        recorded = RecordedTable(table, recording) if is_recording(path) else table
        return ChunkSink(path, recorded, recording.with_images)
    except (OSError, ValueError) as error:  # ValueError: a NUL, or characters that no path can hold
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{path}: cannot be written ({reason})") from None


def recover_table(path: Path, rows_per_frame: int) -> Recovered:
    """Complete the file of an interrupted run from its chunks or its text; damaged parts are left out.

    Args:
        path: the table.
        rows_per_frame: number of rows of a frame in the long form.

    Raises:
        CmpDesignError: no interrupted run, a run that still writes, or no complete frame.
        OutputError: the file cannot be written; the chunks or the text are kept.
    """
    _require_kind(path)
    part = part_path(path)
    if not os.path.lexists(part):
        raise CmpDesignError(f"{part}: there is no table to recover")
    _require_not_in_use(part, path)
    try:
        recovered = (
            recover_csv(part, path, rows_per_frame) if path.suffix == ".csv" else _recover_chunks(part, path)
        )
        remove_abandoned_stages(path.parent)
        if not recovered.frames and recovered.problems:
            first, *others = recovered.problems
            more = f"; and {len(others)} more" if others else ""
            raise CmpDesignError(f"{part} holds no complete frame ({first}{more}); it is kept")
        _remove(part)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error}); {part} is kept") from None
    return recovered


def _recover_chunks(part: Path, path: Path) -> Recovered:
    found = find_chunks(part)
    if found.about is None:
        return Recovered(0, found.problems)
    problems = (*found.problems, *_lost_images(part, found.chunks))
    return Recovered(assemble_table(found.chunks, found.about, path), problems)


def _lost_images(part: Path, chunks: Sequence[Chunk]) -> Iterator[str]:
    """One sentence where a part of the frames has no image: images are written after the chunk of their frames."""
    with_image = {image.name.partition(".")[0] for image in part.glob("[0-9]*.png")}
    frames = [f"{number:09d}" for chunk in chunks for number in chunk.frames.tolist()]
    without = sum(frame not in with_image for frame in frames)
    if with_image and without:
        yield f"{without} of {len(frames)} frames have no image"


def _require_kind(path: Path) -> None:
    if not path.name:
        raise CmpDesignError(f"{path} is a folder; give a file's name, or that of a new folder")
    if path.suffix not in (*KINDS, ""):
        raise CmpDesignError(
            f"{path}: unknown ending; expected one of {', '.join(KINDS)}, or none for a rosbag2 folder"
        )
    if path.suffix == ".parquet":
        require_pyarrow()
    if path.suffix == ".rrd":
        from cmpdesign.tracking.recording.rerun_rows import require_rerun

        require_rerun()
    elif is_recording(path):
        from cmpdesign.tracking.recording.topics import require_rosbags

        require_rosbags()


def _require_not_in_use(part: Path, path: Path) -> None:
    """Check that the unfinished table was made by this program, and that no run writes it."""
    if part.is_symlink() or not (is_regular_file if path.suffix == ".csv" else is_folder)(part):
        kind = "text" if path.suffix == ".csv" else "folder"
        raise CmpDesignError(
            f"{part} is not the {kind} of an interrupted run; delete it, or give another name"
        )
    if is_in_use(part):
        raise CmpDesignError(f"{part} is in use by another run; wait until it ends, or give another name")


def _holds_frames(part: Path) -> bool:
    if is_folder(part):
        return any(part.glob("[0-9]*.npz"))
    with open_file(part) as file:
        file.readline()
        return bool(file.readline())


def _remove(part: Path) -> None:
    """Remove an unfinished table, if there is one."""
    if is_folder(part):
        shutil.rmtree(part)
    else:
        part.unlink(missing_ok=True)
