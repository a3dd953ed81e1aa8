"""The ROS 2 package without ROS: a stand-in for rclpy checks every call, and rosbags writes every published message."""

from __future__ import annotations

import ast
import runpy
import sys
import time
from array import array
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from benchmarks.latency.timed_camera import Fault, TimedCamera, in_the_place_of_opencv, write_sensor
from cmpdesign.scene import Press
from tests.support.layouts import small_text
from tests.support.tracking.scenes import LAYERS, errors, shot

PACKAGE = Path(__file__).parents[2] / "ros" / "cmpdesign_ros"
NODE = PACKAGE / "cmpdesign_ros" / "node.py"
STORE = get_typestore(Stores.ROS2_HUMBLE)
MESSAGES = {
    "builtin_interfaces": ["Time"],
    "std_msgs": ["Header"],
    "sensor_msgs": ["PointCloud2", "PointField"],
    "geometry_msgs": ["Vector3", "Wrench", "WrenchStamped"],
    "diagnostic_msgs": ["DiagnosticArray", "DiagnosticStatus", "KeyValue"],
}


class Policy(Enum):
    KEEP_LAST = 1
    BEST_EFFORT = 2


class QoSProfile:
    def __init__(self, *, history: Policy, depth: int, reliability: Policy) -> None:
        assert history is Policy.KEEP_LAST and isinstance(depth, int)
        self.depth, self.reliability = depth, reliability


class Trigger:
    class Response:
        success, message = False, ""


class Publisher:
    """Writes what is published, as ROS would send it."""

    def __init__(self, kind: Any) -> None:
        self.kind, self.sent = kind, list[Any]()

    def publish(self, message: Any) -> None:
        assert type(message) is self.kind
        if hasattr(message, "data"):
            assert isinstance(message.data, array) and message.data.typecode == "B"
            message.data = np.frombuffer(message.data, np.uint8)
        for status in getattr(message, "status", ()):
            assert isinstance(status.level, bytes) and len(status.level) == 1
            assert all(isinstance(text, str) for pair in status.values for text in (pair.key, pair.value))
            status.level = status.level[0]
        STORE.serialize_cdr(message, message.__msgtype__)
        self.sent.append(message)


class Node:
    """The part of rclpy's node that the package uses."""

    parameters: dict[str, list[str]]

    def __init__(self, name: str) -> None:
        assert name == "cmpdesign"
        self.publishers, self.depths, self.services = (
            dict[str, Publisher](),
            dict[str, Any](),
            dict[str, Any](),
        )

    def declare_parameter(self, name: str, default: list[str]) -> SimpleNamespace:
        assert default and all(isinstance(text, str) for text in default)  # else its type is not known
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, kind: Any, topic: str, qos: QoSProfile | int) -> Publisher:
        assert topic[0] in "~/" and topic not in self.publishers
        self.publishers[topic], self.depths[topic] = Publisher(kind), qos
        return self.publishers[topic]

    def create_service(self, kind: Any, name: str, callback: Any) -> None:
        assert kind is Trigger
        self.services[name] = callback

    def get_clock(self) -> SimpleNamespace:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=time.time_ns()))


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch) -> None:
    def put(name: str, **members: Any) -> None:
        module = ModuleType(name)
        module.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, module)

    for package, names in MESSAGES.items():
        put(package)
        put(f"{package}.msg", **{name: STORE.types[f"{package}/msg/{name}"] for name in names})
    put("std_srvs")
    put("std_srvs.srv", Trigger=Trigger)
    put("rclpy")
    put("rclpy.node", Node=Node)
    put("rclpy.qos", QoSProfile=QoSProfile, HistoryPolicy=Policy, ReliabilityPolicy=Policy)
    put("rclpy.executors", ExternalShutdownException=type("ExternalShutdownException", (Exception,), {}))


