"""The light: a smooth gain of each channel, fixed to the camera's image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError

RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Led:
    """A light at the image's rim.

    Attributes:
        angle_deg: direction from the image's centre, counter-clockwise from the right.
        rgb: gain of each channel at the rim.
        reach: distance, in half diagonals of the image, over which the gain falls by exp(-1/2).
    """

    __pydantic_config__: ClassVar = STRICT

    angle_deg: float
    rgb: RGB
    reach: float = 1.0


@dataclass(frozen=True)
class Light:
    """Gain of every pixel: (ambient * gradient + LEDs) * vignetting.

    Attributes:
        rgb: the ambient light's gain of each channel; (1, 1, 1) keeps the inks' colors.
        gradient: relative change of the ambient light from the centre to the right and to the upper side.
        vignetting: relative loss in the image's corners, proportional to the squared distance; 0 to 1.
        leds: further lights at the rim.
    """

    __pydantic_config__: ClassVar = STRICT

    rgb: RGB = (1.0, 1.0, 1.0)
    gradient: tuple[float, float] = (0.0, 0.0)
    vignetting: float = 0.0
    leds: tuple[Led, ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.vignetting <= 1:
            raise SceneError(f"vignetting is {self.vignetting:g}; it must lie between 0 and 1")
        for led in self.leds:
            if not led.reach > 0:
                raise SceneError(f"an LED's reach is {led.reach:g}; it must be above 0 half diagonals")


def light_gain(light: Light, size: tuple[int, int]) -> NDArray[np.float32]:
    """(3, height, width) float32 gain, channels B, G, R, never negative, for an image of (width, height) px.

    The gain varies slowly, so it multiplies the blurred image.
    """
    width, height = size
    x = np.linspace(-1.0, 1.0, width, dtype=np.float32)[None, :]
    y = np.linspace(1.0, -1.0, height, dtype=np.float32)[:, None]
    ambient = np.maximum(1 + light.gradient[0] * x + light.gradient[1] * y, 0)
    gain = np.stack([np.broadcast_to(level * ambient, (height, width)) for level in light.rgb[::-1]])
    diagonal = np.hypot(width, height)
    for led in light.leds:
        angle = np.radians(led.angle_deg)
        across = (x - np.cos(angle)) * np.float32(width / diagonal)
        up = (y - np.sin(angle)) * np.float32(height / diagonal)
        falloff = np.exp(-0.5 * (across**2 + up**2) / np.float32(led.reach) ** 2)
        gain = gain + np.asarray(led.rgb[::-1], dtype=np.float32)[:, None, None] * falloff
    if light.vignetting:
        gain = gain * (1 - np.float32(light.vignetting) * 0.5 * (x**2 + y**2))
    return np.ascontiguousarray(gain, dtype=np.float32)


def colored_leds(count: int = 3, strength: float = 0.7, ambient: float = 0.35, reach: float = 0.7) -> Light:
    """One to three LEDs at equal angles, red, green and blue in turn, over a weak white light.

    Raises:
        SceneError: another number of LEDs.
    """
    if not 1 <= count <= 3:
        raise SceneError(f"count is {count}; colored_leds has 1 to 3 LEDs")
    weak = 0.25 * strength
    colors = [(strength, weak, weak), (weak, strength, weak), (weak, weak, strength)]
    leds = tuple(Led(90 + 360 * i / count, colors[i], reach) for i in range(count))
    return Light(rgb=(ambient, ambient, ambient), leds=leds)
