"""Video files, read by PyAV: the one place where a video is opened and decoded.

A file is opened by its absolute path and by the formats that are named here: no protocol of FFmpeg, and no list of
other files, is ever followed. The pixels are those of the sensor: a rotation in the file is not applied.

The frames are the visible ones: frames that an edit list discards are decoded, because later frames need them, and
left out. A frame that cannot be decoded keeps its place and its time. Time stamps that go back, as where two streams
were joined, continue from the frame before.
"""

from __future__ import annotations

import bisect
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

from cmpdesign.errors import SourceError, parameter
from cmpdesign.inputs.file_kinds import describe_file
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.libraries import extra

# FFmpeg's names of formats: containers with times, and bare streams, whose times FFmpeg would invent.
TIMED_FORMATS = "mov,matroska,avi,mpegts,mpeg,flv,asf,ogg,gif,ivf,nut,mxf,yuv4mpegpipe"
BARE_FORMATS = ("h264", "hevc", "mjpeg", "mpjpeg", "m4v", "mpegvideo", "obu", "av1")
_NETWORK = "rtsp,rtsps,rtmp,rtmps,rtp,srtp,udp,tcp,tls,http,https,httpproxy,crypto"
STREAM_TIMEOUT_S = 4.0  # for opening and reading; a stop waits at most this time
_DECLARING = ("mov", "matroska", "avi")  # formats whose files state their length
_MAX_STEPS = 2.5  # the stated length may exceed the read length by this number of the largest steps
_JPEG_END = b"\xff\xd9"
CUT_OFF = "the frame is cut off: its JPEG has no end"
NOT_DECODED = "cannot be decoded"


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """A frame of a video.

    Attributes:
        stamp: its time stamp, in units of the stream's time base; None in a bare stream.
        time_s: time from the start of the file; NaN in a bare stream.
        image: (H, W, 3) uint8 BGR, as the sensor took it; None where the frame cannot be decoded.
        problem: reason for a missing image, or "".
    """

    stamp: int | None
    time_s: float
    image: Any
    problem: str = ""


@dataclass(frozen=True)
class VideoFacts:
    """What a file says about its video.

    Attributes:
        fps: mean rate; None for a bare stream.
        frames: number of frames that the file states; None where there is none. It may count frames that are not shown.
        length_s: stated length; None where the format states none.
        began_unix_s: the file's time of creation, s since 1970, UTC; None where there is none.
    """

    fps: float | None
    frames: int | None
    length_s: float | None
    began_unix_s: float | None


@contextmanager
def opened_video(path: Path, most_pixels: int = MAX_PIXELS) -> Iterator[Any]:
    """A PyAV container with a video, decoded by one thread.

    Raises:
        SourceError: no regular file, no video of a known format, or frames of more than ``most_pixels`` pixels.
    """
    description = _description(path)
    with extra("video"):
        import av

    limits = {"format_whitelist": ",".join((TIMED_FORMATS, *BARE_FORMATS)), "protocol_whitelist": "file"}
    try:
        container = av.open(f"file:{path.absolute()}", container_options=limits)
    except (av.FFmpegError, OSError, ValueError) as error:
        if description:
            raise SourceError(f"{path} is no video: {description}") from None
        raise SourceError(
            f"{path} is no video that can be read ({_reason(error)}): its format is unknown, or its end with the "
            "index is missing"
        ) from None
    with container:
        _prepare(container, str(path), most_pixels)
        yield container


@contextmanager
def opened_stream(address: str, name: str, most_pixels: int = MAX_PIXELS) -> Iterator[Any]:
    """A PyAV container with a network stream; no file of this machine is read, whatever the stream names.

    Raises:
        SourceError: the stream cannot be opened in ``STREAM_TIMEOUT_S``, or has too large frames.
    """
    with extra("video"):
        import av

    options = {"protocol_whitelist": _NETWORK, "rtsp_transport": "tcp"}
    try:
        container = av.open(address, container_options=options, timeout=STREAM_TIMEOUT_S)
    except (av.FFmpegError, OSError, ValueError):  # their texts may name the password
        raise SourceError(
            f"{name} cannot be opened; check the address, and that the camera is switched on"
        ) from None
    with container:
        _prepare(container, name, most_pixels)
        yield container


def _prepare(container: Any, name: str, most_pixels: int) -> None:
    """Check the video of a container, and prepare its decoder."""
    if not container.streams.video:
        raise SourceError(f"{name}: holds no video")
    context = container.streams.video[0].codec_context
    if context.width * context.height > most_pixels:
        raise SourceError(
            f"{name}: the frames have {context.width} x {context.height} px; the limit is "
            f"{most_pixels / 1e6:.4g} megapixels ({parameter('max_pixels')})"
        )
    context.thread_count = 1
    context.copy_opaque = True
    if context.name == "mjpeg":
        context.options = {"err_detect": "explode"}  # else what is missing is shown as in the frame before


def video_facts(container: Any) -> VideoFacts:
    """What the file of an open container says."""
    stream = container.streams.video[0]
    rate = None if is_bare(container) else stream.average_rate or stream.guessed_rate
    frames = stream.frames if 0 < stream.frames < 1 << 30 else None
    return VideoFacts(
        float(rate) if rate else None, frames, _stated_length_s(container), _began_unix_s(container)
    )


