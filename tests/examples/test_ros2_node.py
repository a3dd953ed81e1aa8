"""The example of a ROS 2 node, run without ROS: the published messages are valid, and have the markers of the image."""

from __future__ import annotations

import runpy
import sys
from array import array
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from extractor import Tracker, load_layout
from tests.support.layouts import small_text
from tests.support.tracking.scenes import LAYERS, moving

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros2_node.py"
STORE = get_typestore(Stores.ROS2_HUMBLE)
MESSAGES = {
    "builtin_interfaces": ["Time"],
    "std_msgs": ["Header"],
    "sensor_msgs": ["Image", "PointCloud2", "PointField"],
}


class Node:
    """The part of rclpy's node that the example uses."""

    def __init__(self, name: str) -> None:
        self.name, self.published, self.topics = name, [], {}  # type: ignore[var-annotated]

    def declare_parameter(self, name: str, default: str) -> SimpleNamespace:
        return SimpleNamespace(value={"layout": "layout.json", "frame_id": "thumb"}[name])

    def create_publisher(self, kind: type, topic: str, depth: int) -> SimpleNamespace:
        self.topics[topic] = kind
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind: type, topic: str, callback: Any, depth: int) -> None:
        self.topics[topic] = kind


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The example's names, with the message classes of rosbags in place of ROS's own."""
    for package, names in MESSAGES.items():
        module = ModuleType(f"{package}.msg")
        for name in names:
            setattr(module, name, STORE.types[f"{package}/msg/{name}"])
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", module)
    node = ModuleType("rclpy.node")
    node.Node = Node  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "rclpy", ModuleType("rclpy"))
    monkeypatch.setitem(sys.modules, "rclpy.node", node)
    monkeypatch.chdir(tmp_path)
    Path("layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    return runpy.run_path(str(EXAMPLE), run_name="ros2_node")


def image_message(image: np.ndarray, encoding: str, ns: int) -> SimpleNamespace:
    """An image whose rows have some bytes of padding, as drivers may send them."""
    height, width = image.shape[:2]
    pixels = image if encoding == "bgr8" else image[:, :, ::-1]
    rows = np.pad(pixels.reshape(height, 3 * width), ((0, 0), (0, 8)))
    stamp = SimpleNamespace(sec=ns // 10**9, nanosec=ns % 10**9)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp),
        height=height,
        width=width,
        step=3 * width + 8,
        encoding=encoding,
        data=rows.tobytes(),
    )


def test_every_image_becomes_a_cloud(example: dict[str, Any]) -> None:
    node, tracker = example["MarkerNode"](), Tracker(load_layout("layout.json"))
    assert {"thumb/markers", "image_raw"} == set(node.topics)
    for index, (rendered, encoding) in enumerate(zip(moving(2), ("bgr8", "rgb8"), strict=True)):
        node.publish_markers(image_message(rendered.image, encoding, 5 * 10**9 + index))
        cloud, truth = node.published[-1], tracker.track(rendered.image)
        assert isinstance(cloud.data, array) and cloud.data.typecode == "B"  # what ROS takes without a loop
        offsets = {field.name: field.offset for field in cloud.fields}
        bytes_of = np.frombuffer(cloud.data, np.uint8).reshape(cloud.width, cloud.point_step)
        for name, values in (("x_px", truth.markers.xy_px[:, 0]), ("dy", 1e-3 * truth.displacement_mm[:, 1])):
            got = bytes_of[:, offsets[name] : offsets[name] + 4].copy().view("<f4")[:, 0]
            np.testing.assert_array_equal(got, values.astype(np.float32))
        assert (cloud.header.frame_id, cloud.header.stamp.nanosec) == ("thumb", index)
        cloud.data = np.frombuffer(cloud.data, np.uint8)
        STORE.serialize_cdr(cloud, "sensor_msgs/msg/PointCloud2")


def test_other_encodings_are_refused(example: dict[str, Any]) -> None:
    message = image_message(np.zeros((4, 4, 3), np.uint8), "bgr8", 0)
    message.encoding = "mono8"
    with pytest.raises(ValueError, match="mono8; expected bgr8 or rgb8"):
        example["image_of"](message)
