"""Video files as a source: one, or the parts of a recording that was split."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path

from cmpdesign.errors import SourceError, parameter
from cmpdesign.files.images import is_image_file
from cmpdesign.inputs.cameras import CameraState
from cmpdesign.inputs.files import MAX_PIXELS, is_regular_file, path_exists
from cmpdesign.inputs.videos import (
    VideoFacts,
    decoded_frames,
    early_end,
    is_bare,
    opened_video,
    packets_of,
    video_facts,
)
from cmpdesign.tracking.sources.frame_source import SourceFrame, SourceTimes
from cmpdesign.tracking.sources.pictures import table_times
from cmpdesign.tracking.sources.time_table import TimeTable

PHOTO_SUFFIXES = frozenset({".heic", ".heif", ".avif"})  # formats of phones other than JPEG
_LAST_TIMES = 64  # frames whose steps tell whether a file ends early


class VideoSource:
    """A video file, or several that go on from each other, as a recorder splits a recording.

    Args:
        paths: the files in order.
        fps: rate at which frames are counted, in place of the file's times.
        most_pixels: limit of width x height of a frame.
        times: "index", a table, or None: the file's times.

    Raises:
        SourceError: a file is no video that can be read, or times by names.
    """

    is_live = False

    def __init__(
        self,
        paths: Sequence[Path],
        fps: float | None = None,
        most_pixels: int = MAX_PIXELS,
        times: str | TimeTable | None = None,
    ) -> None:
        if times == "names":
            raise SourceError(
                f"{paths[0]}: a video has no names of frames; use {parameter('times', 'index')}, or a file .csv"
            )
        self._paths, self._most_pixels = tuple(paths), most_pixels
        self.notes: list[str] = []
        self.camera: tuple[CameraState, ...] = ()
        facts, bare = [], False
        for path in self._paths:
            require_video_file(path)
            with opened_video(path, most_pixels) as container:
                facts.append(video_facts(container))
                bare = bare or is_bare(container)
        self.name, self.ended_early = ", ".join(map(str, paths)), ""
        self.total = _shown_frames(facts)
        self.fps = fps or facts[0].fps
        self._table = times if isinstance(times, TimeTable) else None
        self._is_counted = fps is not None or times == "index"
        if times == "index" and self.fps is None:
            raise SourceError(
                f"{self.name}: {parameter('times', 'index')} needs {parameter('fps')}, because the file states no rate"
            )
        self.times = self._describe_times(facts[0].began_unix_s, bare, fps is not None)

    def _describe_times(self, began_s: float | None, is_bare_stream: bool, is_given: bool) -> SourceTimes:
        began_of = None if began_s is None else "file"
        if self._table is not None:
            return table_times(self._table)
        if self._is_counted:
            rate_of = parameter("fps") if is_given else "the rate of the file"
            text = f"times: counted at {self.fps:g} per second ({rate_of})"
            return SourceTimes("index", text, began_s, began_of)
        if is_bare_stream:
            text = f"no times: a stream without a container has none; give the rate with {parameter('fps')}"
            return SourceTimes("none", text, is_doubtful=True)
        parts = f", {len(self._paths)} parts one after another" if len(self._paths) > 1 else ""
        return SourceTimes("video", f"times: those of the video{parts}", began_s, began_of)

    def frames(self) -> Iterator[SourceFrame]:
        """All visible frames; a frame that cannot be decoded has no image."""
        index, start_s, ends = 0, 0.0, []
        for path in self._paths:
            last: deque[float] = deque(maxlen=_LAST_TIMES)
            with opened_video(path, self._most_pixels) as container:
                facts = video_facts(container)
                for frame in decoded_frames(container, packets_of(container)):
                    last.append(frame.time_s)
                    yield SourceFrame(self._time(index, start_s + frame.time_s), frame.image, frame.problem)
                    index += 1
            if problem := early_end(facts, list(last)):
                ends.append(problem if len(self._paths) == 1 else f"{path}: {problem}")
            start_s += _length_s(facts, list(last))
        self.ended_early = "; ".join(ends)

    def _time(self, index: int, time_s: float) -> float:
        if self._table is not None:
            return self._table.time_s(index)
        return index / self.fps if self._is_counted and self.fps else time_s


def require_video_file(path: Path) -> None:
    """Check that a path may be a video.

    Raises:
        SourceError: no file, or a photo of a format that is not read.
    """
    if not path_exists(path):
        raise SourceError(
            f"{path}: no such file or folder; expected pictures, a folder of them, a pattern such as 'run/*.png', "
            "a video or a camera's number"
        )
    if path.suffix.lower() in PHOTO_SUFFIXES:
        raise SourceError(
            f"{path}: photos of this format are not read; expected JPEG, PNG, TIFF, BMP or WebP: convert the file, "
            "or set the phone's camera to JPEG (on an iPhone: Most Compatible)"
        )


def is_video_part(path: Path) -> bool:
    """True for a file that can be one of several videos."""
    return is_regular_file(path) and not is_image_file(path)


def _shown_frames(facts: Sequence[VideoFacts]) -> int | None:
    """The number of frames that the files state; None where it contradicts the stated length, or is not stated."""
    total = 0
    for each in facts:
        if each.frames is None or each.fps is None or each.length_s is None:
            return None
        if abs(each.length_s * each.fps - each.frames) > 1:
            return None
        total += each.frames
    return total


def _length_s(facts: VideoFacts, times_s: list[float]) -> float:
    """From the start of a file to the time of the frame that follows its last one."""
    if not times_s:
        return 0.0
    step_s = times_s[-1] - times_s[-2] if len(times_s) > 1 else 1 / facts.fps if facts.fps else 0.0
    return times_s[-1] + step_s
