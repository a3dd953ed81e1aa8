"""The result of one frame of a running sensor, and of several sensors at one time."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from cmpdesign.runtime.events import Event

if TYPE_CHECKING:
    from extractor import FrameStatus, Markers, Shape, ShapeFrame, Tracked
    from extractor.contact import ContactForce


@dataclass(frozen=True, eq=False)
class SensorFrame:
    """The result of one frame. Can be pickled, and read by any thread.

    Attributes:
        name: the sensor's.
        index: number of the camera's frame, which counts those without a result, too.
        taken_s: middle of the exposure on the clock ``time.monotonic`` of this machine.
        taken_unix_s: the same in s since 1970.
        latency_ms: from the middle of the exposure to the result.
        dropped: frames since the result before that have none: replaced by a newer one, or missing by the time stamps.
        offset_ms: largest difference of the times of the sensor's cameras; 0 with one camera.
        status: outcome.
        reason: why there are no or few markers; else empty.
        tracked: the reader's own record, for tables and recordings; None where no view could be placed yet.
        events: what happened to the cameras since the result before.
    """

    name: str
    index: int
    taken_s: float
    taken_unix_s: float
    latency_ms: float
    dropped: int
    offset_ms: float
    status: FrameStatus
    reason: str
    tracked: Tracked | ShapeFrame | None = field(repr=False)
    events: tuple[Event, ...] = ()

    @property
    def age_ms(self) -> float:
        """From the middle of the exposure until now, on this machine."""
        return 1e3 * (time.monotonic() - self.taken_s)

    @property
    def views(self) -> tuple[Tracked, ...]:
        """The tracked frame of each view."""
        if self.tracked is None:
            return ()
        several: tuple[Tracked, ...] | None = getattr(self.tracked, "views", None)
        return (cast("Tracked", self.tracked),) if several is None else several

    @property
    def markers(self) -> Markers | tuple[Markers, ...]:
        """The markers; of several views the markers of each; empty where no view could be placed yet."""
        found = tuple(view.markers for view in self.views)
        return found[0] if len(found) == 1 else found

    @property
    def shape(self) -> Shape | None:
        """The surface; of several views always, since their markers come with it, else None."""
        return getattr(self.tracked, "shape", None)

    @property
    def contact(self) -> ContactForce | None:
        """Force, torque and regions; None if they are not wanted."""
        return None if self.tracked is None else self.tracked.contact


@dataclass(frozen=True, eq=False)
class SensorFrames:
    """Results of several sensors that belong together by time, also as attributes. Can be pickled.

    Attributes:
        frames: sensor -> result.
        offsets_ms: sensor -> its time after that of the first sensor.
    """

    frames: Mapping[str, SensorFrame]
    offsets_ms: Mapping[str, float]

    def __getattr__(self, name: str) -> SensorFrame:
        frames = self.__dict__.get("frames", {})  # empty while a pickle is read
        if name.startswith("_") or name not in frames:
            raise AttributeError(f"there is no sensor {name!r}; there are {', '.join(frames)}")
        return cast("SensorFrame", frames[name])

    def __iter__(self) -> Iterator[SensorFrame]:
        return iter(self.frames.values())
