"""Frames in chunks, written as a rosbag2 folder or as one MCAP file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cmpdesign.errors import InputError
from cmpdesign.files.atomic import Stage
from cmpdesign.files.image_header import size_in_header
from cmpdesign.libraries import extra
from cmpdesign.tracking.columns import FRAME_STATUS, Columns
from cmpdesign.tracking.recording.images import kept_image
from cmpdesign.tracking.recording.messages import (
    CAMERA,
    DIAGNOSTICS,
    ERROR,
    IMAGE,
    OK,
    POINTS,
    WARN,
    Lens,
    Messages,
    Stamp,
)
from cmpdesign.tracking.recording.options import QUALITY
from cmpdesign.tracking.recording.points import marker_records

NS_PER_S = 10**9
STEP_NS = NS_PER_S // 30  # from the frame before to a frame whose time the source does not know
METADATA_VERSION = 8  # of rosbag2; Iron and later read it, and files of one .mcap need none
_STATUS_NAMES = ("lost", "measured", "repaired", "fitted")


def require_rosbags() -> Any:
    """The module rosbags.

    Raises:
        MissingLibraryError: it is not installed.
    """
    with extra("recording", "write .npz or .csv"):
        import rosbags.rosbag2
        import rosbags.typesys
    return rosbags


def write_recording(chunks: Iterable[Columns], about: Columns, path: Path, images: Path) -> None:
    """Write a recording; it is complete on disk before it has its name.

    Args:
        chunks: the columns of frames, chunk by chunk, of a ``RecordedTable``.
        about: the shared columns of a ``RecordedTable``.
        path: a name that ends in .mcap, for one file, or a name without ending, for a rosbag2 folder.
        images: folder of the kept images.

    Raises:
        OSError: it cannot be written, or a folder of this name exists; what is at the place is unchanged.
    """
    if path.is_dir():
        raise IsADirectoryError(21, "is a folder; delete it, or give another name")
    with Stage(path.parent) as stage:
        folder = stage.folder / path.stem
        _write_bag(folder, chunks, about, images)
        stage.commit(folder / f"{path.stem}.mcap" if path.suffix else folder, path)


def _write_bag(folder: Path, chunks: Iterable[Columns], about: Columns, images: Path) -> None:
    bags = require_rosbags()
    plugins, compression = bags.rosbag2.StoragePlugin, bags.rosbag2
    writer = bags.rosbag2.Writer(folder, version=METADATA_VERSION, storage_plugin=plugins.MCAP)
    writer.set_compression(compression.CompressionMode.STORAGE, compression.CompressionFormat.ZSTD)
    with writer:
        frames = _FrameWriter(writer, about, images)
        for columns in chunks:
            frames.add(columns)


class _FrameWriter:
    """Writes the messages of frames; a topic begins with its first message."""

    def __init__(self, writer: Any, about: Columns, images: Path) -> None:
        stores = require_rosbags().typesys
        self._store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
        self._writer, self._about, self._images = writer, about, images
        self._messages = Messages(self._store.types)
        self._connections: dict[str, Any] = {}
        self._frame_id = str(about["frame_id"])
        self._views = [str(name) for name in about["view_names"]]
        self._last_ns = -STEP_NS

    def add(self, columns: Columns) -> None:
        """Write the frames of a chunk."""
        records = marker_records(columns, self._about)
        for place, frame in enumerate(columns["frame"].tolist()):
            ns = self._time_ns(float(columns["time_s"][place]))
            stamp = Stamp(ns, self._frame_id)
            row = {name: values[place] for name, values in columns.items()}
            self._write(
                f"/{self._frame_id}/markers", POINTS, self._messages.points(stamp, records[place]), ns
            )
            level, text = _judge(row)
            values = _diagnostic_values(row, records["status"][place], self._views)
            message = self._messages.diagnostics(stamp, level, text, values)
            self._write("/diagnostics", DIAGNOSTICS, message, ns)
            self._write_images(frame, ns)

    def _time_ns(self, time_s: float) -> int:
        """A frame's time; of a frame without one, some time after the frame before."""
        known = np.isfinite(time_s)
        self._last_ns = max(0, round(time_s * NS_PER_S)) if known else self._last_ns + STEP_NS
        return self._last_ns

    def _write_images(self, frame: int, ns: int) -> None:
        """Write the frame's images, and beside each what is known of the cameras of its views."""
        for view in (None, *range(len(self._views))):
            png = kept_image(self._images, frame, view)
            if png is None:
                continue
            camera = "" if view is None else f"/{_topic_name(self._views[view])}"
            base = f"/{self._frame_id}{camera}"
            stamp = Stamp(ns, f"{base[1:].replace('/', '_')}_camera")
            image = self._messages.image(stamp, png)
            self._write(f"{base}/image_raw/compressed", IMAGE, image, ns)
            for topic, lens in self._lenses(view, base):
                message = self._messages.camera(stamp, _size_px(png), lens)
                self._write(f"{topic}/camera_info", CAMERA, message, ns)

    def _lenses(self, view: int | None, base: str) -> Iterator[tuple[str, Lens]]:
        """The first part of the topic and the intrinsics, of each view that an image shows."""
        if not self._views:
            yield base, Lens()
        for k in range(len(self._views)) if view is None else [view]:
            lens = Lens(*(self._about[f"view_{name}"][k].tolist() for name in Lens._fields))
            is_one_of_many = view is None and len(self._views) > 1
            yield (f"{base}/{_topic_name(self._views[k])}" if is_one_of_many else base), lens

    def _write(self, topic: str, kind: str, message: Any, ns: int) -> None:
        if topic not in self._connections:
            connection = self._writer.add_connection(topic, kind, typestore=self._store)
            self._connections[topic] = connection
        data = self._store.serialize_cdr(message, kind)
        self._writer.write(self._connections[topic], ns, data)


def _size_px(png: bytes) -> tuple[int, int]:
    size = size_in_header(png)
    if size is None:
        raise InputError("a kept image has no size")
    return size[0], size[1]


def _topic_name(view: str) -> str:
    """A view's name as a part of a topic."""
    name = re.sub(r"\W", "_", view, flags=re.ASCII)
    return name if name[:1].isalpha() else f"view_{name}"


def _judge(row: dict[str, Any]) -> tuple[int, str]:
    """Level and text of a frame: an error where it is not tracked, a warning where something limits it."""
    status, reason, hints = FRAME_STATUS[row["frame_status"]], str(row["reason"]), str(row["hints"])
    notes = "; ".join(note for note in (reason, hints) if note)
    level = ERROR if status != "tracked" else WARN if notes else OK
    return level, f"{status}: {notes}" if notes else status


def _diagnostic_values(row: dict[str, Any], statuses: Any, views: list[str]) -> dict[str, str]:
    """What a DiagnosticStatus lists of a frame; numbers as text, "nan" where unknown."""
    counts = np.bincount(statuses, minlength=len(_STATUS_NAMES)).tolist()
    values = {
        "frame": str(row["frame"]),
        "frame_status": FRAME_STATUS[row["frame_status"]],
        "reason": str(row["reason"]),
        "elapsed_ms": f"{row['elapsed_ms']:.3f}",
    }
    if "start" in row:
        values["start"] = str(row["start"])
    values |= {f"markers_{name}": str(count) for name, count in zip(_STATUS_NAMES, counts, strict=True)}
    for name, numbers in zip(views or [""], row["quality"], strict=True):
        before = f"{name}." if len(views) > 1 else ""
        values |= {f"{before}{key}": f"{v:.6g}" for key, v in zip(QUALITY, numbers.tolist(), strict=True)}
    return values
