"""Video files written by PyAV, and the parameters of their codecs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra


@dataclass(frozen=True)
class Codec:
    """A way to compress frames.

    Attributes:
        encoder: FFmpeg's name of the encoder.
        pixels: FFmpeg's name of the pixel format; "420" halves the resolution of color in both directions.
        options: of the encoder.
    """

    encoder: str
    pixels: str
    options: Mapping[str, str] = field(default_factory=dict)


def require_av() -> Any:
    """The module av.

    Raises:
        MissingLibraryError: it is not installed.
    """
    with extra("export"):
        import av
    return av


class CodecVideo:
    """Writes a video, frame by frame; ``close`` completes the file.

    Args:
        path: the file; the ending determines the container.
        codec: compression of the frames.
        fps: frames per second.
    """

    def __init__(self, path: Path, codec: Codec, fps: float) -> None:
        self._av = require_av()
        self._codec, self._rate = codec, Fraction(fps).limit_denominator(1001)
        self._container = self._av.open(str(path), "w")
        self._stream: Any = None
        self.frames = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Append a frame (H, W, 3) BGR of the size of the first frame.

        Raises:
            OSError: the file cannot be written.
        """
        if self._stream is None:
            self._open((picture.shape[1], picture.shape[0]))
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
        frame = frame.reformat(format=self._codec.pixels)
        frame.pts, frame.time_base = self.frames, 1 / self._rate
        self._mux(frame)
        self.frames += 1

    def _open(self, size: tuple[int, int]) -> None:
        options = dict(self._codec.options)
        self._stream = self._container.add_stream(self._codec.encoder, rate=self._rate, options=options)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = self._codec.pixels
        self._stream.codec_context.time_base = 1 / self._rate
        self._stream.codec_context.thread_count = 1  # the same bytes on every machine

    def close(self) -> None:
        """Complete the file.

        Raises:
            OSError: the file cannot be written.
        """
        if self._stream is not None:
            self._mux(None)
        self._container.close()

    def _mux(self, frame: Any) -> None:
        for packet in self._stream.encode(frame):
            self._container.mux(packet)


def pixels_of(picture: NDArray[Any]) -> NDArray[np.uint8]:
    """A picture with 8 bits a channel, for videos; of 16 bits the upper 8 bits."""
    return (picture >> 8).astype(np.uint8) if picture.dtype == np.uint16 else picture
