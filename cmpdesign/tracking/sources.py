"""Sources of frames: pictures, a video, a camera, a stream. An unreadable frame counts as a frame."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from cmpdesign.errors import parameter
from cmpdesign.files.images import ImageFileError, is_image_file, read_image
from cmpdesign.inputs.files import MOST_PIXELS, is_regular_file, path_exists
from cmpdesign.inputs.sources import NamedSource, SourceError, SourceKind, is_stream_address, name_sources

DEFAULT_FPS = 30.0
MAX_FAILED_READS = 10  # consecutive failures after which a stream counts as ended
PHOTO_SUFFIXES = frozenset({".heic", ".heif", ".avif", ".dng"})  # formats of phones other than JPEG
MOST_DELAY_S = 1.0  # from a camera's time stamp to the arrival; a longer time means stamps of another clock
STREAM_TIMEOUT_MS = 4000  # for opening and reading; a stop waits at most this time


@dataclass(frozen=True, eq=False)
class SourceFrame:
    """A frame of a source.

    Attributes:
        time_s: time stamp.
        image: (H, W, 3) BGR, or None; of several views a list of these.
        problem: reason for a missing image, or "".
        path: the image's own file; None for a frame of a video, a camera or a stream, and for several views.
    """

    time_s: float
    image: Any
    problem: str = ""
    path: Path | None = None

    def __repr__(self) -> str:
        seen = self.problem or (
            "x".join(map(str, self.image.shape)) if hasattr(self.image, "shape") else "views"
        )
        return f"<SourceFrame at {self.time_s:.6g} s: {seen}>"


class FrameSource(Protocol):
    """A sequence of frames that is read once.

    Attributes:
        name: name for messages.
        total: number of frames that the source declares; None if unknown.
        fps: frames per second; None if unknown.
        ended_early: after the last frame, the reason for an early end; "" if all frames were read.
        is_live: the frames are read while they are taken: no number is declared, and only a stop ends the source.
    """

    name: str
    total: int | None
    fps: float | None
    ended_early: str
    is_live: bool

    def frames(self) -> Iterator[SourceFrame]: ...


def open_source(
    source: str | Sequence[str], fps: float | None = None, most_pixels: int = MOST_PIXELS
) -> FrameSource:
    """Open the source that one text or several texts name, see ``name_sources``: consecutive pictures, or one other
    source.

    Args:
        source: the texts.
        fps: frames per second of pictures (default 30), or instead of a video's own rate.
        most_pixels: limit of width x height of an image or of a frame.

    Raises:
        SourceError: a source cannot be opened, or several are not pictures.
    """
    named = name_sources([source] if isinstance(source, str) else source)
    if not named:
        raise SourceError("no source is given")
    if len(named) == 1:
        return open_named(named[0], fps, most_pixels)
    first = next(each for each in named if each.kind is not SourceKind.IMAGES)
    raise SourceError(
        f"{first.name}: cannot be one of {len(named)} sources; give pictures only, or one video, camera or stream"
    )


def open_named(source: NamedSource, fps: float | None = None, most_pixels: int = MOST_PIXELS) -> FrameSource:
    """Open a source that ``name_sources`` found; see ``open_source``.

    Raises:
        SourceError: the source cannot be opened.
    """
    match source.kind:
        case SourceKind.STREAM:
            hint = "check the address, and that the camera is switched on"
            return LiveSource(source.address, f"stream {source.name}", hint, most_pixels)
        case SourceKind.CAMERA:
            hint = "check that it is connected and that no other program uses it"
            return LiveSource(int(source.address), source.name, hint, most_pixels)
        case SourceKind.FILE if not is_image_file(source.paths[0]):
            return VideoSource(source.paths[0], fps, most_pixels)
    return ImagesSource(source.paths, source.name, fps or DEFAULT_FPS, most_pixels)


def open_sources(text: str, fps: float | None = None, most_pixels: int = MOST_PIXELS) -> FrameSource:
    """Open a source, or for a list with commas one source for each view; see ``open_source``.

    Raises:
        SourceError: a source cannot be opened.
    """
    names = split_list(text)
    return (
        MultiViewSource([open_source(name, fps, most_pixels) for name in names])
        if len(names) > 1
        else open_source(text, fps, most_pixels)
    )


def split_list(text: str) -> list[str]:
    """Split a list with commas; a text that is the path of a file is one name."""
    return [text] if path_exists(text) else text.split(",")


class MultiViewSource:
    """Sources that run at the same time, one for each view; all end with the shortest."""

    def __init__(self, sources: list[FrameSource]) -> None:
        self._sources = sources
        self.name, self.ended_early = " and ".join(source.name for source in sources), ""
        totals = [source.total for source in sources if source.total is not None]
        self.total = min(totals) if totals else None
        self.fps = sources[0].fps
        self.is_live = all(source.is_live for source in sources)

    def frames(self) -> Iterator[SourceFrame]:
        """The frames of all sources, with the first source's time stamps; an unreadable image is None in the list."""
        streams = [source.frames() for source in self._sources]
        while True:
            frames = [next(stream, None) for stream in streams]
            views = [frame for frame in frames if frame is not None]
            if len(views) < len(frames):
                break
            problems = [frame.problem for frame in views if frame.problem]
            yield SourceFrame(views[0].time_s, [frame.image for frame in views], "; ".join(problems))
        reasons = [source.ended_early for source in self._sources if source.ended_early]
        if views and not reasons:
            shorter = [
                source.name for source, frame in zip(self._sources, frames, strict=True) if frame is None
            ]
            reasons = [f"{' and '.join(shorter)} has fewer frames than the others"]
        self.ended_early = "; ".join(reasons)


