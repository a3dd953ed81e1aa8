"""The compiled loop of ``encoding``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.drawing.coverage_compiled import compiled


@compiled
def fill_values(
    light: NDArray[np.float32],
    light_of_value: NDArray[np.float64],
    first: NDArray[np.int64],
    values: NDArray[np.float32],
) -> None:
    """Fill ``values`` (N,) with the values of ``light`` (N,).

    Args:
        light: 0 to 255 and more.
        light_of_value: (256,) the response.
        first: (S,) the last value with no more light than each of S equal steps of the square root of light has.
        values: the result.
    """
    last = len(light_of_value) - 2
    scale = (len(first) - 1) / np.sqrt(255.0)
    for i in range(len(light)):
        here = np.float64(light[i])
        if here <= light_of_value[0]:
            values[i] = 0.0
            continue
        value = first[min(int(np.sqrt(here) * scale), len(first) - 1)]
        while value < last and light_of_value[value + 1] <= here:
            value += 1
        # above the last value its step goes on: the sensor clips after the noise
        low, high = light_of_value[value], light_of_value[value + 1]
        values[i] = value + (here - low) / (high - low)
