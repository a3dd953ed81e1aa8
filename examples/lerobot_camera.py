"""A camera of LeRobot that is a tactile sensor: its images, each with the displacement of every marker.

LeRobot finds cameras in installed packages whose names begin with lerobot_camera_. Put this file into such a package as
__init__.py, and configure the camera with type: cmpdesign_tactile. ``markers`` holds the markers of the last image; a
robot's get_observation() returns them under the keys of ``cmpdesign export lerobot``:

    observation["tactile.displacement_mm"] = camera.markers.displacement_mm
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig

from cmpdesign.tracking.sources import SourceFrame, open_source
from extractor import Tracked, Tracker, load_layout


@CameraConfig.register_subclass("cmpdesign_tactile")
@dataclass(kw_only=True)
class TactileCameraConfig(CameraConfig):  # type: ignore[misc]
    """Options of the camera.

    Attributes:
        source: a camera's number, a stream's address or a video, as for ``cmpdesign track``.
        layout: path of the pattern's layout.json.
    """

    source: str = "0"
    layout: str = "layout.json"


class TactileCamera(Camera):  # type: ignore[misc]
    """Reads the sensor's camera and follows its markers.

    Attributes:
        markers: the tracked frame of the last image; None before the first.
    """

    def __init__(self, config: TactileCameraConfig) -> None:
        super().__init__(config)
        self._config = config
        self._frames: Iterator[SourceFrame] | None = None
        self._tracker: Tracker | None = None
        self.markers: Tracked | None = None

    @property
    def is_connected(self) -> bool:
        return self._frames is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        return []  # the system does not state which cameras are sensors

    def connect(self, warmup: bool = True) -> None:
        """Open the camera; with ``warmup``, the first image is the rest frame."""
        self._tracker = Tracker(load_layout(self._config.layout))
        self._frames = open_source(self._config.source).frames()
        if warmup:
            self.read()

    def read(self) -> np.ndarray:
        """The next image, (H, W, 3) uint8 RGB; ``markers`` belongs to it."""
        if self._frames is None or self._tracker is None:
            raise ConnectionError("the tactile camera is not connected; call connect()")
        frame = next(self._frames, None)
        if frame is None or frame.image is None:
            raise RuntimeError(
                f"the tactile camera gave no image ({frame.problem if frame else 'it stopped'})"
            )
        self.markers = self._tracker.track(frame.image, time_s=frame.time_s)
        return np.ascontiguousarray(frame.image[:, :, ::-1])

    def async_read(self, timeout_ms: float = 1000) -> np.ndarray:
        """As ``read``; raises TimeoutError where the image came too late."""
        started = time.monotonic()
        image = self.read()
        if time.monotonic() - started > timeout_ms / 1e3:
            raise TimeoutError(f"the image took longer than {timeout_ms:g} ms")
        return image

    def disconnect(self) -> None:
        """Close the camera."""
        self._frames = self._tracker = None
