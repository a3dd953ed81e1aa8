"""One camera of a running sensor: a thread reads it and keeps the newest frames; what is dropped is counted.

A camera that stops, or sends frames of another size, is opened again with growing pauses. A driver may keep a call for
seconds: the thread that waits in it holds nobody up.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from threading import Condition, Event, Thread
from typing import Any

from cmpdesign.errors import CmpDesignError
from cmpdesign.runtime.events import EventKind, EventLog
from cmpdesign.tracking.sources import FrameSource, SourceFrame

KEPT_FRAMES = 4  # of which those of several cameras are paired
SILENT_FRAMES = 1.9  # frame times without a frame, after which it is an event: two are promised
MIN_SILENT_S = 0.01  # shorter waits are those of threads; chosen
STEPS, FEWEST_STEPS = 32, 5  # steps between frames whose median is the frame time
FIRST_WAIT_S = 3.0  # for the first frame of a camera; chosen
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.1, 5.0  # before a camera is opened again; doubled each time; chosen
CLOSE_S = 0.5  # for a thread that waits in a driver


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """A frame.

    Attributes:
        number: the camera's count from 0; with the frames that are missing by its time stamps.
        taken_s: middle of the exposure on the clock ``time.monotonic``.
        image: (H, W, 3); None without an image.
        problem: reason for a missing image, or "".
    """

    number: int
    taken_s: float
    image: Any
    problem: str


class Camera:
    """A camera and the thread that reads it.

    A time stamp is taken as the end of the exposure, and of half the exposure time, if the driver tells it, the middle
    is earlier. Recorded sources are played at their own rate.

    Args:
        name: for events.
        open_source: opens the source; called again after a failure.
        size_px: width and height of all frames; None: those of the first one.
        fps: the rate that is expected; None: only the measured one counts.
        log: takes the events.
        changed: notified after every frame.

    Raises:
        SourceError: the source cannot be opened.

    Attributes:
        state: what the driver answers; None of a recorded source.
    """

    def __init__(
        self,
        name: str,
        open_source: Callable[[], FrameSource],
        size_px: tuple[int, int] | None,
        fps: float | None,
        log: EventLog,
        changed: Condition,
    ) -> None:
        self.name, self.is_over = name, False
        self._open, self._size_px, self._fps = open_source, size_px, fps
        self._log, self._changed = log, changed
        self._frames: deque[CameraFrame] = deque(maxlen=KEPT_FRAMES)
        self._steps_s: deque[float] = deque(maxlen=STEPS)
        self._number, self._last_time_s = -1, float("nan")
        self._arrived_s, self._is_silent = time.monotonic(), False
        self._pause_s = FIRST_PAUSE_S
        self._closing = Event()
        self._source: FrameSource | None = open_source()
        self.state = next(iter(self._source.camera), None)
        self._thread = Thread(target=self._work, name=f"camera {name}", daemon=True)
        self._thread.start()

    @property
    def frame_s(self) -> float | None:
        """The time from frame to frame; None where it is not known yet."""
        if len(self._steps_s) >= FEWEST_STEPS:
            return median(tuple(self._steps_s))
        return None if self._fps is None else 1 / self._fps

    @property
    def frames(self) -> tuple[CameraFrame, ...]:
        """The newest frames, the newest last."""
        return tuple(self._frames)

    def seconds_to_silence(self) -> float:
        """The time after which a missing frame is an event; infinite where it is one, or the source is over."""
        if self._is_silent or self.is_over:
            return float("inf")
        frame_s = self.frame_s if self._number >= 0 else None
        limit_s = FIRST_WAIT_S if frame_s is None else max(SILENT_FRAMES * frame_s, MIN_SILENT_S)
        return max(self._arrived_s + limit_s - time.monotonic(), 0.0)

    def note_silence(self) -> None:
        """Note that no frame came in time, if so."""
        if self.seconds_to_silence() <= 0:
            gap_s = time.monotonic() - self._arrived_s
            self._is_silent = True
            self._log.add(EventKind.SILENT, self.name, f"no frame for {1e3 * gap_s:.0f} ms", gap_s)

    def close(self) -> None:
        """Stop reading; a driver that does not return is left alone."""
        self._closing.set()
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            self._log.add(EventKind.HELD, self.name, "its driver has not returned; the camera stays in use")

    def _work(self) -> None:
        """Runs in the thread. Exceptions of drivers are not known in advance, and must not end the thread."""
        while not self._closing.is_set() and not self.is_over:
            try:
                source = self._source or self._open()
            except Exception as error:
                kind, text = EventKind.FAILED, _one_line(error)
            else:
                self._source = None
                kind, text = EventKind.STOPPED, self._read_to_end(source)
                self.is_over = not text
            if not self._closing.is_set():
                self._pause(kind, text)

    def _pause(self, kind: EventKind, text: str) -> None:
        gap_s = time.monotonic() - self._arrived_s
        self._is_silent = True
        if self.is_over:
            self._log.add(EventKind.ENDED, self.name, "the recorded frames are over", gap_s)
        else:
            text = f"{text}; it is opened again in {self._pause_s:g} s"
            self._log.add(kind, self.name, text, gap_s)
        with self._changed:
            self._changed.notify_all()
        if not self.is_over:
            self._closing.wait(self._pause_s)
            self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)

    def _read_to_end(self, source: FrameSource) -> str:
        """Keep the frames of a source; why it ended, "" at the end of a recorded source."""
        frames, self.state = source.frames(), next(iter(source.camera), None)
        self._last_time_s, began_s = float("nan"), time.monotonic()
        try:
            for frame in frames:
                if self._closing.is_set():
                    return ""
                if problem := self._other_size(frame):
                    return problem
                if not source.is_live:
                    self._closing.wait(max(began_s + frame.time_s - time.monotonic(), 0.0))
                self._keep(frame, source, began_s)
        except Exception as error:
            return _one_line(error)
        finally:
            frames.close()  # type: ignore[attr-defined]
        return source.ended_early if source.is_live else ""

    def _other_size(self, frame: SourceFrame) -> str:
        if frame.image is None:
            return ""
        size_px = (frame.image.shape[1], frame.image.shape[0])
        self._size_px = self._size_px or size_px
        if size_px == self._size_px:
            return ""
        return f"its frames have {size_px[0]} x {size_px[1]} px instead of {self._size_px[0]} x {self._size_px[1]}"

    def _keep(self, frame: SourceFrame, source: FrameSource, began_s: float) -> None:
        now_s = time.monotonic()
        step_s, frame_s = frame.time_s - self._last_time_s, self.frame_s
        has_stamps = source.times.of == "camera" or not source.is_live
        missing = round(step_s / frame_s) - 1 if has_stamps and frame_s and step_s == step_s else 0
        if step_s > 0:
            self._steps_s.append(step_s)
        self._last_time_s = frame.time_s
        origin_s = source.times.origin[1] if source.is_live and source.times.origin else began_s
        exposure_ms = None if self.state is None else self.state.settings.exposure_ms
        taken_s = origin_s + frame.time_s - 0.5e-3 * (exposure_ms or 0.0)
        if self._is_silent and frame.image is not None:
            gap_s = now_s - self._arrived_s
            self._log.add(EventKind.RESUMED, self.name, f"frames again after {1e3 * gap_s:.0f} ms", gap_s)
            self._is_silent, self._pause_s = False, FIRST_PAUSE_S
        if frame.image is not None:
            self._arrived_s = now_s
        self._number += 1 + max(missing, 0)
        with self._changed:
            self._frames.append(CameraFrame(self._number, taken_s, frame.image, frame.problem))
            self._changed.notify_all()


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if isinstance(error, CmpDesignError) else f"{type(error).__name__}: {text}"
