"""A scene: the parts of an image. Absent parts are not computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.scene.camera.medium import Medium
from cmpdesign.scene.camera.pinhole import Pinhole
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.background import Background, Plain
from cmpdesign.scene.parts.damage import Damage
from cmpdesign.scene.parts.light import Light
from cmpdesign.scene.parts.optics import Optics
from cmpdesign.scene.parts.sensor import Sensor
from cmpdesign.scene.parts.surface import Surface

RGB = tuple[float, float, float]
Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """All parts of one image.

    Attributes:
        layout: the pattern.
        camera: the camera; a tuple of pinholes are views that share one image.
        surface: the surface's state, a map of (N, 2) mm to (N, 2) or (N, 3) mm; None: flat, as designed.
        light: None: white and uniform.
        background: the background behind the pattern's outline.
        optics: the blur; None: no blur.
        sensor: None: no noise, 8 bits.
        damage: None: no damage.
        inks: RGB 0 to 255 by color name; replaces colors of the layout's palette.
        seed: seed of all random parts; the same scene gives the same bytes.
        frame: number in a sequence; only the noise depends on it.
        warnings: reasons to doubt the parts, passed on with the image.
        medium: window and gel between the pattern and the camera; None or layers of 0 mm: air.
    """

    layout: Layout
    camera: Camera | Pinhole | tuple[Pinhole, ...] = field(default_factory=Camera)
    surface: Surface | Callable[[Points], Points] | None = None
    light: Light | None = None
    background: Background = field(default_factory=Plain)
    optics: Optics | None = None
    sensor: Sensor | None = None
    damage: Damage | None = None
    inks: Mapping[str, RGB] = field(default_factory=dict)
    seed: int = 0
    frame: int = 0
    warnings: tuple[str, ...] = ()
    medium: Medium | None = None

    def __post_init__(self) -> None:
        if self.medium is not None and self.medium.is_air:
            object.__setattr__(self, "medium", None)
        if isinstance(self.camera, tuple) and not self.camera:
            raise SceneError("the scene has no view; give at least one Pinhole")
        for name in self.inks:
            if name not in COLORS:
                raise SceneError(f"ink {name!r} is unknown; the inks are {', '.join(COLORS)}")
        object.__setattr__(self, "inks", MappingProxyType(dict(self.inks)))

    @property
    def blur_px(self) -> float:
        return self.optics.blur_px if self.optics else 0.0

    def ink(self, color: int) -> RGB:
        """RGB, 0 to 255, of a color of the layout (an index into ``COLORS``).

        Raises:
            SceneError: neither the scene nor the layout's palette has this ink.
        """
        name = COLORS[color]
        if name in self.inks:
            return self.inks[name]
        if name not in self.layout.palette:
            raise SceneError(f"the layout's palette has no {name}; give it in the scene's inks")
        digits = self.layout.palette[name].lstrip("#")
        return int(digits[0:2], 16), int(digits[2:4], 16), int(digits[4:6], 16)
