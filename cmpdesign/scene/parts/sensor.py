"""The sensor: noise, gamma, quantisation and JPEG, in this order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError

Depth = TypeVar("Depth", np.uint8, np.uint16)


@dataclass(frozen=True)
class Sensor:
    """The image sensor.

    Attributes:
        noise: sigma of the white Gaussian noise, in units of an 8-bit step (noise 2 is 2/255).
        gamma: out = 255 (in / 255) ** gamma, after the noise; 1: linear.
        bits: 8 or 16.
        jpeg_quality: 1 to 100; None: no compression. 8 bits only.
    """

    __pydantic_config__: ClassVar = STRICT

    noise: float = 0.0
    gamma: float = 1.0
    bits: int = 8
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.noise <= 255:
            raise SceneError(f"noise is {self.noise:g}; it must lie between 0 and 255 8-bit steps")
        if not 0.1 <= self.gamma <= 10:
            raise SceneError(f"gamma is {self.gamma:g}; it must lie between 0.1 and 10")
        if self.bits not in (8, 16):
            raise SceneError(f"bits is {self.bits}; it must be 8 or 16")
        if self.jpeg_quality is not None and not (1 <= self.jpeg_quality <= 100 and self.bits == 8):
            raise SceneError(
                f"jpeg_quality is {self.jpeg_quality} at {self.bits} bits; it must be 1 to 100, at 8 bits"
            )


def expose_sensor(
    sensor: Sensor, planes: NDArray[np.float32], rng: np.random.Generator
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """The image (H, W, 3) of planes (3, H, W) float32 in 8-bit units, channels B, G, R; uint8 or uint16."""
    light = planes
    if sensor.noise:
        light = rng.standard_normal(planes.shape, dtype=np.float32)
        light *= np.float32(sensor.noise)
        light += planes
    if sensor.gamma != 1.0:
        light = 255 * np.power(np.maximum(light, 0) / 255, np.float32(sensor.gamma), dtype=np.float32)
    if sensor.bits == 16:
        return _interleave_planes(np.clip(np.rint(light * 257), 0, 65535).astype(np.uint16))
    eight = _interleave_planes(np.clip(np.rint(light), 0, 255).astype(np.uint8))
    return eight if sensor.jpeg_quality is None else _jpeg_roundtrip(eight, sensor.jpeg_quality)


def _interleave_planes(planes: NDArray[Depth]) -> NDArray[Depth]:
    return np.ascontiguousarray(planes.transpose(1, 2, 0))


def _jpeg_roundtrip(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    import cv2

    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
