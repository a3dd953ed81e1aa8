"""From a source through a tracker into what is written, until the source ends or somebody stops it."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.images import read_image
from cmpdesign.tracking.overlay import OverlayWriter
from cmpdesign.tracking.sinks import FrameSink
from cmpdesign.tracking.sources import FrameSource, open_source

if TYPE_CHECKING:
    from extractor import Markers, Reference


@dataclass(eq=False)
class StopRequest:
    """Set from outside, looked at between two frames, so that no frame is torn."""

    asked: bool = False


@dataclass(eq=False)
class TrackingRun:
    """One run's parts. ``tally`` and ``ended_early`` tell how it went.

    ``tracker`` makes a frame of an image, a time stamp and a problem; ``tally`` counts frames: a ``Tracker`` and a
    ``Tally``, or a ``ShapeTracker`` and a ``ShapeTally``.
    """

    source: FrameSource
    tracker: Any
    sink: FrameSink
    tally: Any
    overlay: OverlayWriter | None = None
    limit: int | None = None
    ended_early: str = ""
    stop: StopRequest = field(default_factory=StopRequest)

    def go(self, watch: Callable[[Any], None]) -> None:
        """Track to the end; ``watch`` sees every frame.

        Raises:
            OutputError: something could not be written; all that could be is complete, and the message says where.
        """
        failed: list[str] = []
        try:
            self._track(watch)
        except OutputError as error:
            failed.append(str(error))
        finally:
            failed += self._closed()
        if failed:
            raise OutputError("; ".join(dict.fromkeys((*failed, self.sink.kept()))))

    def _track(self, watch: Callable[[Any], None]) -> None:
        for frame in self.source.frames():
            tracked = self.tracker.track(frame.image, time_s=frame.time_s, reason=frame.problem)
            self.sink.add(tracked)
            self.tally.add(tracked)
            if self.overlay is not None:
                self.overlay.add(frame.image, tracked, self.tracker.rest)
            watch(tracked)
            if self.stop.asked:
                self.ended_early = f"stopped by hand after {self.tally.frames} frames"
                return
            if self.limit is not None and self.tally.frames >= self.limit:
                return
        self.ended_early = self.source.ended_early

    def _closed(self) -> list[str]:
        """Complete the files, each of them whatever becomes of the others; what could not be."""
        failed = []
        for part in (self.sink, self.overlay):
            try:
                if part is not None:
                    part.close()
            except OutputError as error:
                failed.append(str(error))
        return failed


@contextmanager
def stop_on_signal(stop: StopRequest) -> Iterator[None]:
    """Ctrl-C and a request to terminate end the run after the current frame; a second one ends it at once."""

    def ask(number: int, frame: Any) -> None:
        if stop.asked:
            raise KeyboardInterrupt
        stop.asked = True

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def read_rest_markers(text: str, source: str, reference: Reference, fps: float | None) -> Markers:
    """The markers at rest: of a frame of the source by its number, or of an image file.

    Raises:
        CmpDesignError: there is no such frame or image, or no pattern is found in it.
    """
    from extractor import Extractor

    markers = Extractor(reference).extract(read_rest_image(text, source, fps))
    if markers.reason is not None:
        name = f"frame {text}" if text.isdecimal() else text
        raise CmpDesignError(f"at rest: no pattern is found in {name} ({markers.reason}); choose another")
    return markers


def read_rest_image(text: str, source: str, fps: float | None) -> Any:
    """The picture at rest: a frame of the source by its number, or an image file.

    Raises:
        CmpDesignError: there is no such frame or image.
    """
    image = _read_frame(int(text), source, fps) if text.isdecimal() else read_image(Path(text))
    if image is None:
        name = f"frame {text}" if text.isdecimal() else text
        raise CmpDesignError(f"at rest: {name} cannot be read; choose another")
    return image


def _read_frame(number: int, text: str, fps: float | None) -> Any:
    source = open_source(text, fps)
    if source.name.startswith("camera"):
        raise CmpDesignError(
            f"at rest, frame {number}: a camera's frames cannot be read ahead; give an image file"
        )
    for index, frame in enumerate(source.frames()):
        if index == number:
            return frame.image
    raise CmpDesignError(f"at rest, frame {number}: {text} has fewer frames")
