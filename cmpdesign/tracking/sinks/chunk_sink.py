"""The sink of .npz, .parquet and recordings: frames in chunks of some seconds, which are assembled at the end."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any, NamedTuple

from cmpdesign.errors import OutputError, parameter
from cmpdesign.tracking.columns import FrameTable
from cmpdesign.tracking.recording.images import keep_images
from cmpdesign.tracking.sinks.assembly import assemble_table
from cmpdesign.tracking.sinks.chunk_files import find_chunks, save_chunk
from cmpdesign.tracking.sinks.unfinished import FLUSH_S, lock_folder, part_path, release_lock

CHUNK_FRAMES = 256
CHUNK_IMAGE_BYTES = 64 << 20  # of images that wait for their chunk


class _WaitingImage(NamedTuple):
    """The image of a frame, or its list of images, until the frame's chunk is on disk."""

    frame: int
    image: Any

    @property
    def size(self) -> int:
        """Bytes."""
        images = self.image if isinstance(self.image, list) else [self.image]
        return sum(0 if image is None else int(image.nbytes) for image in images)


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
        self._images: list[_WaitingImage] = []  # a chunk's images are written after the chunk
        self._failure = ""
        self._chunks, self._kept = 0, 0
        self._last = time.monotonic()

    def add(self, frame: Any, image: Any = None) -> None:
        self._frames.append(frame)
        if self._with_images:
            self._images.append(_WaitingImage(frame.index, image))
        waiting = sum(one.size for one in self._images)
        is_late = time.monotonic() - self._last > FLUSH_S
        if len(self._frames) >= CHUNK_FRAMES or waiting > CHUNK_IMAGE_BYTES or is_late:
            self._flush()

    def _flush(self) -> None:
        """Write the waiting frames as a chunk, then their images: what is on disk always has its frames."""
        try:
            if self._frames:
                self._save_frames(self._frames)
            self._frames, images, self._images = [], self._images, []
            for one in images:
                keep_images(self._part, one.frame, one.image)
        except OSError as error:
            self._failure = f"{self._path}: cannot be written ({error.strerror or error})"
            raise OutputError(self._failure) from None
        self._last = time.monotonic()

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
            if self._failure:
                raise OutputError(self._failure)
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
        if not self._kept:
            return f"no frame is kept; free disk space, then call again, which removes {self._part}"
        return f"{self._kept} frames are kept in {self._part}; free disk space, then call with {parameter('recover')}"
