"""Frames in chunks, written as a rosbag2 folder or as one MCAP file."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from cmpdesign.files.atomic import Stage
from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.recording.frames import FrameReader
from cmpdesign.tracking.recording.images import kept_image
from cmpdesign.tracking.recording.topics import TopicMessage, TopicMessages, require_rosbags

METADATA_VERSION = (
    8  # version of rosbag2's metadata; Iron and later read it, and a single .mcap file needs no metadata
)


def write_recording(chunks: Iterable[Columns], about: Columns, path: Path, images: Path) -> None:
    """Write a recording; the recording is complete on disk before it gets its name.

    Args:
        chunks: the columns of frames, chunk by chunk, of a ``RecordedTable``.
        about: the shared columns of a ``RecordedTable``.
        path: a name that ends in .mcap, for one file, or a name without ending, for a rosbag2 folder.
        images: folder of the kept images.

    Raises:
        OSError: the recording cannot be written, or a folder of this name exists; existing files are unchanged.
    """
    if path.is_dir():
        raise IsADirectoryError(21, "is a folder; delete it, or give another name")
    with Stage(path.parent) as stage:
        folder = stage.folder / path.stem
        _write_bag(folder, chunks, about, images)
        stage.commit(folder / f"{path.stem}.mcap" if path.suffix else folder, path)


def _write_bag(folder: Path, chunks: Iterable[Columns], about: Columns, images: Path) -> None:
    reader, messages = FrameReader(), TopicMessages(str(about["frame_id"]))
    with BagWriter(folder) as writer:
        for columns in chunks:
            for frame in reader.frames(columns, about, partial(kept_image, images)):
                writer.add(messages.of(frame), messages.store)


class BagWriter:
    """Writes messages into a rosbag2 folder with one file, ``NAME/NAME.mcap``; a topic begins with its first message.

    Args:
        folder: its name; it must not exist.
    """

    def __init__(self, folder: Path) -> None:
        bags = require_rosbags()
        plugins, compression = bags.rosbag2.StoragePlugin, bags.rosbag2
        self._writer = bags.rosbag2.Writer(folder, version=METADATA_VERSION, storage_plugin=plugins.MCAP)
        self._writer.set_compression(compression.CompressionMode.STORAGE, compression.CompressionFormat.ZSTD)
        self._connections: dict[str, Any] = {}

    def __enter__(self) -> Self:
        self._writer.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.__exit__(kind, error, trace)

    def add(self, messages: Iterable[TopicMessage], store: Any) -> None:
        """Write messages; ``store``: their types."""
        for one in messages:
            if one.topic not in self._connections:
                self._connections[one.topic] = self._writer.add_connection(
                    one.topic, one.kind, typestore=store
                )
            self._writer.write(self._connections[one.topic], one.ns, one.data)
