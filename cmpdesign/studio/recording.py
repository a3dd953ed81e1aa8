"""Recording of live frames into the tables and recordings of ``track``."""

from __future__ import annotations

import secrets
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import read_file

if TYPE_CHECKING:
    from cmpdesign.tracking.columns import FrameTable
    from cmpdesign.tracking.sinks.tables import FrameSink

KINDS = ("npz", "csv", "parquet", "mcap")
MAX_ROWS = 10_000_000  # frames x markers of one recording, about 700 MB before it is compressed
MAX_KEPT = 3


@dataclass(eq=False)
class Recordings:
    """The last recordings of this run of the page, in private folders."""

    _files: dict[str, Path] = field(default_factory=dict)

    def add(self, path: Path) -> str:
        """Keep a file, whose folder is its own; the oldest is removed."""
        key = secrets.token_hex(8)
        self._files[key] = path
        for old in list(self._files)[:-MAX_KEPT]:
            shutil.rmtree(self._files.pop(old).parent, ignore_errors=True)
        return key

    def read(self, key: str) -> tuple[str, bytes]:
        """Name and bytes of a recording.

        Raises:
            CmpDesignError: no such recording.
        """
        if key not in self._files:
            raise CmpDesignError("this recording is gone; record again")
        return self._files[key].name, read_file(self._files[key])

    def close(self) -> None:
        """Remove all files."""
        for path in self._files.values():
            shutil.rmtree(path.parent, ignore_errors=True)


class Recorder:
    """A sink of tracked frames that writes from ``start`` to ``save``, and else nothing.

    Args:
        table: makes the table of the frames when a recording starts.
    """

    def __init__(self, table: Callable[[], FrameTable]) -> None:
        self._table, self._lock = table, Lock()
        self._sink: FrameSink | None = None
        self._path, self._frames = Path(), 0

    def start(self, kind: str) -> None:
        """Begin a recording; frames of one that was not saved are forgotten.

        Raises:
            CmpDesignError: an unknown kind, or a library is missing.
        """
        from cmpdesign.tracking.sinks.tables import open_sink

        if kind not in KINDS:
            raise CmpDesignError(f"{kind[:20]}: expected one of {', '.join(KINDS)}")
        self.close()
        path = Path(tempfile.mkdtemp(prefix="cmpdesign-studio-")) / f"run.{kind}"
        with self._lock:
            self._path, self._frames = path, 0
            self._sink = open_sink(path, self._table())

    def add(self, frame: Any, image: Any = None) -> None:
        """Take a frame, if a recording runs; it ends by itself at ``MAX_ROWS``."""
        with self._lock:
            if self._sink is not None and self._frames * len(frame.markers.status) < MAX_ROWS:
                self._sink.add(frame)
                self._frames += 1

    def save(self, recordings: Recordings) -> dict[str, Any]:
        """End the recording and keep its file.

        Raises:
            CmpDesignError: no frame was recorded.
        """
        with self._lock:
            sink, self._sink = self._sink, None
        if sink is None or not self._frames:
            self._remove()
            raise CmpDesignError("no frame was recorded; wait until markers are shown")
        sink.close()
        return {"saved": recordings.add(self._path), "frames": self._frames, "name": self._path.name}

    def close(self) -> None:
        """Forget a recording that was not saved."""
        with self._lock:
            sink, self._sink = self._sink, None
        if sink is not None:
            sink.close()
            self._remove()

    def kept(self) -> str:
        """The words of a sink on its file."""
        return f"{self._frames} frames are recorded"

    def _remove(self) -> None:
        if self._path.parent != Path():
            shutil.rmtree(self._path.parent, ignore_errors=True)
