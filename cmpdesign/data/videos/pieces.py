"""Videos cut at key frames: the places of the cuts, and the frames of one piece, decoded from its key frame on.

A piece has the frames whose time stamps lie from the key frame's to the next piece's. Time stamps are those of the
file's packets, in units of the stream's time base; a frame that cannot be decoded still has one.
"""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from cmpdesign.inputs.sources import SourceError
from cmpdesign.libraries import extra

START = -(1 << 62)  # of the first piece
END = 1 << 62  # of the last piece


@dataclass(frozen=True)
class Piece:
    """A part of a source: frames from ``first`` on; ``start`` and ``end`` are time stamps of a video, if there are
    any.
    """

    first: int
    frames: int
    start: int = 0
    end: int = 0

    @property
    def has_stamps(self) -> bool:
        return self.end > self.start


class _Decoded(NamedTuple):
    """The time of a frame, s, and its image, if it can be decoded."""

    time_s: float
    image: Any


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """A frame of a video; ``image`` (H, W, 3) uint8 BGR, None where it cannot be decoded; ``time_s`` from its stamp."""

    number: int
    time_s: float
    image: Any


def video_pieces(path: Path, most_frames: int) -> list[Piece]:
    """Cut a video at key frames into pieces of ``most_frames`` frames or a little more, without decoding it.

    A file whose packets have no time stamps cannot be cut: it is decoded once to count its frames, and is one piece.

    Raises:
        SourceError: the file cannot be opened, or holds no video.
    """
    stamps: list[int] = []
    keys: list[int] = []
    with _opened(path) as container:
        for packet in _packets(container):
            if packet.pts is None:
                break
            stamps.append(packet.pts)
            if packet.is_keyframe:
                keys.append(packet.pts)
        else:
            return _cut(sorted(stamps), sorted(keys), most_frames)
    return [Piece(0, sum(1 for _ in _unstamped_frames(path)))]


def _cut(stamps: list[int], keys: list[int], most_frames: int) -> list[Piece]:
    starts = [0]
    for key in keys:
        place = bisect.bisect_left(stamps, key)
        if place - starts[-1] >= most_frames:
            starts.append(place)
    ends = [*starts[1:], len(stamps)]
    return [
        Piece(
            start,
            end - start,
            stamps[start] if start else START,
            stamps[end] if end < len(stamps) else END,
        )
        for start, end in zip(starts, ends, strict=True)
        if end > start
    ]


def piece_frames(path: Path, piece: Piece) -> Iterator[VideoFrame]:
    """The frames of a piece in the order of their time stamps, also those that cannot be decoded.

    Raises:
        SourceError: the file cannot be opened.
    """
    found = _stamped_frames(path, piece) if piece.has_stamps else _unstamped_frames(path)
    for place, (stamp_s, image) in enumerate(found):
        yield VideoFrame(piece.first + place, stamp_s, image)


def _stamped_frames(path: Path, piece: Piece) -> Iterator[_Decoded]:
    with _opened(path) as container:
        stream = container.streams.video[0]
        if piece.start != START:
            _seek(container, stream, piece.start)
        waiting: list[int] = []  # stamps whose frame has not been decoded yet
        for packet in chain(_packets(container), [None]):  # None: the last frames that the decoder holds
            if packet is not None and packet.pts is not None and piece.start <= packet.pts < piece.end:
                bisect.insort(waiting, packet.pts)
            for frame in _decoded(stream, packet):
                while waiting and waiting[0] < frame.pts:
                    yield _Decoded(_seconds(stream, waiting.pop(0)), None)
                if frame.pts >= piece.end:
                    return
                if waiting and waiting[0] == frame.pts:
                    yield _Decoded(_seconds(stream, waiting.pop(0)), frame.to_ndarray(format="bgr24"))
        for stamp in waiting:
            yield _Decoded(_seconds(stream, stamp), None)


def _unstamped_frames(path: Path) -> Iterator[_Decoded]:
    """All frames that can be decoded, in their order, with times by the file's frame rate."""
    with _opened(path) as container:
        stream = container.streams.video[0]
        rate = float(stream.average_rate or 0)
        number = 0
        for packet in chain(_packets(container), [None]):
            for frame in _decoded(stream, packet):
                yield _Decoded(number / rate if rate else float("nan"), frame.to_ndarray(format="bgr24"))
                number += 1


def _seek(container: Any, stream: Any, start: int) -> None:
    """Go to the key frame of a stamp, or before; to the beginning of a file without random access."""
    with extra("data"):
        import av

    try:
        container.seek(start, stream=stream, backward=True)
        first = next(_packets(container), None)
        good = first is not None and first.is_keyframe and first.pts <= start
        container.seek(start if good else 0, stream=stream, backward=True)
    except av.FFmpegError:
        container.seek(0)


def _packets(container: Any) -> Iterator[Any]:
    """The packets with frames that are shown, up to the first damage of the file."""
    with extra("data"):
        import av

    with suppress(av.FFmpegError):
        for packet in container.demux(container.streams.video[0]):
            if packet.size and not packet.is_discard:
                yield packet


def _decoded(stream: Any, packet: Any) -> list[Any]:
    """The frames that a packet completes; none of a damaged packet."""
    with extra("data"):
        import av

    try:
        frames = stream.codec_context.decode(packet)
    except (av.FFmpegError, EOFError):
        return []
    return [frame for frame in frames if not frame.is_corrupt]


def _seconds(stream: Any, stamp: int) -> float:
    return float((stamp - (stream.start_time or 0)) * stream.time_base)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A container with one video, decoded by one thread: the processes share the cores."""
    with extra("data"):
        import av

    try:
        container = av.open(str(path))
    except (av.FFmpegError, OSError, ValueError) as error:
        raise SourceError(f"{path} is no video that can be read ({_reason(error)})") from None
    with container:
        if not container.streams.video:
            raise SourceError(f"{path}: holds no video")
        container.streams.video[0].codec_context.thread_count = 1
        yield container


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
