"""Frames in chunks, written as a file of Rerun."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from cmpdesign.files.atomic import staged_file
from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.recording.frames import FrameReader, RecordedFrame
from cmpdesign.tracking.recording.images import kept_image
from cmpdesign.tracking.recording.rerun_log import APPLICATION, RerunLog, require_rerun

IMAGES_AT_ONCE = 16  # frames that are in memory together with their images


def write_rrd(chunks: Iterable[Columns], about: Columns, path: Path, images: Path) -> None:
    """Write a .rrd file; it is complete on disk before it has its name.

    Its bytes differ from run to run: Rerun gives its rows identifiers with a time. Its identifier does not: the same
    run is the same recording to a viewer.

    Args:
        chunks: the columns of frames, chunk by chunk, of a ``RecordedTable``.
        about: the shared columns of a ``RecordedTable``.
        path: the file.
        images: folder of the kept images.

    Raises:
        OSError: it cannot be written; what is at the place is unchanged.
    """
    reader = FrameReader()
    frames = chain.from_iterable(
        reader.frames(columns, about, partial(kept_image, images)) for columns in chunks
    )
    with staged_file(path) as staged:
        _write_file(staged, frames, str(about["frame_id"]))


def _write_file(path: Path, frames: Iterable[RecordedFrame], frame_id: str) -> None:
    stream, log = None, None
    try:
        for some in _in_groups(frames):
            if stream is None or log is None:
                stream = _open_stream(path, some, frame_id)
                log = RerunLog(stream, frame_id)
            log.add(some)
        if stream is not None:
            stream.flush()
    except RuntimeError as error:  # Rerun's, of a thread that writes
        raise OSError(0, f"it does not fit on the disk, or the disk fails; Rerun says: {error}") from None
    finally:
        if stream is not None:
            stream.disconnect()
    _require_whole(path)


def _open_stream(path: Path, first: Iterable[RecordedFrame], frame_id: str) -> Any:
    """A stream into a file, with an identifier that depends on the first frames alone."""
    digest = hashlib.sha256(frame_id.encode())
    for frame in first:
        digest.update(frame.ns.to_bytes(8, "little") + frame.markers.tobytes())
    stream = require_rerun().RecordingStream(
        APPLICATION, recording_id=digest.hexdigest()[:32], send_properties=False
    )
    stream.save(path)
    return stream


def _require_whole(path: Path) -> None:
    """Check that the file has its end: Rerun reports no failure of its last write."""
    from rerun.chunk import RrdReader

    try:
        RrdReader(path).store()
    except (RuntimeError, ValueError) as error:
        raise OSError(0, f"its end is missing; does it fit on the disk? Rerun says: {error}") from None


def _in_groups(frames: Iterable[RecordedFrame]) -> Iterable[list[RecordedFrame]]:
    group: list[RecordedFrame] = []
    for frame in frames:
        group.append(frame)
        if len(group) >= IMAGES_AT_ONCE:
            yield group
            group = []
    if group:
        yield group
