"""Settings of a camera: asked of its driver through OpenCV, and compared with what the driver answers."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from typing import Any

from cmpdesign.errors import SourceError, parameter

_V4L2 = "V4L2"  # the backend of Linux; the units of the others' controls differ from camera to camera
_DEVIATION = 0.02  # relative: a driver rounds to its own steps
_MANUAL_EXPOSURE, _AUTOMATIC_EXPOSURES = 1, (0, 3)  # V4L2_EXPOSURE_MANUAL, _AUTO, _APERTURE_PRIORITY
_EXPOSURE_PER_MS = 10.0  # V4L2 counts exposure in 100 us


@dataclass(frozen=True)
class CameraSettings:
    """What is asked of a camera; None: as the driver has it.

    Attributes:
        camera_size: width and height, px.
        camera_fps: frames per second.
        camera_format: four letters of the pixel format, as "MJPG" or "YUYV".
        exposure_ms: time of exposure, ms; automatic exposure is switched off.
        gain: in the driver's unit.
        white_balance_k: color temperature, K; automatic white balance is switched off.
        focus: in the driver's unit; automatic focus is switched off.

    Raises:
        SourceError: a size or a format that cannot be.
    """

    camera_size: tuple[int, int] | None = None
    camera_fps: float | None = None
    camera_format: str | None = None
    exposure_ms: float | None = None
    gain: float | None = None
    white_balance_k: float | None = None
    focus: float | None = None

    def __post_init__(self) -> None:
        if self.camera_format is not None and not re.fullmatch(r"[ -~]{4}", self.camera_format):
            raise SourceError(
                f"{parameter('camera_format')} {self.camera_format}: expected four letters, as in MJPG or YUYV"
            )

    @property
    def asked(self) -> dict[str, Any]:
        """The settings that are asked for."""
        return {name: value for name, value in asdict(self).items() if value is not None}


@dataclass(frozen=True)
class CameraState:
    """What a camera uses, as its driver answers; None where the driver does not say.

    Attributes:
        settings: all of ``CameraSettings``.
        automatic: names of the settings that the camera goes on choosing itself.
        asked: the settings that were asked for.
        backend: OpenCV's name of the driver's interface.
    """

    settings: CameraSettings
    automatic: tuple[str, ...]
    asked: CameraSettings
    backend: str

    @property
    def sends_jpeg(self) -> bool:
        """True if OpenCV can give the bytes of the camera's JPEGs."""
        return self.backend == _V4L2 and self.settings.camera_format in ("MJPG", "JPEG")

    def notes(self) -> list[str]:
        """One sentence for each difference from what was asked, and for what is automatic."""
        found = asdict(self.settings)
        notes = [
            f"{parameter(name)} {_text(value)} was asked for, the camera uses {_text(found[name])}"
            for name, value in self.asked.asked.items()
            if not _is_same(value, found[name])
        ]
        if self.automatic:
            options = ", ".join(parameter(name) for name in self.automatic)
            notes.append(
                f"the camera still chooses for itself: set {options} to values that suit the light, so that colors "
                "and times stay the same during the run"
            )
        return notes

    def to_json(self) -> dict[str, Any]:
        """For the summary of a run."""
        return {
            **asdict(self.settings),
            "automatic": self.automatic,
            "asked": self.asked.asked,
            "backend": self.backend,
        }


def set_camera(capture: Any, wanted: CameraSettings, name: str) -> CameraState:
    """Ask the driver of an open camera for settings, and read back what it uses.

    Args:
        capture: OpenCV's reader.
        wanted: the settings.
        name: for messages.

    Raises:
        SourceError: exposure, gain, white balance or focus of a camera that is not read through V4L2.
    """
    import cv2

    backend = str(capture.getBackendName())
    controls = ("exposure_ms", "gain", "white_balance_k", "focus")
    named = [each for each in controls if getattr(wanted, each) is not None]
    if named and backend != _V4L2:
        raise SourceError(
            f"{name}: {parameter(named[0])} can be set on Linux (V4L2), not through {backend}; set it with the "
            "program of the camera's maker, and leave the option out"
        )
    # The format first: sizes and rates depend on it.
    if wanted.camera_format is not None:
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*wanted.camera_format))
    if wanted.camera_size is not None:
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, wanted.camera_size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, wanted.camera_size[1])
    if wanted.camera_fps is not None:
        capture.set(cv2.CAP_PROP_FPS, wanted.camera_fps)
    if wanted.exposure_ms is not None:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL_EXPOSURE)
        capture.set(cv2.CAP_PROP_EXPOSURE, round(_EXPOSURE_PER_MS * wanted.exposure_ms))
    if wanted.gain is not None:
        capture.set(cv2.CAP_PROP_GAIN, wanted.gain)
    if wanted.white_balance_k is not None:
        capture.set(cv2.CAP_PROP_AUTO_WB, 0)
        capture.set(cv2.CAP_PROP_WB_TEMPERATURE, wanted.white_balance_k)
    if wanted.focus is not None:
        capture.set(cv2.CAP_PROP_AUTOFOCUS, 0)
        capture.set(cv2.CAP_PROP_FOCUS, wanted.focus)
    return _state(capture, wanted, backend)


def _state(capture: Any, wanted: CameraSettings, backend: str) -> CameraState:
    import cv2

    def value(key: int) -> float | None:
        found = float(capture.get(key))
        return found if found > 0 or (found == 0 and key in (cv2.CAP_PROP_GAIN, cv2.CAP_PROP_FOCUS)) else None

    width, height = value(cv2.CAP_PROP_FRAME_WIDTH), value(cv2.CAP_PROP_FRAME_HEIGHT)
    code = int(capture.get(cv2.CAP_PROP_FOURCC))
    letters = code.to_bytes(4, "little", signed=code < 0).decode("ascii", "replace")
    is_v4l2 = backend == _V4L2
    exposure = value(cv2.CAP_PROP_EXPOSURE) if is_v4l2 else None
    settings = CameraSettings(
        (int(width), int(height)) if width and height else None,
        value(cv2.CAP_PROP_FPS),
        letters if re.fullmatch(r"[ -~]{4}", letters) else None,
        None if exposure is None else exposure / _EXPOSURE_PER_MS,
        value(cv2.CAP_PROP_GAIN) if is_v4l2 else None,
        value(cv2.CAP_PROP_WB_TEMPERATURE) if is_v4l2 else None,
        value(cv2.CAP_PROP_FOCUS) if is_v4l2 else None,
    )
    automatic = []
    if is_v4l2 and exposure is not None and capture.get(cv2.CAP_PROP_AUTO_EXPOSURE) in _AUTOMATIC_EXPOSURES:
        automatic.append("exposure_ms")
    if is_v4l2 and settings.white_balance_k is not None and capture.get(cv2.CAP_PROP_AUTO_WB) == 1:
        automatic.append("white_balance_k")
    return CameraState(settings, tuple(automatic), wanted, backend)


def _is_same(asked: Any, found: Any) -> bool:
    if isinstance(asked, float | int) and isinstance(found, float | int):
        return abs(asked - found) <= _DEVIATION * abs(asked)
    return bool(asked == found)


def _text(value: Any) -> str:
    if value is None:
        return "a value that its driver does not tell"
    if isinstance(value, tuple):
        return "x".join(map(str, value))
    return f"{value:g}" if isinstance(value, float | int) else str(value)
