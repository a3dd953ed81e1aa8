"""The example of a LeRobot camera, run without LeRobot: images as the robot gets them, with their markers."""

from __future__ import annotations

import runpy
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.layouts import small_text
from tests.support.tracking.scenes import LAYERS, moving

EXAMPLE = Path(__file__).parents[2] / "examples" / "lerobot_camera.py"
REGISTERED: dict[str, type] = {}


@dataclass(kw_only=True)
class CameraConfig:
    """The part of LeRobot's configuration that the example uses."""

    fps: int | None = None
    width: int | None = None
    height: int | None = None

    @staticmethod
    def register_subclass(name: str) -> Any:
        def register(kind: type) -> type:
            REGISTERED[name] = kind
            return kind

        return register


class Camera:
    def __init__(self, config: CameraConfig) -> None:
        self.fps = config.fps


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    cameras = ModuleType("lerobot.cameras")
    cameras.Camera, cameras.CameraConfig = Camera, CameraConfig  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "lerobot", ModuleType("lerobot"))
    monkeypatch.setitem(sys.modules, "lerobot.cameras", cameras)
    monkeypatch.chdir(tmp_path)
    Path("layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    Path("frames").mkdir()
    for index, rendered in enumerate(moving(3)):
        cv2.imwrite(f"frames/{index}.png", rendered.image)
    return runpy.run_path(str(EXAMPLE), run_name="lerobot_camera")


def test_images_come_with_their_markers(example: dict[str, Any]) -> None:
    config = REGISTERED["cmpdesign_tactile"](source="frames", fps=30)
    assert type(config) is example["TactileCameraConfig"]
    camera = example["TactileCamera"](config)
    assert not camera.is_connected and camera.markers is None and camera.find_cameras() == []
    with pytest.raises(ConnectionError, match="call connect"):
        camera.read()
    camera.connect()
    assert camera.is_connected and not camera.markers.displacement_mm.any()
    for index, read in ((1, camera.read), (2, camera.async_read)):
        picture = cv2.imread(f"frames/{index}.png")
        assert picture is not None
        np.testing.assert_array_equal(read(), picture[:, :, ::-1])
        assert camera.markers.index == index and np.isfinite(camera.markers.displacement_mm).all()
        assert np.abs(camera.markers.displacement_mm).max() > 0.01
    with pytest.raises(RuntimeError, match="it stopped"):
        camera.read()
    camera.disconnect()
    assert not camera.is_connected


def test_a_late_image_is_a_timeout(example: dict[str, Any]) -> None:
    camera = example["TactileCamera"](example["TactileCameraConfig"](source="frames"))
    camera.connect(warmup=False)
    with pytest.raises(TimeoutError, match="longer than 0 ms"):
        camera.async_read(timeout_ms=0)