def is_bare(container: Any) -> bool:
    """True for a stream without container, whose packets have no times of their own."""
    return any(name in BARE_FORMATS for name in container.format.name.split(","))


def packets_of(container: Any) -> Iterator[Any]:
    """The packets of the video in the order of decoding, up to the end or the first damage of the file."""
    with extra("video"):
        import av

    with suppress(av.FFmpegError):
        yield from (packet for packet in container.demux(container.streams.video[0]) if packet.size)


def decoded_frames(container: Any, packets: Iterable[Any]) -> Iterator[VideoFrame]:
    """The visible frames of packets, in the order in which they are shown.

    Args:
        container: from ``opened_video``.
        packets: of its video, from a key frame on.
    """
    stream = container.streams.video[0]
    has_times, is_jpeg = not is_bare(container), stream.codec_context.name == "mjpeg"
    clock = _Clock(stream)
    waiting: list[tuple[int, int]] = []  # (stamp, number) of packets whose frame has not come yet
    problems: dict[int, str] = {}
    for number, packet in enumerate(chain(packets, [None])):  # None: the last frames that the decoder holds
        if packet is not None:
            clock.advance(packet)
            packet.opaque = (number,)  # an object of its own: PyAV finds it again by its address
            is_timed = has_times and packet.pts is not None
            if is_timed and not packet.is_discard:
                bisect.insort(waiting, (packet.pts, number))
            if is_jpeg and _JPEG_END not in bytes(packet).rstrip(b"\0")[-4:]:
                problems[number] = CUT_OFF
                if not is_timed:
                    yield VideoFrame(None, float("nan"), None, CUT_OFF)
                continue
        for frame in _decoded(stream, packet):
            stamp = frame.pts if has_times else None
            while stamp is not None and waiting and waiting[0][0] < stamp:
                yield _lost(clock, waiting.pop(0), problems)
            waiting = [each for each in waiting if (each[1],) != frame.opaque]
            yield VideoFrame(stamp, clock.seconds(stamp), frame.to_ndarray(format="bgr24"))
    for each in waiting:
        yield _lost(clock, each, problems)


def early_end(facts: VideoFacts, times_s: list[float]) -> str:
    """Why a file ends before the length that it states, from the times of its last frames; "" for a whole file."""
    known = [time_s for time_s in times_s if time_s == time_s]
    if facts.length_s is None or not known:
        return ""
    step_s = max((b - a for a, b in pairwise(known)), default=0.0)
    step_s = max(step_s, 1 / facts.fps if facts.fps else 0.0)
    if facts.length_s - known[-1] <= _MAX_STEPS * step_s:
        return ""
    return f"the video ends at {known[-1] + step_s:.3g} s of the {facts.length_s:.3g} s that it states"


class _Clock:
    """Stamps that never go back for long: where a stream is joined to another one, stamps continue."""

    def __init__(self, stream: Any) -> None:
        self._base, self._start = stream.time_base, stream.start_time or 0
        self._step = int(1 / (stream.average_rate * stream.time_base)) if stream.average_rate else 1
        self._offset = 0
        self._last: int | None = None

    def advance(self, packet: Any) -> None:
        """Shift a packet's stamps by the offset, which grows where the decoding stamps go back."""
        if packet.dts is not None:
            if self._last is not None and packet.dts + self._offset < self._last:
                self._offset = self._last + self._step - packet.dts
            self._last = packet.dts + self._offset
        if self._offset:
            packet.dts = None if packet.dts is None else packet.dts + self._offset
            packet.pts = None if packet.pts is None else packet.pts + self._offset

    def seconds(self, stamp: int | None) -> float:
        return float("nan") if stamp is None else float((stamp - self._start) * self._base)


def _lost(clock: _Clock, packet: tuple[int, int], problems: dict[int, str]) -> VideoFrame:
    stamp, number = packet
    return VideoFrame(stamp, clock.seconds(stamp), None, problems.get(number, NOT_DECODED))


def _decoded(stream: Any, packet: Any) -> list[Any]:
    """The frames that a packet completes; none of a damaged packet."""
    with extra("video"):
        import av

    try:
        frames = stream.codec_context.decode(packet)
    except (av.FFmpegError, EOFError):
        return []
    return [frame for frame in frames if not frame.is_corrupt]


def _description(path: Path) -> str:
    """See ``describe_file``; a folder, a pipe and a device are refused here."""
    try:
        return describe_file(path)
    except ValueError as error:
        raise SourceError(str(error)) from None


def _stated_length_s(container: Any) -> float | None:
    stream = container.streams.video[0]
    if container.format.name.split(",")[0] not in _DECLARING:
        return None
    if container.format.name == "avi" and stream.frames and stream.average_rate:
        return float(stream.frames / stream.average_rate)  # FFmpeg shortens the duration of a cut file
    if stream.duration:
        return float(stream.duration * stream.time_base)
    stated = stream.metadata.get("DURATION", "")  # of Matroska: 00:00:00.800000000
    with suppress(ValueError):
        hours, minutes, seconds = stated.split(":")
        return int(hours) * 3600 + int(minutes) * 60 + float(seconds)
    return None


def _began_unix_s(container: Any) -> float | None:
    with suppress(ValueError, OverflowError):
        began_s = datetime.fromisoformat(container.metadata.get("creation_time", "")).timestamp()
        return began_s if began_s > 0 else None
    return None


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
