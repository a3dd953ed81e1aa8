"""The run from a source through a tracker into files, until the source ends or a stop is requested."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.images import read_image
from cmpdesign.tracking.live.view import LiveView
from cmpdesign.tracking.overlay import OverlayWriter
from cmpdesign.tracking.sinks.tables import FrameSink
from cmpdesign.tracking.sources import FrameSource, Reading, open_source
from cmpdesign.watch import tell

if TYPE_CHECKING:
    from extractor import Markers, Tracker


WAIT_STEP_S = 0.1  # a stop is noticed after this time


@dataclass(eq=False)
class StopRequest:
    """A request to stop; the run tests the request between two frames, so that every frame is complete."""

    is_requested: bool = False


_STOP: ContextVar[StopRequest | None] = ContextVar("stop", default=None)


@dataclass(eq=False)
class TrackingRun:
    """The parts of one run.

    Attributes:
        source: source of the frames.
        tracker: ``Tracker`` or ``ShapeTracker``.
        sink: sink of the tracked frames.
        statistics: ``TrackStatistics`` or ``ShapeStatistics``.
        overlay: writer of the overlay video, if any.
        limit: largest number of frames, if any.
        ended_early: reason for an early end; "" if all frames were tracked.
        stop: request to stop; that of ``stop_on_signal`` within its context.
        warnings: reasons to doubt the results.
        live: live viewer of the tracked frames, if any; a failure of the viewer does not end the run.
    """

    source: FrameSource
    tracker: Any
    sink: FrameSink
    statistics: Any
    overlay: OverlayWriter | None = None
    limit: int | None = None
    ended_early: str = ""
    stop: StopRequest = field(default_factory=lambda: _STOP.get() or StopRequest())
    warnings: tuple[str, ...] = ()
    live: LiveView | None = None

    def go(self, on_frame: Callable[[Any], None]) -> None:
        """Track to the end; ``on_frame`` is called with every tracked frame.

        Raises:
            OutputError: a file could not be written; the other files are complete, and the message names them.
        """
        failures: list[str] = []
        try:
            self._track(on_frame)
        except OutputError as error:
            failures.append(str(error))
        finally:
            failures += self._close_files()
        if failures:
            raise OutputError("; ".join(dict.fromkeys((*failures, self.sink.kept()))))

    def _wait_for_viewer(self) -> None:
        """Wait until a viewer is connected, the waiting time is over, or a stop is requested."""
        end = time.monotonic() + (self.live.wait_s if self.live is not None else 0.0)
        while self.live is not None and not self.stop.is_requested and time.monotonic() < end:
            if self.live.wait(WAIT_STEP_S):
                return

    def _track(self, on_frame: Callable[[Any], None]) -> None:
        self._wait_for_viewer()
        total, last_s = self.limit or self.source.total or 0, float("-inf")
        for frame in self.source.frames():
            tracked = self.tracker.track(frame.image, time_s=frame.time_s, reason=frame.problem)
            notes = [tracked.reason]
            if frame.problem not in tracked.reason:  # of one of several views
                notes.append(frame.problem)
            if frame.time_s <= last_s:
                notes.append("its time is not after that of the frame before")
            tracked = replace(tracked, reason="; ".join(filter(None, notes)))
            last_s = max(last_s, frame.time_s) if frame.time_s == frame.time_s else last_s
            self.sink.add(tracked, frame.image)
            if self.live is not None:
                self.live.add(tracked, frame.image)
            self.statistics.add(tracked)
            if self.overlay is not None:
                self.overlay.add(frame.image, tracked, self.tracker.rest)
            on_frame(tracked)
            tell(self.statistics.frames, total, "frames")
            if self.stop.is_requested:
                self.ended_early = f"stopped by Ctrl-C after {self.statistics.frames} frames"
                return
            if self.limit is not None and self.statistics.frames >= self.limit:
                return
        self.ended_early = self.source.ended_early

    def _close_files(self) -> list[str]:
        """Complete each file, also after a failure of another file; return the failures."""
        failures = []
        for writer in (self.sink, self.overlay):
            try:
                if writer is not None:
                    writer.close()
            except OutputError as error:
                failures.append(str(error))
        if self.live is not None:
            self.live.close()
        return failures


@contextmanager
def stop_on_signal(stop: StopRequest) -> Iterator[None]:
    """Within this context, the first SIGINT or SIGTERM ends runs after the current frame, the second at once."""

    def request_stop(number: int, frame: Any) -> None:
        if stop.is_requested:
            raise KeyboardInterrupt
        stop.is_requested = True

    earlier = {number: signal.signal(number, request_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    token = _STOP.set(stop)
    try:
        yield
    finally:
        _STOP.reset(token)
        for number, handler in earlier.items():
            signal.signal(number, handler)


def read_rest_markers(
    text: str,
    source: str | Sequence[str],
    how: Reading,
    tracker: Tracker,
) -> Markers:
    """Extract the markers at rest.

    Args:
        text: number of a frame of the source, or path of an image file.
        source: the source, see ``open_source``.
        how: how the source is read.
        tracker: a new tracker with the options of the run; it reads the image.

    Raises:
        CmpDesignError: no such frame or image, or no pattern is found in the image.
    """
    markers = tracker.track(read_rest_image(text, source, how)).markers
    if not markers.found:
        name = f"frame {text}" if text.isdecimal() else text
        raise CmpDesignError(
            f"at rest: no pattern is found in {name} ({_why(markers)}); choose another image"
        )
    return markers


def _why(markers: Markers) -> str:
    return "no image" if markers.reason is None else markers.reason.text


def read_rest_image(text: str, source: str | Sequence[str], how: Reading) -> Any:
    """Read the image at rest; arguments as for ``read_rest_markers``.

    Raises:
        CmpDesignError: no such frame or image.
    """
    image = (
        _read_frame(int(text), source, how)
        if text.isdecimal()
        else read_image(Path(text), how.max_pixels, bits=how.bits)
    )
    if image is None:
        name = f"frame {text}" if text.isdecimal() else text
        raise CmpDesignError(f"at rest: {name} cannot be read; choose another image")
    return image


def _read_frame(number: int, texts: str | Sequence[str], how: Reading) -> Any:
    source = open_source(texts, replace(how, times=None))
    if source.is_live:
        raise CmpDesignError(
            f"at rest, frame {number}: a {source.name.partition(' ')[0]}'s frames cannot be read ahead; "
            "give an image file"
        )
    for index, frame in enumerate(source.frames()):
        if index == number:
            return frame.image
    raise CmpDesignError(f"at rest, frame {number}: {source.name} has fewer frames")
