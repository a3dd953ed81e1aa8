"""Atomic writing of a video file, frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import OutputError

CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".mkv": "FFV1"}  # FFV1 is lossless


class VideoWriter:
    """Writes frames to ``<stem>.part<suffix>``; ``close`` completes and renames the file.

    Args:
        path: file with a suffix of ``CODECS``.
        fps: frames per second.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._part = path, path.with_name(f"{path.stem}.part{path.suffix}")
        self._fps, self._frames = fps, 0
        self._writer: Any = None

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Append a frame (H, W, 3) BGR of the size of the first frame.

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
        """Complete the video and check the number of frames, because OpenCV does not report a full disk.

        Raises:
            OutputError: frames are missing, or the file cannot be renamed.
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
        """Remove the unfinished file."""
        if self._writer is not None:
            self._writer.release()
            self._part.unlink(missing_ok=True)
