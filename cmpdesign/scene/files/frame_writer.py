"""Writers of a sequence's images: a video, or a lossless folder of PNG files."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.video_writer import CODECS, VideoWriter

Image = NDArray[np.uint8] | NDArray[np.uint16]


class FrameWriter(Protocol):
    """Takes images one after the other; ``close`` moves the result to its path."""

    def add(self, picture: Any) -> None: ...

    def close(self) -> None: ...

    def discard(self) -> None: ...


def open_frame_writer(path: Path, fps: float, size: tuple[int, int], bits: int) -> FrameWriter:
    """The writer for a path: a video by its suffix, a folder without suffix.

    Args:
        path: a path with the suffix .mp4, .avi or .mkv, or without suffix.
        fps: frames per second.
        size: width and height of the images, px.
        bits: 8 or 16.

    Raises:
        CmpDesignError: another suffix, or a video of this kind cannot hold the images.
        OutputError: the folder is not empty.
    """
    if not path.suffix:
        return PngFolderWriter(path)
    if path.suffix not in CODECS:
        raise CmpDesignError(
            f"{path}: unknown ending for a sequence; expected {', '.join(CODECS)}, or none for a folder of PNG files"
        )
    if bits != 8:
        raise CmpDesignError(f"{path}: a video has 8 bits, the sensor {bits}; give a folder (no ending)")
    if path.suffix == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise CmpDesignError(
            f"{path}: an .mp4 has even sides, the picture {size[0]} x {size[1]} px; write .mkv or a folder"
        )
    return VideoWriter(path, fps)


class PngFolderWriter:
    """A folder of frame_000000.png and so on, written under another name and renamed by ``close``."""

    def __init__(self, path: Path) -> None:
        if path.exists() and not (path.is_dir() and not any(path.iterdir())):
            raise OutputError(f"{path}: exists and is no empty folder; give another place or delete it")
        self._path, self._part, self._frames = path, path.with_name(path.name + ".part"), 0

    def add(self, picture: Image) -> None:
        """Append an image (H, W, 3) BGR.

        Raises:
            OutputError: the image cannot be written.
        """
        from cmpdesign.files.images import to_png

        try:
            if not self._frames:
                shutil.rmtree(self._part, ignore_errors=True)
                self._part.mkdir(parents=True)
            (self._part / f"frame_{self._frames:06d}.png").write_bytes(to_png(picture))
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        self._frames += 1

    def close(self) -> None:
        """Move the folder to its path.

        Raises:
            OutputError: the folder cannot be moved.
        """
        try:
            self._part.replace(self._path)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def discard(self) -> None:
        """Delete all that was written."""
        shutil.rmtree(self._part, ignore_errors=True)