class ImagesSource:
    """Image files in a given order; time stamps are counted at ``fps``."""

    is_live = False

    def __init__(
        self, paths: Sequence[Path], name: str, fps: float = DEFAULT_FPS, most_pixels: int = MOST_PIXELS
    ) -> None:
        self._paths, self._fps, self._most_pixels = tuple(paths), fps, most_pixels
        self.name, self.ended_early = name, ""
        self.total: int | None = len(self._paths)
        self.fps: float | None = fps

    def frames(self) -> Iterator[SourceFrame]:
        for index, path in enumerate(self._paths):
            time_s = index / self._fps
            try:
                yield SourceFrame(time_s, read_image(path, self._most_pixels), path=path)
            except ImageFileError as error:
                yield SourceFrame(time_s, None, str(error), path)


class VideoSource:
    """A video file, read by OpenCV; time stamps are those of the file, or counted at ``fps`` if given."""

    is_live = False

    def __init__(self, path: Path, fps: float | None, most_pixels: int = MOST_PIXELS) -> None:
        if not is_regular_file(path):
            raise SourceError(
                f"{path}: no such file or folder; expected pictures, a folder of them, a pattern such as 'run/*.png', "
                "a video or a camera's number"
            )
        if path.suffix.lower() in PHOTO_SUFFIXES:
            raise SourceError(
                f"{path}: photos of this format are not read; expected JPEG, PNG, TIFF, BMP or WebP: convert the file, "
                "or set the phone's camera to JPEG (on an iPhone: Most Compatible)"
            )
        self._capture = _open_capture(str(path))
        if not self._capture.isOpened():
            raise SourceError(f"{path} is not a video that can be read, or its end with the index is missing")
        import cv2

        self.name, self.ended_early = str(path), ""
        _require_frame_size(self._capture, self.name, most_pixels)
        declared = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        own = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.total = declared if 0 < declared < 1 << 30 else None
        self.fps = fps or (own if 0 < own < 1e5 else None)
        self._counted = fps is not None

    def frames(self) -> Iterator[SourceFrame]:
        """All frames; a frame in the middle that cannot be decoded has no image."""
        import cv2

        index, failed = 0, 0
        try:
            while failed < MAX_FAILED_READS:
                success, image = self._capture.read()
                if not success or image is None:
                    if self.total is None or index + failed >= self.total:
                        break
                    failed += 1
                    continue
                for _ in range(failed):
                    yield SourceFrame(self._time(index), None, "cannot be decoded")
                    index += 1
                failed = 0
                time_s = float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1e3
                yield SourceFrame(self._time(index) if self._counted or time_s < 0 else time_s, image)
                index += 1
        finally:
            self._capture.release()
        if self.total is not None and index < self.total:
            self.ended_early = f"the video ends after {index} of the {self.total} frames that it declares"

    def _time(self, index: int) -> float:
        return index / self.fps if self.fps else float("nan")


