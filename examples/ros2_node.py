"""A ROS 2 node that follows the markers of a tactile sensor, and publishes them as a point cloud.

    python examples/ros2_node.py --ros-args -p layout:=out/layout.json -p frame_id:=tactile -r image_raw:=/camera/image

The node reads sensor_msgs/Image (bgr8 or rgb8) from the topic image_raw, and publishes sensor_msgs/PointCloud2 on
<frame_id>/markers, with the fields of recordings (docs/how-to/recordings.md). The node needs ROS 2 with rclpy.
"""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from rclpy.node import Node
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

from cmpdesign.tracking.recording.messages import POINTS, Messages, Stamp
from cmpdesign.tracking.recording.points import marker_records
from cmpdesign.tracking.table import TrackTable
from extractor import Tracker, load_layout

TYPES = {
    POINTS: PointCloud2,
    "sensor_msgs/msg/PointField": PointField,
    "std_msgs/msg/Header": Header,
    "builtin_interfaces/msg/Time": Time,
}


class MarkerNode(Node):  # type: ignore[misc]
    """Publishes the markers of every image; the first image in which the pattern is found is the rest frame."""

    def __init__(self) -> None:
        super().__init__("markers")
        layout = self.declare_parameter("layout", "layout.json").value
        self._frame_id = self.declare_parameter("frame_id", "tactile").value
        self._tracker = Tracker(load_layout(layout))
        self._table = TrackTable(self._tracker)
        self._messages = Messages(TYPES, octets=lambda data: array("B", data))
        self._publisher = self.create_publisher(PointCloud2, f"{self._frame_id}/markers", 10)
        self.create_subscription(Image, "image_raw", self.publish_markers, 10)

    def publish_markers(self, message: Any) -> None:
        """Read one image, and publish its markers with its time stamp."""
        ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        frame = self._tracker.track(image_of(message), time_s=ns / 1e9)
        records = marker_records(self._table.batch([frame]), self._table.about())[0]
        self._publisher.publish(self._messages.points(Stamp(ns, self._frame_id), records))


def image_of(message: Any) -> np.ndarray:
    """The pixels of a sensor_msgs/Image, (H, W, 3) BGR."""
    if message.encoding not in ("bgr8", "rgb8"):
        raise ValueError(f"image_raw has the encoding {message.encoding}; expected bgr8 or rgb8")
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    pixels = rows[:, : 3 * message.width].reshape(message.height, message.width, 3)
    return np.ascontiguousarray(pixels if message.encoding == "bgr8" else pixels[:, :, ::-1])


def main() -> None:
    """Run the node until it is stopped."""
    rclpy.init()
    node = MarkerNode()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
