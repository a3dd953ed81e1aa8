"""The sink of .npz, .parquet and recordings: frames in chunks of some seconds, which are assembled at the end."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any

from cmpdesign.errors import OutputError, parameter
from cmpdesign.tracking.columns import FrameTable
from cmpdesign.tracking.recording.images import keep_images
from cmpdesign.tracking.sinks.assembly import assemble_table
from cmpdesign.tracking.sinks.chunk_files import find_chunks, save_chunk
from cmpdesign.tracking.sinks.unfinished import FLUSH_S, lock_folder, part_path, release_lock

CHUNK_FRAMES = 256


class ChunkSink:
    """Writes frames in chunks of some seconds, which are assembled at the end.

    Args:
        path: the file to write at the end.
        table: the frames' columns.
        with_images: keep the frames' images beside the chunks, for a recording.
    """

    def __init__(self, path: Path, table: FrameTable, with_images: bool = False) -> None:
        self._path, self._part, self._table = path, part_path(path), table
        self._with_images = with_images
        self._part.mkdir()
        self._lock = lock_folder(self._part)
        self._frames: list[Any] = []
        self._chunks, self._kept = 0, 0
        self._last = time.monotonic()

    def add(self, frame: Any, image: Any = None) -> None:
        if self._with_images:
            self._keep_images(frame.index, image)
        self._frames.append(frame)
        if len(self._frames) >= CHUNK_FRAMES or time.monotonic() - self._last > FLUSH_S:
            self._flush()

    def _keep_images(self, frame: int, image: Any) -> None:
        """Images are written before the chunk of their frame, so that every complete chunk has its images."""
        try:
            keep_images(self._part, frame, image)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def _flush(self) -> None:
        try:
            if self._frames:
                self._save_frames(self._frames)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        self._frames, self._last = [], time.monotonic()

    def _save_frames(self, frames: list[Any]) -> None:
        """Save frames as one chunk; if the chunk does not fit on the disk, as two halves."""
        try:
            path = self._part / f"{self._chunks:06d}.npz"
            save_chunk(path, self._table.batch(frames), self._table.about())
        except OSError:
            if len(frames) == 1:
                raise
            half = len(frames) // 2
            self._save_frames(frames[:half])
            self._save_frames(frames[half:])
            return
        self._chunks += 1
        self._kept += len(frames)

    def close(self) -> None:
        try:
            self._flush()
            found = find_chunks(self._part)
            if found.problems:
                raise OutputError(f"{self._path}: cannot be assembled ({'; '.join(found.problems)})")
            assemble_table(found.chunks, self._table.about(), self._path)
            shutil.rmtree(self._part)
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        finally:
            release_lock(self._lock)
            self._lock = None

    def kept(self) -> str:
        if not self._part.exists():
            return f"{self._kept} frames are kept in {self._path}"
        return f"{self._kept} frames are kept in {self._part}; free disk space, then call with {parameter('recover')}"
