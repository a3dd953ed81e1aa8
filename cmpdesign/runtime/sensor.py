"""A running sensor: a thread for each camera, one that reads the newest frame, and the results for everybody."""

from __future__ import annotations

import time
from collections import deque
from threading import TIMEOUT_MAX, Condition, Event, Thread
from typing import TYPE_CHECKING, Any

from cmpdesign.errors import CmpDesignError
from cmpdesign.runtime.camera import Camera, CameraFrame
from cmpdesign.runtime.events import Event as SensorEvent
from cmpdesign.runtime.events import EventKind, EventLog
from cmpdesign.runtime.health import (
    ADVISED_FRAMES,
    EVERY_FRAMES,
    FRAMES,
    AtRest,
    Health,
    Past,
    ToldAdvice,
    health_of,
    past_of,
)
from cmpdesign.runtime.pairing import newest_set
from cmpdesign.runtime.plan import SensorPlan
from cmpdesign.runtime.result import SensorFrame
from cmpdesign.runtime.zero import FRAMES as ZERO_FRAMES
from cmpdesign.runtime.zero import rest_markers

if TYPE_CHECKING:
    from cmpdesign.inputs.cameras import CameraState
    from extractor import ContactTracker, ShapeTracker, Tracker

KEPT_RESULTS = 16  # of which those of several sensors are paired; chosen, as each holds its image
LONGEST_WAIT_S = 0.25  # of the reading thread, before it looks for the end
CLOSE_S = 5.0  # for the frame that is read at the end
ZERO_WAIT_S = 3.0  # for the frames of a rest frame


class LateError(CmpDesignError, TimeoutError):
    """There is no result in time; the message says since when, and why."""


