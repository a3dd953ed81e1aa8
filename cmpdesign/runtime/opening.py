"""Sensors opened by their files, together."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self

from cmpdesign.runtime.pairing import nearest_places
from cmpdesign.runtime.plan import plan_of
from cmpdesign.runtime.result import SensorFrame, SensorFrames
from cmpdesign.runtime.sensor import LateError, Sensor
from cmpdesign.runtime.zero import FRAMES, rest_markers
from cmpdesign.sensor.sensor_file import load_sensor_file
from cmpdesign.sensor.tables import SensorError

if TYPE_CHECKING:
    from cmpdesign.inputs.cameras import CameraState
    from cmpdesign.runtime.publish.recording import SensorRecording
    from extractor import Markers


class Sensors:
    """Running sensors, by their names also as attributes. Closed at the end of a ``with`` block.

    Args:
        sensors: with different names.
    """

    def __init__(self, sensors: Iterable[Sensor]) -> None:
        self._sensors = {sensor.name: sensor for sensor in sensors}
        self._recordings: list[SensorRecording] = []

    def __getattr__(self, name: str) -> Sensor:
        return self[name] if not name.startswith("_") else super().__getattribute__(name)

    def __getitem__(self, name: str) -> Sensor:
        if name not in self._sensors:
            raise AttributeError(f"there is no sensor {name!r}; there are {', '.join(self._sensors)}")
        return self._sensors[name]

    def __iter__(self) -> Iterator[Sensor]:
        return iter(self._sensors.values())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def latest(self) -> SensorFrames:
        """The newest results that belong together: of each sensor the one nearest to the time that all have reached.

        Raises:
            LateError: a sensor's newest result is too old, see ``Sensor.latest``.
        """
        for sensor in self:
            sensor.latest()
        return self._paired()

    def wait(self, after: SensorFrames | None = None, timeout_s: float = 5.0) -> SensorFrames:
        """Results that belong together, newer than ``after`` of every sensor.

        Raises:
            LateError: a sensor has none within this time.
            CmpDesignError: a time that is no number of seconds.
        """
        end_s = time.monotonic() + timeout_s
        last = {one.name: -1 if after is None else after.frames[one.name].index for one in self}
        for sensor in self:
            sensor.wait(last[sensor.name], max(end_s - time.monotonic(), 0.0))
        while True:
            found = self._paired()
            if all(one.index > last[one.name] for one in found):
                return found
            # a sensor that is behind the others keeps them at their former results
            behind = min(self, key=lambda one: one.results[-1].taken_s)
            behind.wait(behind.results[-1].index, max(end_s - time.monotonic(), 0.0))

    def zero(self, check: bool = True) -> None:
        """Zero all sensors, see ``Sensor.zero``; the first that refuses ends the call."""
        for sensor in self:
            sensor.zero(check)

    def record(self, path: str | Path) -> SensorRecording:
        """Record all results from now on into one MCAP file, until the recording or the sensors are closed.

        Raises:
            CmpDesignError, OutputError: see ``SensorRecording``.
        """
        from cmpdesign.runtime.publish.recording import SensorRecording

        self._recordings.append(SensorRecording(self, Path(path)))
        return self._recordings[-1]

    def close(self) -> None:
        """End all threads, and complete recordings.

        Raises:
            OutputError: a recording could not be written.
        """
        for sensor in self:
            sensor.close()
        while self._recordings:
            self._recordings.pop().close()

    def _paired(self) -> SensorFrames:
        histories = [sensor.results for sensor in self]
        places = nearest_places([[one.taken_s for one in each] for each in histories])
        if places is None:
            raise LateError("no sensor is open")
        frames: dict[str, SensorFrame] = {
            sensor.name: each[place] for sensor, each, place in zip(self, histories, places, strict=True)
        }
        first_s = next(iter(frames.values())).taken_s
        return SensorFrames(frames, {name: 1e3 * (frame.taken_s - first_s) for name, frame in frames.items()})


def open_sensor(*paths: str | Path, outputs: Iterable[str] | None = None) -> Sensors:
    """Open the sensors of some files; their cameras are read until the sensors are closed.

    >>> with cmpdesign.open_sensor("thumb.toml", "index.toml") as sensors:
    ...     sensors.zero()
    ...     frame = sensors.thumb.latest()
    ...     frame = sensors.thumb.wait(after=frame.index, timeout_s=0.05)
    ...     frame.markers, frame.shape, frame.contact, frame.age_ms, frame.dropped

    Args:
        paths: sensor files with a [camera]; the name of each without its ending is the sensor's.
        outputs: of "markers", "virtual", "shape" and "contact"; what is not wanted is not computed. None: all that a
            file allows, without virtual markers.

    Raises:
        SensorError: a file that cannot be used, two sensors of one name or on one camera.
        SourceError: a camera cannot be opened.
    """
    if not paths:
        raise SensorError("no sensor file is given")
    wanted = None if outputs is None else tuple(outputs)
    plans = [plan_of(load_sensor_file(path), wanted) for path in paths]
    owners: dict[str, Path] = {}
    for plan in plans:
        for key in (f"name {plan.name!r}", *(f"camera {one.identity!r}" for one in plan.cameras)):
            if key in owners:
                where = "this file" if owners[key] == plan.file.path else owners[key]
                raise SensorError(
                    f"{plan.file.path}: {key} is used by {where}, too; every sensor needs its own"
                )
            owners[key] = plan.file.path
    opened: list[Sensor] = []
    try:
        for plan in plans:
            opened.append(Sensor(plan))
    except BaseException:
        Sensors(opened).close()
        raise
    return Sensors(opened)


class RestLook(NamedTuple):
    """What a sensor's own cameras show at rest.

    Attributes:
        markers: of each view, the mean of some frames; with the deviations of one frame, since errors that all frames
            have in common do not average out.
        cameras: camera -> what its driver answers; None of a recorded source.
    """

    markers: tuple[Markers, ...]
    cameras: dict[str, CameraState | None]


def look_at_rest(path: str | Path) -> RestLook:
    """Open a sensor, read some frames of its pad at rest, and close it.

    Raises:
        TouchedError: the pattern moves, or is not seen.
        SensorError, SourceError, LateError: see ``open_sensor``; no frames come.
    """
    with open_sensor(path, outputs=["markers"]) as sensors:
        (sensor,) = sensors
        frames = sensor.next_results(FRAMES)
        rest = rest_markers(frames, None, sensor.plan.layout, None)
        return RestLook(tuple(replace(one, cov_px2=FRAMES * one.cov_px2) for one in rest), sensor.cameras)
