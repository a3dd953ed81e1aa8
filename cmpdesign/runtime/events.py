"""What happened to the cameras of a running sensor, and to its health."""

from __future__ import annotations

import logging
import time
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from threading import Lock

LOGGER = logging.getLogger("cmpdesign.runtime")
LOGGER.addHandler(logging.NullHandler())  # a program decides what it shows
MAX_EVENTS = 1000  # that are kept; chosen


class EventKind(StrEnum):
    """What happened."""

    SILENT = "silent"  # no frame for two frame times
    STOPPED = "stopped"  # the camera ended, or its frames cannot be used; it is opened again
    FAILED = "failed"  # it could not be opened again; another try follows
    RESUMED = "resumed"  # frames again, after a gap
    ENDED = "ended"  # a recorded source has no more frames
    HELD = "held"  # the driver does not give the camera back
    HEALTH = "health"  # new advice: what to clean, focus, light or zero, with the figure


@dataclass(frozen=True)
class Event:
    """One event.

    Attributes:
        kind: what happened.
        camera: the camera's name; "" of a ``HEALTH`` event.
        text: one sentence.
        unix_s: when it was noticed, s since 1970.
        gap_ms: time without a frame, so far or altogether.
    """

    kind: EventKind
    camera: str
    text: str
    unix_s: float
    gap_ms: float = 0.0

    def __str__(self) -> str:
        return f"{self.camera}: {self.text}" if self.camera else self.text


class EventLog:
    """The events of a sensor in their order; also lines of the logger ``cmpdesign.runtime``."""

    def __init__(self) -> None:
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._lock = Lock()
        self.count = 0

    def add(self, kind: EventKind, camera: str, text: str, gap_s: float = 0.0) -> None:
        """Note an event."""
        event = Event(kind, camera, text, time.time(), 1e3 * gap_s)
        with self._lock:
            self._events.append(event)
            self.count += 1
        LOGGER.log(logging.INFO if kind is EventKind.RESUMED else logging.WARNING, "%s", event)

    def since(self, count: int) -> tuple[Event, ...]:
        """The events after the first ``count`` ones, as far as they are kept."""
        with self._lock:
            return tuple(self._events)[-max(self.count - count, 0) :] if self.count > count else ()
