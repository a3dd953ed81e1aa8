"""Frames into a video file, which appears whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import OutputError

CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".mkv": "FFV1"}  # FFV1 is lossless


class VideoWriter:
    """Writes beside the file's place; ``close`` completes it.

    Args:
        path: its ending is one of ``CODECS``.
        fps: frames a second.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._part = path, path.with_name(f"{path.stem}.part{path.suffix}")
        self._fps, self._frames = fps, 0
        self._writer: Any = None

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Append a frame (H, W, 3) BGR, as large as the first one.

        Raises:
            OutputError: the video cannot be written.
        """
        if self._writer is None:
            self._open((picture.shape[1], picture.shape[0]))
        self._writer.write(picture)
        self._frames += 1

    def _open(self, size: tuple[int, int]) -> None:
        import cv2

        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        codec = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix])
        self._writer = cv2.VideoWriter(str(self._part), codec, self._fps, size)
        if not self._writer.isOpened():
            raise OutputError(f"{self._path}: cannot be written as a video")

    def close(self) -> None:
        """Complete the video and look whether it can be read: OpenCV reports no full disk.

        Raises:
            OutputError: it is not complete, or cannot take its place.
        """
        import cv2

        if self._writer is None:
            return
        self._writer.release()
        written = cv2.VideoCapture(str(self._part))
        frames = int(written.get(cv2.CAP_PROP_FRAME_COUNT)) if written.isOpened() else 0
        written.release()
        if frames < self._frames:
            raise OutputError(
                f"{self._path}: holds {frames} of {self._frames} frames; is the disk full? It is kept as {self._part}"
            )
        try:
            self._part.replace(self._path)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def discard(self) -> None:
        """Leave nothing behind."""
        if self._writer is not None:
            self._writer.release()
            self._part.unlink(missing_ok=True)
