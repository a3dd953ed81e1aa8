"""The sensor: the camera's response, noise, quantisation and JPEG, in this order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError
from extractor.image.response import light_of_values

Depth = TypeVar("Depth", np.uint8, np.uint16)


@dataclass(frozen=True)
class Sensor:
    """The image sensor.

    Attributes:
        noise: sigma of the white Gaussian noise of the encoded picture, in units of an 8-bit step (noise 2 is 2/255).
        response: relation of light and values: "srgb", "linear", an exponent (light is value ** exponent), or a table
            of the light of all 256 values. Colors of inks, backgrounds and dirt are the values that they have in a
            picture without blur and noise.
        bits: 8 or 16.
        jpeg_quality: 1 to 100; None: no compression. 8 bits only.
    """

    __pydantic_config__: ClassVar = STRICT

    noise: float = 0.0
    response: Literal["srgb", "linear"] | float | tuple[float, ...] = "srgb"
    bits: int = 8
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.noise <= 255:
            raise SceneError(f"noise is {self.noise:g}; it must lie between 0 and 255 8-bit steps")
        try:
            self.light_of_values()
        except ValueError as error:
            raise SceneError(str(error)) from None
        if self.bits not in (8, 16):
            raise SceneError(f"bits is {self.bits}; it must be 8 or 16")
        if self.jpeg_quality is not None and not (1 <= self.jpeg_quality <= 100 and self.bits == 8):
            raise SceneError(
                f"jpeg_quality is {self.jpeg_quality} at {self.bits} bits; it must be 1 to 100, at 8 bits"
            )

    def light_of_values(self) -> NDArray[np.float64]:
        """(256,) 0 to 255: the light of each 8-bit value."""
        return light_of_values(self.response)


def encoding_slope(sensor: Sensor, light: NDArray[np.float64]) -> NDArray[np.float64]:
    """The derivative of the value by light, of any array of light (0 to 255); 0 where the sensor clips."""
    light_of_value = sensor.light_of_values()
    step = np.clip(np.searchsorted(light_of_value, light, side="right") - 1, 0, len(light_of_value) - 2)
    slope = 1.0 / np.diff(light_of_value)[step]
    return np.where((light < 0) | (light > light_of_value[-1]), 0.0, slope)


def expose_sensor(
    sensor: Sensor, values: NDArray[np.float32], rng: np.random.Generator
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """The image (H, W, 3) of encoded values (3, H, W) float32, 0 to 255, channels B, G, R; uint8 or uint16."""
    if sensor.noise:
        exposed = rng.standard_normal(values.shape, dtype=np.float32)
        exposed *= np.float32(sensor.noise)
        exposed += values
    else:
        exposed = values.copy()
    if sensor.bits == 16:
        exposed *= 257
        return _interleave_planes(_quantised(exposed, np.uint16))
    eight = _interleave_planes(_quantised(exposed, np.uint8))
    return eight if sensor.jpeg_quality is None else _jpeg_roundtrip(eight, sensor.jpeg_quality)


def _quantised(values: NDArray[np.float32], depth: type[Depth]) -> NDArray[Depth]:
    """Whole numbers of the depth's range; ``values`` are overwritten."""
    np.rint(values, out=values)
    return np.clip(values, 0, np.iinfo(depth).max, out=values).astype(depth)


def _interleave_planes(planes: NDArray[Depth]) -> NDArray[Depth]:
    return np.ascontiguousarray(planes.transpose(1, 2, 0))


def _jpeg_roundtrip(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    import cv2

    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
