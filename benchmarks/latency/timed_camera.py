"""A camera with known exposure times in the place of OpenCV's, which stalls and fails as told, and its sensor file."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

Size = tuple[int, int]
BUFFERS = 4  # frames that a driver keeps for a slow reader; then the oldest is lost


@dataclass(frozen=True)
class Fault:
    """What a camera does for a time: "stall" (a read waits), "unplugged" (reads and opening fail), "small" (half size).

    ``begin_s`` and ``end_s`` count from the camera's first frame.
    """

    kind: str
    begin_s: float
    end_s: float


@dataclass(eq=False)
class TimedCamera:
    """A camera whose exposure k ends at ``began_s + k / fps`` on the clock ``time.monotonic``.

    Attributes:
        images: shown in turn; or a function of the frame's number.
        fps: frames per second.
        faults: what it does wrong, and when.
        exposure_ms: what the driver tells.
        opened: how often it was opened.
    """

    images: Sequence[Any] | Callable[[int], Any]
    fps: float
    faults: Sequence[Fault] = ()
    exposure_ms: float = 4.0
    began_s: float = field(default_factory=time.monotonic)
    opened: int = 0

    def fault(self) -> str:
        """The kind of the present fault; "" without one."""
        now_s = time.monotonic() - self.began_s
        return next((each.kind for each in self.faults if each.begin_s <= now_s < each.end_s), "")

    def image(self, number: int) -> Any:
        """The image of a frame."""
        shown = self.images(number) if callable(self.images) else self.images[number % len(self.images)]
        return np.ascontiguousarray(shown[::2, ::2]) if self.fault() == "small" else shown


class OpenedCamera:
    """One opening of a ``TimedCamera``; has the methods of ``cv2.VideoCapture`` that the reader calls."""

    def __init__(self, camera: TimedCamera | None) -> None:
        self._camera, self._next, self._stamp_s, self._is_released = camera, -1, 0.0, False
        if camera is not None:
            camera.opened += 1

    def isOpened(self) -> bool:
        """False while it is unplugged."""
        return self._camera is not None and self._camera.fault() != "unplugged"

    def getBackendName(self) -> str:
        """As on Linux, so that settings are asked for."""
        return "V4L2"

    def set(self, key: int, value: float) -> bool:
        """Take a setting."""
        return True

    def get(self, key: int) -> float:
        """The time stamp, the size and the exposure."""
        camera = self._camera
        if camera is None:
            return -1.0
        height, width = camera.image(0).shape[:2]
        values = {
            cv2.CAP_PROP_POS_MSEC: 1e3 * self._stamp_s,
            cv2.CAP_PROP_FRAME_WIDTH: width,
            cv2.CAP_PROP_FRAME_HEIGHT: height,
            cv2.CAP_PROP_FPS: camera.fps,
            cv2.CAP_PROP_EXPOSURE: 10 * camera.exposure_ms,
            cv2.CAP_PROP_AUTO_EXPOSURE: 1,
        }
        return float(values.get(key, -1.0))

    def read(self) -> tuple[bool, Any]:
        """The next frame whose exposure has ended, waited for; False while it is unplugged."""
        camera = self._camera
        while camera is not None and not self._is_released and camera.fault() != "unplugged":
            ended = math.floor(
                (time.monotonic() - camera.began_s) * camera.fps
            )  # -1 before the first exposure
            self._next = max(self._next, ended - BUFFERS + 1) if self._next >= 0 else max(ended, 0)
            if self._next <= ended and camera.fault() != "stall":
                self._stamp_s = camera.began_s + self._next / camera.fps
                self._next += 1
                return True, camera.image(self._next - 1)
            wait_s = camera.began_s + self._next / camera.fps - time.monotonic()
            time.sleep(min(max(wait_s, 1e-4), 0.02))
        return False, None

    def release(self) -> None:
        """Give it back."""
        self._is_released = True


def write_sensor(
    path: Path, source: int | str, fps: float, focal_px: float = 500.0, size: Size = (320, 240)
) -> None:
    """A sensor file of one camera, beside its layout.json; pixel (0, 0) is centred at (0, 0)."""
    centre = [(side - 1) / 2 for side in size]
    path.write_text(
        f'layout = "layout.json"\n[[view]]\nname = "camera"\nfocal_px = [{focal_px}, {focal_px}]\n'
        f'centre_px = {centre}\n[camera]\nsource = "{source}"\nfps = {fps}\n',
        encoding="utf-8",
    )


def in_the_place_of_opencv(cameras: dict[int, TimedCamera]) -> Callable[..., OpenedCamera]:
    """What stands for ``cv2.VideoCapture``: opens these cameras by their numbers."""

    def opened(number: int, backend: int = 0) -> OpenedCamera:
        return OpenedCamera(cameras.get(number))

    return opened
