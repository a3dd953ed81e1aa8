"""Results of a running sensor as the frames of recordings, which viewers, files and ROS get."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from cmpdesign.runtime.result import SensorFrame
from cmpdesign.runtime.sensor import LateError, Sensor
from cmpdesign.tracking.recording.frames import FrameReader, RecordedFrame
from cmpdesign.tracking.recording.messages import WARN
from cmpdesign.tracking.recording.options import RecordedTable, Recording
from cmpdesign.tracking.shape_table import ShapeTable
from cmpdesign.tracking.sources import SourceTimes
from cmpdesign.tracking.table import TrackTable

if TYPE_CHECKING:
    from cmpdesign.tracking.columns import Columns, FrameTable


def times_of_this_machine() -> SourceTimes:
    """Times on the clock ``time.monotonic``, and when it was 0."""
    began_s = time.time() - time.monotonic()
    return SourceTimes("camera", "times: middle of the exposure", began_s, "clock")


class ResultsTable:
    """The table of a sensor's results; its shared columns are those of the present rest frame.

    Args:
        sensor: with a result.

    Raises:
        LateError: its views could not be placed so far.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor, times = sensor, times_of_this_machine()
        self._times = lambda: times
        self.digits = self._table().digits

    def batch(self, frames: Sequence[Any]) -> Columns:
        """The columns of the reader's own records."""
        return self._table().batch(frames)

    def about(self) -> Columns:
        """The shared columns."""
        return self._table().about()

    def _table(self) -> FrameTable:
        tracker, contact = self._sensor.tracker, self._sensor.plan.contact
        if tracker is None:
            raise LateError(f"{self._sensor.name}: its views could not be placed so far")
        if hasattr(tracker, "reconstructor"):
            return ShapeTable(tracker.reconstructor, None, self._times, contact)
        return TrackTable(tracker, self._times, contact)


class SensorRecorder:
    """Makes the frames of a sensor: markers as records, the contact, and diagnostics with ages, drops and events.

    Args:
        sensor: the sensor; its name is the coordinate frame.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._recording = Recording(sensor.name, views=sensor.plan.file.rig.views)
        self._sensor, self._reader = sensor, FrameReader()
        self._table: RecordedTable | None = None

    def recorded(self, frame: SensorFrame) -> RecordedFrame | None:
        """A result as a frame; None where no view could be placed yet."""
        if frame.tracked is None:
            return None
        self._table = self._table or RecordedTable(ResultsTable(self._sensor), self._recording)
        columns, about = self._table.batch([frame.tracked]), self._table.about()
        (found,) = self._reader.frames(columns, about, lambda number, view: None)
        events = "; ".join(map(str, frame.events))
        values = {
            **found.values,
            "frame": str(frame.index),
            "latency_ms": f"{frame.latency_ms:.3f}",
            "dropped": str(frame.dropped),
            "offset_ms": f"{frame.offset_ms:.3f}",
            "events": events,
        }
        text = f"{found.text}: {events}" if events else found.text
        level = max(found.level, WARN) if events else found.level
        return replace(found, number=frame.index, values=values, text=text, level=level)
