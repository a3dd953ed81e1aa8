"""The response of IEC 61966-2-1 by its formulas, with the standard's constants."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def srgb_light(values: NDArray[Any]) -> Array:
    """The light, 0 to 255, of values 0 to 255."""
    value = np.asarray(values, np.float64) / 255
    return 255 * np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb_values(light: NDArray[Any]) -> Array:
    """The values, 0 to 255 and not rounded, of light 0 to 255."""
    share = np.clip(np.asarray(light, np.float64) / 255, 0, 1)
    return 255 * np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
