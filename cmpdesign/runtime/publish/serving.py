"""Running sensors for viewers: their newest results over Foxglove's websocket, on the topics of recordings."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Event, Lock, Thread

from cmpdesign.runtime.publish.results import SensorRecorder
from cmpdesign.runtime.sensor import LateError, Sensor
from cmpdesign.tracking.live.foxglove_server import FoxgloveServer
from cmpdesign.tracking.live.options import Live

WAIT_S = 0.5  # for a result, before the end is looked for


class SensorServer:
    """Serves the results of open sensors to viewers on this machine; a thread for each waits for the next result.

    Args:
        sensors: stay open until the server is closed.
        port: on this machine; None: Foxglove's own; 0: any free one.

    Raises:
        CmpDesignError: a library is not installed, or the port cannot be opened.

    Attributes:
        address: for viewers.
    """

    def __init__(self, sensors: Iterable[Sensor], port: int | None = None) -> None:
        sensors = tuple(sensors)
        contacts = {one.name: one.plan.contact is not None for one in sensors}
        self._server, self._sending = FoxgloveServer(contacts, Live("foxglove", port).free_port()), Lock()
        self.address = self._server.address
        self._closing = Event()
        self._threads = [Thread(target=self._publish, args=(one,), daemon=True) for one in sensors]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the server."""
        self._closing.set()
        for thread in self._threads:
            thread.join(2 * WAIT_S)
        self._server.close()

    def _publish(self, sensor: Sensor) -> None:
        """Runs in a thread: the newest result, again and again."""
        recorder, last = SensorRecorder(sensor), -1
        while not self._closing.is_set():
            try:
                frame = sensor.wait(after=last, timeout_s=WAIT_S)
            except LateError:
                self._closing.wait(0.1)
                continue
            last, found = frame.index, recorder.recorded(frame)
            if found is not None:
                with self._sending:
                    self._server.send([found], sensor.name)
