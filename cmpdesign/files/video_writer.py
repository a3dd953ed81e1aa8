"""Atomic writing of a video file, frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import OutputError
from cmpdesign.files.atomic import Stage

CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".mkv": "FFV1"}  # FFV1 is lossless


class VideoWriter:
    """Writes frames to a file of a random name; ``close`` completes and renames the file.

    Args:
        path: file with a suffix of ``CODECS``.
        fps: frames per second.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps, self._frames = path, fps, 0
        self._stage: Stage | None = None
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
            self._stage = Stage(self._path.parent)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        codec = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix])
        self._writer = cv2.VideoWriter(str(self._staged(self._stage)), codec, self._fps, size)
        if not self._writer.isOpened():
            self.discard()
            raise OutputError(f"{self._path}: cannot be written as a video")

    def _staged(self, stage: Stage) -> Path:
        return stage.folder / f"video{self._path.suffix}"

    def close(self) -> None:
        """Complete the video and check the number of frames, because OpenCV does not report a full disk.

        Raises:
            OutputError: frames are missing, or the file cannot be renamed.
        """
        if self._stage is None:
            return
        self._writer.release()
        staged, frames = self._staged(self._stage), 0
        try:
            frames = count_frames(staged)
            if frames >= self._frames:
                self._stage.commit(staged, self._path)
                return
            kept = self._path.with_name(f"{self._path.stem}.incomplete{self._path.suffix}")
            staged.replace(kept)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        finally:
            self.discard()
        raise OutputError(
            f"{self._path}: {frames} of {self._frames} frames could be written; is the disk full? "
            f"the written frames are kept in {kept}"
        )

    def discard(self) -> None:
        """Remove the unfinished file."""
        if self._stage is not None:
            self._writer.release()
            self._stage.close()
            self._stage = None


def count_frames(path: Path) -> int:
    """The number of frames that a video file declares; 0 for a file that is no video."""
    import cv2

    video = cv2.VideoCapture(str(path))
    frames = int(video.get(cv2.CAP_PROP_FRAME_COUNT)) if video.isOpened() else 0
    video.release()
    return frames