class Sensor:
    """A sensor whose cameras are read until it is closed. Its methods can be called by any thread.

    Args:
        plan: the work.

    Raises:
        SourceError: a camera cannot be opened.

    Attributes:
        name: of the sensor.
        plan: as given.
        tracker: reads the frames; made of the first frame, and again by ``zero``.
        count: number of results so far.
    """

    def __init__(self, plan: SensorPlan) -> None:
        self.name, self.plan, self.count = plan.name, plan, 0
        self._log, self._changed = EventLog(), Condition()
        self._results: deque[SensorFrame] = deque(maxlen=KEPT_RESULTS)
        self._past: deque[Past] = deque(maxlen=FRAMES)
        self._told = ToldAdvice()
        self.tracker: Tracker | ContactTracker | ShapeTracker | None = None
        self._rest: AtRest | None = None
        self._zeros = 0
        self._closing, self._failure = Event(), ""
        table, self._cameras = plan.file.table, list[Camera]()
        try:
            for one in plan.cameras:
                camera = Camera(one.name, one.open, table.size_px, table.camera.fps, self._log, self._changed)
                self._cameras.append(camera)
        except BaseException:
            self.close()
            raise
        self._thread = Thread(target=self._work, name=f"sensor {self.name}", daemon=True)
        self._thread.start()

    @property
    def events(self) -> tuple[SensorEvent, ...]:
        """What happened to the cameras and the health, the newest last."""
        return self._log.since(0)

    def events_since(self, count: int) -> tuple[SensorEvent, ...]:
        """The events after the first ``count`` ones."""
        return self._log.since(count)

    @property
    def results(self) -> tuple[SensorFrame, ...]:
        """The last results, the newest last."""
        return tuple(self._results)

    @property
    def cameras(self) -> dict[str, CameraState | None]:
        """Camera -> what its driver answers; None of a recorded source."""
        return {one.name: one.state for one in self._cameras}

    @property
    def health(self) -> Health:
        """The state of the sensor by its last frames.

        Raises:
            LateError: there is no result so far.
        """
        if not self._results:
            raise LateError(self._late_text("there is no result"))
        return self._health(FRAMES)

    def _health(self, frames: int) -> Health:
        with self._changed:
            newest, past = self._results[-1], tuple(self._past)[-frames:]
        limits = self.plan.file.table.limits
        return health_of(newest, past, self._rest, self.plan.layout, limits, self._log.count)

    def latest(self) -> SensorFrame:
        """The newest result. The first one is waited for.

        Raises:
            LateError: it is older than ``max_age_ms`` of the file's [limits].
        """
        limit_ms = self.plan.file.table.limits.max_age_ms
        frame = self._results[-1] if self._results else self.wait()
        if frame.age_ms > limit_ms:
            text = f"the newest result is {frame.age_ms:.0f} ms old, max_age_ms is {limit_ms:g}"
            raise LateError(self._late_text(text))
        return frame

    def wait(self, after: int = -1, timeout_s: float = 5.0) -> SensorFrame:
        """The newest result, if it is of a frame after ``after``; else the next one.

        Args:
            after: the ``index`` of a result.
            timeout_s: longest wait.

        Raises:
            LateError: no such result within this time.
            CmpDesignError: a time that is no number of seconds.
        """
        if not isinstance(timeout_s, int | float) or not timeout_s <= TIMEOUT_MAX:
            raise CmpDesignError(
                f"timeout_s is {timeout_s}; give the longest wait, at most {TIMEOUT_MAX:.0f} s"
            )

        def is_there() -> bool:
            return self._closing.is_set() or bool(self._results and self._results[-1].index > after)

        with self._changed:
            self._changed.wait_for(is_there, timeout_s)
            if self._results and self._results[-1].index > after:
                return self._results[-1]
        raise LateError(self._late_text(f"no result after {after} within {timeout_s:g} s"))

    def next_results(self, count: int) -> list[SensorFrame]:
        """Results of frames that are read from now on, without those that were dropped.

        Raises:
            LateError: no frames come.
        """
        last, found = self.wait().index, list[SensorFrame]()
        while len(found) < count:
            found.append(self.wait(last, ZERO_WAIT_S))
            last = found[-1].index
        return found

    def zero(self, check: bool = True) -> None:
        """Take the mean of the next frames as the rest frame, from which displacement, shape and force count.

        Light and focus of these frames are those that ``health`` expects from now on, and markers that they do not
        show, as behind a scratch, are not expected any more. When the call returns, results count from the new rest
        frame.

        Args:
            check: refuse a pattern that is bent against the former rest frame; False: after the start under load.

        Raises:
            TouchedError: the pattern moves, is touched or not seen; the rest frame is the former one.
            LateError: no frames come.
        """
        frames = self.next_results(ZERO_FRAMES)
        before = self._rest.markers if check and self._rest is not None else None
        layout, limits = self.plan.layout, self.plan.file.table.limits
        rest = rest_markers(frames, before, layout, limits.max_rest_error_px)
        tracker = self.plan.tracker(rest)
        with self._changed:
            past = [one for one in self._past if one.number >= frames[0].index]
        at_rest = AtRest.of(rest, past, layout, limits)
        with self._changed:
            self._rest, self.tracker, last = at_rest, tracker, self._results[-1].index
            self._zeros += 1
        self.wait(last, ZERO_WAIT_S)

    def close(self) -> None:
        """End all threads; a driver that does not return is left alone."""
        self._closing.set()
        with self._changed:
            self._changed.notify_all()
        for camera in self._cameras:
            camera.close()
        if hasattr(self, "_thread"):
            self._thread.join(CLOSE_S)

    def _late_text(self, text: str) -> str:
        events = [one for one in self.events if one.kind is not EventKind.HEALTH]
        why = self._failure or (str(events[-1]) if events else "")
        return f"{self.name}: {text}" + (f" ({why})" if why else "")

    def _work(self) -> None:
        """Runs in the thread: the newest frame, again and again; silent cameras are noted."""
        last, events, dropped_before = -1, 0, -1
        try:
            while not self._closing.is_set():
                frames = self._next(last)
                if frames is None:
                    continue
                last, zeros = frames[0].number, self._zeros
                result = self._read(frames, last - dropped_before - 1, self._log.since(events))
                past = past_of(result, frames[0].image, self._rest)
                if self._rest is None and result.views and all(view.markers.found for view in result.views):
                    markers, limits = [view.markers for view in result.views], self.plan.file.table.limits
                    self._rest = AtRest.of(markers, [past], self.plan.layout, limits)
                with self._changed:
                    if self._zeros != zeros:  # it counts from the former rest frame
                        last = dropped_before
                        continue
                    self._results.append(result)
                    self.count += 1
                    self._past.append(past)
                    self._changed.notify_all()
                dropped_before, events = last, events + len(result.events)
                if self.count % EVERY_FRAMES == 0:
                    for advice in self._told.new(self._health(ADVISED_FRAMES).advice):
                        self._log.add(EventKind.HEALTH, "", advice)
        except Exception as error:  # a fault of the reader must reach those who wait
            self._failure = f"the reader failed: {type(error).__name__}: {' '.join(str(error).split())}"
            raise
        finally:
            self._closing.set()
            with self._changed:
                self._changed.notify_all()

    def _next(self, after: int) -> tuple[CameraFrame, ...] | None:
        """The newest frames of all cameras, waited for until a camera is silent; None without new ones."""
        found: tuple[CameraFrame, ...] | None = None

        def is_there() -> bool:
            nonlocal found
            found = newest_set([one.frames for one in self._cameras], after, self._cameras[0].frame_s)
            return found is not None or self._closing.is_set()

        wait_s = min(LONGEST_WAIT_S, *(one.seconds_to_silence() for one in self._cameras))
        with self._changed:
            self._changed.wait_for(is_there, wait_s)
        for camera in self._cameras:
            camera.note_silence()
        return found

    def _read(
        self, frames: tuple[CameraFrame, ...], dropped: int, events: tuple[SensorEvent, ...]
    ) -> SensorFrame:
        from extractor import FrameStatus

        first, images = frames[0], [one.image for one in frames]
        image: Any = images[0] if len(images) == 1 else images
        problem = "; ".join(filter(None, (one.problem for one in frames)))
        if self.tracker is None and all(one is not None for one in images):
            self.tracker = self.plan.first_tracker(image)
        tracked = None
        if self.tracker is not None:
            tracked = self.tracker.track(image, time_s=first.taken_s, reason=problem)
        now_s = time.monotonic()
        result = SensorFrame(
            name=self.name,
            index=first.number,
            taken_s=first.taken_s,
            taken_unix_s=time.time() - (now_s - first.taken_s),
            latency_ms=1e3 * (now_s - first.taken_s),
            dropped=dropped,
            offset_ms=1e3 * max(abs(one.taken_s - first.taken_s) for one in frames),
            status=FrameStatus.LOST if tracked is None else tracked.status,
            reason=problem or "a view does not show the pattern" if tracked is None else tracked.reason,
            tracked=tracked,
            events=events,
        )
        return result