class _LiveClock:
    """Times of a live source's frames, s from the first one: the camera's time stamps, or times of arrival.

    A stamp is used where it is later than the previous frame, and not long before the arrival; some drivers give no
    stamps.
    """

    def __init__(self) -> None:
        self._start_s: float | None = None
        self._offset_s: float | None = None
        self._last_s = -1.0

    def time_s(self, stamp_s: float, now_s: float) -> float:
        """The time of a frame; ``stamp_s``: on the camera's clock, NaN without an image; ``now_s``: of its arrival."""
        self._start_s = now_s if self._start_s is None else self._start_s
        time_s = now_s - self._start_s
        if self._offset_s is None and stamp_s == stamp_s:
            self._offset_s = time_s - stamp_s
        by_camera_s = stamp_s + (self._offset_s or 0.0)
        if by_camera_s > self._last_s and time_s - by_camera_s < MOST_DELAY_S:
            time_s = by_camera_s
        self._last_s = max(time_s, self._last_s)
        return self._last_s


class LiveSource:
    """A camera by its number, or a stream by its address; time stamps are the camera's, from the first frame.

    Where the camera gives no stamps, they are times of arrival.

    Args:
        source: number or address.
        name: name for messages.
        hint: the remedy for a failure.
        most_pixels: limit of width x height of a frame.
    """

    is_live = True

    def __init__(self, source: int | str, name: str, hint: str, most_pixels: int = MOST_PIXELS) -> None:
        self._capture = _open_capture(source)
        if not self._capture.isOpened():
            raise SourceError(f"{name} cannot be opened; {hint}")
        _require_frame_size(self._capture, name, most_pixels)
        self.name, self.ended_early = name, ""
        self.total: int | None = None
        self.fps: float | None = None

    def frames(self) -> Iterator[SourceFrame]:
        """Frames until the camera or stream stops."""
        import cv2

        clock, failed, index = _LiveClock(), 0, 0
        try:
            while failed < MAX_FAILED_READS:
                success, image = self._capture.read()
                has_image = success and image is not None
                stamp_s = float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1e3 if has_image else float("nan")
                time_s = clock.time_s(stamp_s, time.monotonic())
                if has_image:
                    failed = 0
                    yield SourceFrame(time_s, image)
                else:
                    failed += 1
                    yield SourceFrame(time_s, None, f"the {self.name.partition(' ')[0]} gave no image")
                index += 1
        finally:
            self._capture.release()
        self.ended_early = f"the {self.name.partition(' ')[0]} stopped after {index - failed} frames"


def _require_frame_size(capture: Any, name: str, most_pixels: int) -> None:
    """Raise ``SourceError`` for declared frames of more than ``most_pixels`` pixels."""
    import cv2

    width, height = (int(capture.get(key)) for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if width * height > most_pixels:
        raise SourceError(
            f"{name}: the frames have {width} x {height} px; the limit is {most_pixels / 1e6:.4g} megapixels "
            f"({parameter('max_pixels')})"
        )


def _open_capture(source: str | int) -> Any:
    """Open OpenCV's reader without its messages on stderr; damaged frames are reported by their status."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    import cv2

    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    # OpenCV's own reader of AVI files prints letters of the file; it is not used where FFmpeg is available.
    has_ffmpeg = isinstance(source, str) and cv2.CAP_FFMPEG in cv2.videoio_registry.getStreamBackends()
    try:
        if isinstance(source, str) and is_stream_address(source):
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, STREAM_TIMEOUT_MS]
            limits += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, STREAM_TIMEOUT_MS]
            return cv2.VideoCapture(source, cv2.CAP_FFMPEG, limits)
        return cv2.VideoCapture(source, cv2.CAP_FFMPEG if has_ffmpeg else cv2.CAP_ANY)
    finally:
        cv2.utils.logging.setLogLevel(level)
