"""Videos as cameras, phones and programs write them, made with PyAV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

TICKS = 1000  # of the time base, a second


def write_video(
    path: Path,
    images: Iterable[NDArray[Any]],
    codec: str = "libx264",
    stamps_ms: Sequence[int] | None = None,
    file_format: str | None = None,
    gop: int = 6,
    **metadata: str,
) -> Path:
    """Write (H, W, 3) BGR images at 25 per second, or at stamps."""
    pixels = {"mjpeg": "yuvj444p", "libx264": "yuv444p", "ffv1": "bgr0", "gif": "rgb8"}.get(codec, "yuv420p")
    options = {"qp": "2"} if codec == "libx264" else {}
    with av.open(str(path), "w", format=file_format) as container:
        container.metadata.update(metadata)
        stream: Any = container.add_stream(codec, rate=25, options=options)
        stream.pix_fmt = pixels
        stream.codec_context.gop_size, stream.codec_context.thread_count = gop, 1
        if codec == "mjpeg":
            stream.codec_context.qmin = stream.codec_context.qmax = 2
        base = Fraction(1, TICKS) if stamps_ms is not None else Fraction(1, 25)
        stream.codec_context.time_base = base
        pictures = list(images)
        stream.height, stream.width = pictures[0].shape[:2]
        for index, image in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="bgr24")
            frame = frame.reformat(format=pixels)
            frame.time_base, frame.pts = base, index if stamps_ms is None else stamps_ms[index]
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def cut_without_encoding(source: Path, path: Path, start_s: float) -> Path:
    """Copy a video from a time on, as editors do: the frames before are kept for decoding, and not to be shown."""
    with av.open(str(source)) as old, av.open(str(path), "w") as new:
        stream = old.streams.video[0]
        copied = new.add_stream_from_template(stream)
        shift = int(start_s / stream.time_base)
        for packet in old.demux(stream):
            if packet.dts is not None and packet.pts is not None:
                packet.pts, packet.dts, packet.stream = packet.pts - shift, packet.dts - shift, copied
                new.mux(packet)
    return path


def turn_in_player(path: Path) -> Path:
    """Put a turn by 90 degrees into the track header of an MP4, as a phone held upright does."""
    data = path.read_bytes()
    one, quarter = (1 << 16).to_bytes(4, "big"), (-(1 << 16)).to_bytes(4, "big", signed=True)
    zero, last = bytes(4), (1 << 30).to_bytes(4, "big")
    upright = b"".join([one, zero, zero, zero, one, zero, zero, zero, last])
    turned = b"".join([zero, one, zero, quarter, zero, zero, zero, zero, last])
    at = data.index(upright, data.index(b"tkhd"))
    path.write_bytes(data[:at] + turned + data[at + len(turned) :])
    return path


def cut_jpeg(path: Path, number: int) -> Path:
    """Overwrite the second half of one JPEG of an AVI, as a transfer that breaks off leaves it."""
    with av.open(str(path)) as container:
        packets = [bytes(packet) for packet in container.demux(container.streams.video[0]) if packet.size]
    data = path.read_bytes()
    jpeg = packets[number]
    at, half = data.index(jpeg), len(jpeg) // 2
    path.write_bytes(data[: at + half] + bytes(len(jpeg) - half) + data[at + len(jpeg) :])
    return path
