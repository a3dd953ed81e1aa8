"""The response of a camera: the light behind each 8-bit value, and the values of light.

Lenses blur light, and cameras encode the blurred light afterwards (sRGB, IEC 61966-2-1, or similar). A response is a
table of the light of the 256 values; light is in units of 1/255 of the light of the value 255. Between two values a
response is a straight line, which differs from the sRGB curve by less than 0.002 units.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

VALUES = 256  # of 8 bits
SRGB_SLOPE, SRGB_STRAIGHT = 12.92, 0.04045  # of the straight line from 0, and the value where the line ends
SRGB_OFFSET, SRGB_EXPONENT = 0.055, 2.4  # of the curve above
MIN_EXPONENT, MAX_EXPONENT = 0.2, 5.0
# The sizes of the tables are also in native/image/response.hpp.
ENTRIES = 2048  # of the table that encodes light; equal steps of the square root of light
LIGHT_STEPS = 1 << 14  # steps of light from 0 to 255, for means of pixels
ALLOWED = "give 'srgb', 'linear', an exponent or a table of 256 values"

Response = Literal["srgb", "linear"] | float | Sequence[float] | NDArray[np.floating[Any]]


class ResponseTables(NamedTuple):
    """A response for compiled functions.

    Attributes:
        light: (256,) float32, the light of each value.
        encoded: (2 * ENTRIES,) float32, the value of light and its derivative by light, one after the other, at
            ``ENTRIES`` equal steps of the square root of light from 0 to 255.
        light_steps: (256,) uint16, the light of each value in ``LIGHT_STEPS`` steps, in the middle of a step.
        value_of_steps: (LIGHT_STEPS,) uint8, the nearest value of the light of each step.
    """

    light: NDArray[np.float32]
    encoded: NDArray[np.float32]
    light_steps: NDArray[np.uint16]
    value_of_steps: NDArray[np.uint8]


def light_of_values(response: Response) -> NDArray[np.float64]:
    """(256,) float64, 0 to 255: the light of each 8-bit value. The last one is 255.

    Args:
        response: "srgb"; "linear"; an exponent (light is value ** exponent, 0.2 to 5); or a table of the light of all
            256 values in any unit, each larger than the one before.

    Raises:
        ValueError: the response is none of these.
    """
    if isinstance(response, str):
        if response == "srgb":
            return _srgb_light()
        if response == "linear":
            return np.arange(VALUES, dtype=np.float64)
        raise ValueError(f"response is {response!r}; {ALLOWED}")
    numbers = np.asarray(response)
    if numbers.dtype.kind not in "iuf":
        raise ValueError(f"response is {response!r}; {ALLOWED}")
    if numbers.ndim == 0:
        exponent = float(numbers)
        if not MIN_EXPONENT <= exponent <= MAX_EXPONENT:
            raise ValueError(
                f"response is the exponent {exponent:g}; it must lie between {MIN_EXPONENT:g} and {MAX_EXPONENT:g}"
            )
        return np.asarray(255.0 * np.linspace(0.0, 1.0, VALUES) ** exponent)
    return _checked_table(numbers.astype(np.float64))


def _checked_table(table: NDArray[np.float64]) -> NDArray[np.float64]:
    if table.shape != (VALUES,):
        raise ValueError(
            f"response is a table of shape {table.shape}; give {VALUES} values, one for each 8-bit value"
        )
    if not (np.isfinite(table).all() and table[0] >= 0.0):
        raise ValueError("response is a table with negative or infinite light; give finite values from 0 on")
    steps = np.flatnonzero(np.diff(table) <= 0.0)
    if len(steps):
        raise ValueError(
            f"response is a table that does not rise from value {steps[0]} ({table[steps[0]]:g}) to the next "
            f"({table[steps[0] + 1]:g}); each value must stand for more light than the one before"
        )
    return np.asarray(255.0 * (table / table[-1]))


def _srgb_light() -> NDArray[np.float64]:
    """(256,) the light of each value by IEC 61966-2-1: a straight line, then a power of the value with an offset."""
    value = np.linspace(0.0, 1.0, VALUES)
    curve = ((value + SRGB_OFFSET) / (1.0 + SRGB_OFFSET)) ** SRGB_EXPONENT
    return np.asarray(255.0 * np.where(value <= SRGB_STRAIGHT, value / SRGB_SLOPE, curve))


def decode_values(values: NDArray[Any], light_of_value: NDArray[np.float64]) -> NDArray[np.float64]:
    """The light of any array of values 0 to 255, not necessarily whole; ``light_of_value`` (256,) is the response."""
    return np.asarray(np.interp(values, np.arange(VALUES, dtype=np.float64), light_of_value))


def encode_light(light: NDArray[Any], light_of_value: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values, not rounded, of any array of light; ``light_of_value`` (256,) is the response.

    More light than that of 255 has values above 255, because the response's last step continues: sensors clip after the
    noise.
    """
    values = np.interp(light, light_of_value, np.arange(VALUES, dtype=np.float64))
    return np.asarray(
        values + np.maximum(light - light_of_value[-1], 0.0) / (light_of_value[-1] - light_of_value[-2])
    )


def response_tables(light_of_value: NDArray[np.float64]) -> ResponseTables:
    """The tables of a response (256,)."""
    light = 255.0 * (np.arange(ENTRIES) / (ENTRIES - 1)) ** 2
    values = encode_light(light, light_of_value)
    # the derivative over the step of one value that holds the light
    step = np.clip(np.searchsorted(light_of_value, light, side="right") - 1, 0, VALUES - 2)
    slope = 1.0 / np.diff(light_of_value)[step]
    encoded = np.stack([values, slope], axis=1).astype(np.float32).reshape(-1)
    per_step = 255.0 / (LIGHT_STEPS - 1)
    steps = np.rint(light_of_value / per_step).astype(np.uint16)
    nearest = encode_light(per_step * np.arange(LIGHT_STEPS), light_of_value)
    return ResponseTables(
        light_of_value.astype(np.float32), encoded, steps, np.floor(nearest + 0.5).astype(np.uint8)
    )
