"""The results of running sensors in one MCAP file; gaps of their cameras are in the diagnostics."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from threading import Event, Thread

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.atomic import Stage
from cmpdesign.runtime.publish.results import SensorRecorder
from cmpdesign.runtime.sensor import Sensor
from cmpdesign.tracking.recording.bag import BagWriter
from cmpdesign.tracking.recording.topics import TopicMessages

LOOK_S = 0.02  # between two looks for results; a sensor keeps 16, which is 0.13 s at 120 a second


class SensorRecording:
    """Records from now until ``close``, on the topics of recordings: /NAME/markers of each sensor, and /diagnostics.

    A message of the diagnostics has the frames without a result before it, and what happened to the camera.

    Args:
        sensors: with different names.
        path: ends in .mcap; the file is complete before it gets its name.

    Raises:
        CmpDesignError: another ending, a library is not installed, or a folder has this name.
        OutputError: the file cannot be written.

    Attributes:
        frames: number of recorded results.
        missed: results that were gone before they could be recorded.
    """

    def __init__(self, sensors: Iterable[Sensor], path: Path) -> None:
        if path.suffix != ".mcap" or path.is_dir():
            raise CmpDesignError(f"{path}: a running sensor is recorded into a file that ends in .mcap")
        self.frames = self.missed = 0
        self._path, self._closing, self._failure = path, Event(), ""
        self._sensors = [(one, SensorRecorder(one), TopicMessages(one.name)) for one in sensors]
        self._last = {one.name: (one.results[-1].index if one.results else -1) for one, _, _ in self._sensors}
        try:
            self._stage = Stage(path.parent)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
        self._folder = self._stage.folder / path.stem
        self._thread = Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Complete the file; a second call does nothing.

        Raises:
            OutputError: it could not be written; no file of this name is made or changed.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        with self._stage:
            if not self._failure:
                try:
                    self._stage.commit(self._folder / f"{self._path.stem}.mcap", self._path)
                    return
                except OSError as error:
                    self._failure = str(error.strerror)
        raise OutputError(f"{self._path}: the recording could not be written ({self._failure})")

    def _work(self) -> None:
        """Runs in the thread."""
        try:
            with BagWriter(self._folder) as writer:
                while not self._closing.wait(LOOK_S):
                    self._add_new(writer)
                self._add_new(writer)
        except OSError as error:
            self._failure = str(error.strerror)
        except Exception as error:
            self._failure = " ".join(str(error).split()) or type(error).__name__

    def _add_new(self, writer: BagWriter) -> None:
        for sensor, recorder, messages in self._sensors:
            for frame in [one for one in sensor.results if one.index > self._last[sensor.name]]:
                if self._last[sensor.name] >= 0:
                    self.missed += frame.index - frame.dropped - 1 - self._last[sensor.name]
                self._last[sensor.name] = frame.index
                found = recorder.recorded(frame)
                if found is not None:
                    writer.add(messages.of(found), messages.store)
                    self.frames += 1
