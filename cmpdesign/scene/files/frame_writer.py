"""Writers of a sequence's images: a video, or a lossless folder of PNG files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.atomic import Stage
from cmpdesign.files.video_writer import CODECS, VideoWriter
from cmpdesign.inputs.files import is_folder, path_exists

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
    """A folder of frame_000000.png and so on, written under a random name and renamed by ``close``."""

    def __init__(self, path: Path) -> None:
        if path_exists(path) and not (is_folder(path) and not any(path.iterdir())):
            raise OutputError(
                f"{path}: exists and is no empty folder; give another place or delete the folder"
            )
        self._path, self._frames = path, 0
        self._stage: Stage | None = None

    def add(self, picture: Image) -> None:
        """Append an image (H, W, 3) BGR.

        Raises:
            OutputError: the image cannot be written.
        """
        from cmpdesign.files.images import to_png

        with self._as_output_error():
            if self._stage is None:
                self._stage = Stage(self._path.parent)
                self._staged(self._stage).mkdir()
            file = self._staged(self._stage) / f"frame_{self._frames:06d}.png"
            file.write_bytes(to_png(picture))
        self._frames += 1

    def _staged(self, stage: Stage) -> Path:
        return stage.folder / "frames"

    def close(self) -> None:
        """Move the folder to its path.

        Raises:
            OutputError: the folder cannot be moved.
        """
        with self._as_output_error():
            if self._stage is not None:
                self._stage.commit(self._staged(self._stage), self._path)
        self.discard()

    def discard(self) -> None:
        """Delete all files that were written and are not at their path."""
        if self._stage is not None:
            self._stage.close()
            self._stage = None

    @contextmanager
    def _as_output_error(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.discard()
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