@pytest.fixture
def node(ros: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The node over a camera, with what the camera shows."""
    (tmp_path / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    write_sensor(tmp_path / "thumb.toml", 0, 20.0)
    shown = {"images": [shot(seed=seed).image for seed in range(3)]}
    camera = TimedCamera(lambda number: shown["images"][number % 3], 20.0)
    monkeypatch.setattr(cv2, "VideoCapture", in_the_place_of_opencv({0: camera}))
    Node.parameters = {"sensors": [str(tmp_path / "thumb.toml")]}
    made = runpy.run_path(str(NODE), run_name="node")["SensorsNode"]()
    made.shown, made.camera = shown, camera
    yield made
    made.close()


def waited(published: list[Any], count: int) -> Any:
    end_s = time.monotonic() + 10
    while len(published) < count and time.monotonic() < end_s:
        time.sleep(0.01)
    assert len(published) >= count
    return published[-1]


def test_results_are_published(node: Any) -> None:
    markers, diagnostics = node.publishers["~/thumb/markers"], node.publishers["/diagnostics"]
    qos = node.depths["~/thumb/markers"]
    assert (qos.depth, qos.reliability) == (1, Policy.BEST_EFFORT)
    cloud = waited(markers.sent, 5)
    offsets = {field.name: field.offset for field in cloud.fields}
    rows = cloud.data.reshape(cloud.width, cloud.point_step)
    x, y = (rows[:, offsets[name] : offsets[name] + 4].copy().view("<f4")[:, 0] for name in ("x_px", "y_px"))
    assert errors(np.column_stack([x, y]), shot()).max() < 0.2
    taken_s = cloud.header.stamp.sec + 1e-9 * cloud.header.stamp.nanosec
    assert cloud.header.frame_id == "thumb" and 0 < time.time() - taken_s < 5
    (status,) = waited(diagnostics.sent, 5).status
    values = {pair.key: pair.value for pair in status.values}
    assert status.level == 0 and float(values["latency_ms"]) > 0 and int(values["dropped"]) >= 0

    answer = node.services["~/zero"](None, Trigger.Response())
    assert answer.success
    node.shown["images"] = [shot(surface=Press(4.0, 0.3), seed=seed).image for seed in range(3)]
    time.sleep(0.15)
    answer = node.services["~/zero"](None, Trigger.Response())
    assert not answer.success and "thumb: no rest frame: something touches the pattern" in answer.message

    node.camera.faults = [Fault("stall", 0.0, 1e6)]
    end_s = time.monotonic() + 10
    late: list[Any] = []
    while not late and time.monotonic() < end_s:
        late = [one.status[0] for one in diagnostics.sent if one.status[0].level == 2]
        time.sleep(0.02)
    assert "no frame for" in late[0].message


def test_the_package_names_what_it_imports(ros: None) -> None:
    tree = ElementTree.parse(PACKAGE / "package.xml").getroot()
    needed = {one.text for one in tree.iter("exec_depend")}
    imported = {
        node.module.split(".")[0]
        for node in ast.walk(ast.parse(NODE.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
    }
    own = {"__future__", "array", "threading", "typing", "cmpdesign"}
    assert imported - own <= needed and tree.findtext("export/build_type") == "ament_python"
    assert tree.findtext("name") == PACKAGE.name and (PACKAGE / "resource" / PACKAGE.name).exists()


def test_the_launch_file_starts_the_node(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, members in {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
    }.items():
        module = ModuleType(name)
        module.__dict__.update(
            {one: lambda *given, **named: SimpleNamespace(given=given, **named) for one in members}
        )
        monkeypatch.setitem(sys.modules, name, module)
    made = runpy.run_path(str(PACKAGE / "launch" / "sensors.launch.py"))["generate_launch_description"]()
    *arguments, node = made.given[0]
    assert [one.given[0] for one in arguments] == ["sensors", "outputs"] == list(node.parameters[0])
    captured: dict[str, Any] = {}
    monkeypatch.setattr("setuptools.setup", lambda **named: captured.update(named))
    runpy.run_path(str(PACKAGE / "setup.py"))
    assert captured["entry_points"]["console_scripts"] == [f"{node.executable} = cmpdesign_ros.node:main"]
    assert node.package == captured["name"] == PACKAGE.name
