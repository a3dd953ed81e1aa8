"""Where the pictures of a sequence go: a video, or a folder of PNG files, which loses nothing."""

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
    """Takes pictures one after the other; only ``close`` puts them in their place."""

    def add(self, picture: Any) -> None: ...

    def close(self) -> None: ...

    def discard(self) -> None: ...


def open_frame_writer(path: Path, fps: float, size: tuple[int, int], bits: int) -> FrameWriter:
    """The film for a path: a video by its ending, a folder where it has none.

    Args:
        path: ends in .mp4, .avi or .mkv, or in nothing.
        fps: frames a second.
        size: width and height of the pictures, px.
        bits: 8 or 16.

    Raises:
        CmpDesignError: another ending, or pictures that a video of this kind cannot hold.
        OutputError: the folder holds something already.
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
    """frame_000000.png and so on; written beside, then renamed."""

    def __init__(self, path: Path) -> None:
        if path.exists() and not (path.is_dir() and not any(path.iterdir())):
            raise OutputError(f"{path}: exists and is no empty folder; give another place or delete it")
        self._path, self._part, self._frames = path, path.with_name(path.name + ".part"), 0

    def add(self, picture: Image) -> None:
        """Append a picture (H, W, 3) BGR.

        Raises:
            OutputError: it cannot be written.
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
        """Put the folder in its place.

        Raises:
            OutputError: it cannot take its place.
        """
        try:
            self._part.replace(self._path)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def discard(self) -> None:
        """Leave nothing behind."""
        shutil.rmtree(self._part, ignore_errors=True)
