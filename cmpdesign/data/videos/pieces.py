"""Videos cut at key frames: the places of the cuts, and the frames of one piece, decoded from its key frame on.

A piece has the frames whose time stamps lie from the key frame's to the next piece's. Time stamps are those of the
file's packets, in units of the stream's time base; a frame that cannot be decoded still has one.
"""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from cmpdesign.inputs.videos import VideoFrame, decoded_frames, is_bare, opened_video, packets_of
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


@dataclass(frozen=True, eq=False)
class NumberedFrame:
    """A frame of a source by its number; see ``VideoFrame``."""

    number: int
    time_s: float
    image: Any


def video_pieces(path: Path, most_frames: int) -> list[Piece]:
    """Cut a video at key frames into pieces of ``most_frames`` frames or a little more, without decoding it.

    A file whose packets have no time stamps, or whose time stamps go back, cannot be cut: it is decoded once to count
    its frames, and is one piece.

    Raises:
        SourceError: the file cannot be opened, or holds no video.
    """
    stamps: list[int] = []
    keys: list[int] = []
    decoding: list[int] = []
    with opened_video(path) as container:
        is_cut = not is_bare(container)
        for packet in packets_of(container) if is_cut else ():
            decoding += [] if packet.dts is None else [packet.dts]
            if packet.pts is None:
                is_cut = False
                break
            if not packet.is_discard:
                stamps.append(packet.pts)
                keys += [packet.pts] if packet.is_keyframe else []
    if is_cut and all(one <= other for one, other in pairwise(decoding)):
        return _cut(sorted(stamps), sorted(keys), most_frames)
    count = sum(1 for _ in _piece_frames(path, Piece(0, 0)))
    return [Piece(0, count)] if count else []


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


def piece_frames(path: Path, piece: Piece) -> Iterator[NumberedFrame]:
    """The frames of a piece in the order of their time stamps, also those that cannot be decoded.

    Raises:
        SourceError: the file cannot be opened.
    """
    for place, frame in enumerate(_piece_frames(path, piece)):
        yield NumberedFrame(piece.first + place, frame.time_s, frame.image)


def _piece_frames(path: Path, piece: Piece) -> Iterator[VideoFrame]:
    with opened_video(path) as container:
        if piece.has_stamps and piece.start != START:
            _seek(container, container.streams.video[0], piece.start)
        for frame in decoded_frames(container, packets_of(container)):
            if piece.has_stamps and frame.stamp is not None:
                if frame.stamp >= piece.end:
                    return
                if frame.stamp < piece.start:
                    continue
            yield frame


def _seek(container: Any, stream: Any, start: int) -> None:
    """Go to the key frame of a stamp, or before; to the beginning of a file without random access."""
    with extra("data"):
        import av

    try:
        container.seek(start, stream=stream, backward=True)
        first = next(packets_of(container), None)
        good = first is not None and first.is_keyframe and first.pts is not None and first.pts <= start
        container.seek(start if good else 0, stream=stream, backward=True)
    except av.FFmpegError:
        container.seek(0)
