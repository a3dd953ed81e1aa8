"""From light to values: the camera's response, applied to every pixel.

``encode_light`` of the reader's ``response`` is the engine in plain numpy; ``_native.encoding`` is the same as a loop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.drawing.coverage import Engine
from cmpdesign.scene.parts.sensor import Sensor
from extractor.image.response import encode_light

Planes = NDArray[np.float32]
STEPS = 4096  # equal steps of the square root of light, each with the value at which its search begins


def encode_planes(sensor: Sensor, light: Planes, engine: Engine) -> Planes:
    """The values, not rounded, of light (any shape, 0 to 255); ``light`` itself for a linear response."""
    if sensor.response == "linear":
        return light
    light_of_value = sensor.light_of_values()
    if engine == "numpy":
        return encode_light(light, light_of_value).astype(np.float32)
    from cmpdesign._native import encoding

    step_light = 255.0 * (np.arange(STEPS) / (STEPS - 1)) ** 2
    first = np.clip(np.searchsorted(light_of_value, step_light, side="right") - 1, 0, len(light_of_value) - 2)
    values = np.empty_like(light, order="C")
    encoding.fill_values(np.ascontiguousarray(light).reshape(-1), light_of_value, first, values.reshape(-1))
    return values
