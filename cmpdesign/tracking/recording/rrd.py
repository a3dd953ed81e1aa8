"""Frames in chunks, written as a file of Rerun."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from cmpdesign.files.atomic import staged_file
from cmpdesign.libraries import extra
from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.recording.frames import FrameReader, RecordedFrame
from cmpdesign.tracking.recording.images import kept_image
from cmpdesign.tracking.recording.rerun_rows import APPLICATION, RerunRows

IMAGES_AT_ONCE = 16  # number of frames that are in memory with their images


def write_rrd(chunks: Iterable[Columns], about: Columns, path: Path, images: Path) -> None:
    """Write a .rrd file; the file is complete on disk before it gets its name.

    The bytes differ from run to run: Rerun gives its rows identifiers with a time. The recording's identifier does not
    differ: the same run is the same recording to a viewer.

    Args:
        chunks: the columns of frames, chunk by chunk, of a ``RecordedTable``.
        about: the shared columns of a ``RecordedTable``.
        path: the file.
        images: folder of the kept images.

    Raises:
        OSError: the file cannot be written; an existing file is unchanged.
    """
    reader = FrameReader()
    frames = chain.from_iterable(
        reader.frames(columns, about, partial(kept_image, images)) for columns in chunks
    )
    with staged_file(path) as staged:
        _write_file(staged, frames, str(about["frame_id"]))


def _write_file(path: Path, frames: Iterable[RecordedFrame], frame_id: str) -> None:
    with extra("rerun", "write .mcap"):
        from rerun.chunk import LazyChunkStream

    groups = iter(_in_groups(frames))
    first = next(groups)
    stream = LazyChunkStream.from_iter(_chunks(chain([first], groups), frame_id))
    try:
        stream.write_rrd(path, application_id=APPLICATION, recording_id=_identifier(first, frame_id))
    except (RuntimeError, ValueError) as error:  # Rerun's, of a file that it cannot write
        raise OSError(0, f"Rerun reports: {error}") from None


def _chunks(groups: Iterable[Sequence[RecordedFrame]], frame_id: str) -> Iterator[Any]:
    with extra("rerun"):
        from rerun.chunk import Chunk

    rows = RerunRows(frame_id)
    for frames in groups:
        for one in rows.of(frames):
            yield Chunk.from_columns(one.entity, one.timelines, one.columns)


def _identifier(first: Iterable[RecordedFrame], frame_id: str) -> str:
    """The recording's identifier, by its first frames."""
    digest = hashlib.sha256(frame_id.encode())
    for frame in first:
        digest.update(frame.ns.to_bytes(8, "little") + frame.markers.tobytes())
    return digest.hexdigest()[:32]


def _in_groups(frames: Iterable[RecordedFrame]) -> Iterable[list[RecordedFrame]]:
    group: list[RecordedFrame] = []
    for frame in frames:
        group.append(frame)
        if len(group) >= IMAGES_AT_ONCE:
            yield group
            group = []
    if group:
        yield group
