"""A ROS 2 node that runs tactile sensors and publishes their results.

    ros2 run cmpdesign_ros sensors --ros-args -p sensors:="[thumb.toml, index.toml]"

Parameters: ``sensors``, the sensor files; ``outputs``, of markers, shape and contact (none: all that a file allows).
Topics of each sensor, best effort, depth 1: ``~/NAME/markers`` (PointCloud2), ``~/NAME/wrench`` (WrenchStamped, with a
contact). ``/diagnostics`` has every result's status, latency, drops and events. Service ``~/zero`` (Trigger): the next
frames are the rest frame; it refuses where something touches.
"""

from __future__ import annotations

from array import array
from threading import Event, Thread
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header
from std_srvs.srv import Trigger

import cmpdesign
from cmpdesign.runtime.publish.results import SensorRecorder
from cmpdesign.tracking.recording.messages import DIAGNOSTICS, ERROR, POINTS, WRENCH, Messages, Stamp

WAIT_S = 0.5  # for a result, before the sensor counts as late
TYPES = {
    POINTS: PointCloud2,
    "sensor_msgs/msg/PointField": PointField,
    "std_msgs/msg/Header": Header,
    "builtin_interfaces/msg/Time": Time,
    WRENCH: WrenchStamped,
    "geometry_msgs/msg/Wrench": Wrench,
    "geometry_msgs/msg/Vector3": Vector3,
    DIAGNOSTICS: DiagnosticArray,
    # ROS takes a byte as bytes
    "diagnostic_msgs/msg/DiagnosticStatus": lambda level, **others: DiagnosticStatus(
        level=bytes([level]), **others
    ),
    "diagnostic_msgs/msg/KeyValue": KeyValue,
}


class SensorsNode(Node):  # type: ignore[misc]
    """Publishes the results of some sensors until it is closed; a thread for each waits for its next result."""

    def __init__(self) -> None:
        super().__init__("cmpdesign")
        paths, outputs = (
            [text for text in self.declare_parameter(name, [""]).value if text]
            for name in ("sensors", "outputs")
        )
        self._sensors = cmpdesign.open_sensor(*paths, outputs=outputs or None)
        self._messages = Messages(TYPES, octets=lambda data: array("B", data))
        self._closing = Event()
        newest = QoSProfile(
            history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
        )
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_service(Trigger, "~/zero", self.zero)
        self._threads = []
        for sensor in self._sensors:
            markers = self.create_publisher(PointCloud2, f"~/{sensor.name}/markers", newest)
            wrench = self.create_publisher(WrenchStamped, f"~/{sensor.name}/wrench", newest)
            thread = Thread(
                target=self._publish, args=(sensor, markers, wrench), name=sensor.name, daemon=True
            )
            self._threads.append(thread)
            thread.start()

    def zero(self, request: Any, response: Any) -> Any:
        """Take the next frames of all sensors as their rest frames."""
        try:
            self._sensors.zero()
        except cmpdesign.CmpDesignError as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, "at rest"
        return response

    def close(self) -> None:
        """Close the sensors."""
        self._closing.set()
        self._sensors.close()
        for thread in self._threads:
            thread.join(2 * WAIT_S)

    def _publish(self, sensor: cmpdesign.Sensor, markers: Any, wrench: Any) -> None:
        """Runs in a thread: the newest result, again and again."""
        recorder, last, make = SensorRecorder(sensor), -1, self._messages
        while not self._closing.is_set():
            try:
                frame = sensor.wait(after=last, timeout_s=WAIT_S)
            except cmpdesign.LateError as error:
                self._report(sensor.name, ERROR, str(error), {})
                self._closing.wait(WAIT_S)
                continue
            last, found = frame.index, recorder.recorded(frame)
            if found is None:
                self._report(sensor.name, ERROR, frame.reason, {})
                continue
            stamp = Stamp(found.ns, sensor.name)
            markers.publish(make.points(stamp, found.markers))
            if found.contact is not None:
                wrench.publish(make.wrench(stamp, found.contact.wrench))
            self._report(sensor.name, found.level, found.text, found.values, found.ns)

    def _report(
        self, name: str, level: int, text: str, values: dict[str, str], ns: int | None = None
    ) -> None:
        """Publish a status; ``ns``: its time, None: now."""
        if ns is None:
            ns = self.get_clock().now().nanoseconds
        self._diagnostics.publish(self._messages.diagnostics(Stamp(ns, name), level, text, values))


def main() -> None:
    """Run the node until it is stopped."""
    rclpy.init()
    node = SensorsNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
