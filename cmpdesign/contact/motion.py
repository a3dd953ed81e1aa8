"""The motion of the object: a press, then shear and twist together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.errors import require

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """The object's final pose, relative to the pose in which it just touches the flat surface.

    Attributes:
        press_mm: distance along -z; 0 or more.
        shear_mm: distances in x and y, after the press.
        twist_deg: rotation about the object's centre, counter-clockwise from the front, together with the shear.
    """

    press_mm: float
    shear_mm: tuple[float, float] = (0.0, 0.0)
    twist_deg: float = 0.0

    def __post_init__(self) -> None:
        require(
            math.isfinite(self.press_mm) and self.press_mm >= 0, "press_mm", f"{self.press_mm:g}", "0 or more"
        )
        good = len(self.shear_mm) == 2 and all(math.isfinite(value) for value in self.shear_mm)
        require(good, "shear_mm", self.shear_mm, "two finite lengths, x and y")
        good = math.isfinite(self.twist_deg) and abs(self.twist_deg) <= 180
        require(good, "twist_deg", f"{self.twist_deg:g}", "from -180 to 180")

    @property
    def tangential(self) -> bool:
        """Whether there is shear or twist."""
        return self.twist_deg != 0 or any(self.shear_mm)

    def part(self, of_press: float, of_rest: float) -> Motion:
        """The motion up to a fraction of its press, and a fraction of its shear and twist."""
        x, y = self.shear_mm
        return Motion(of_press * self.press_mm, (of_rest * x, of_rest * y), of_rest * self.twist_deg)

    def carried(self, xy_mm: Array, centre_mm: tuple[float, float]) -> Array:
        """Positions of points (2, ...) fixed to the object after shear and twist about ``centre_mm``."""
        c, s = np.cos(np.radians(self.twist_deg)), np.sin(np.radians(self.twist_deg))
        x, y = xy_mm[0] - centre_mm[0], xy_mm[1] - centre_mm[1]
        moved_x = centre_mm[0] + self.shear_mm[0] + c * x - s * y
        moved_y = centre_mm[1] + self.shear_mm[1] + s * x + c * y
        return np.stack([moved_x, moved_y])

    def brought_back(self, xy_mm: Array, centre_mm: tuple[float, float]) -> Array:
        """The inverse of ``carried``."""
        c, s = np.cos(np.radians(self.twist_deg)), np.sin(np.radians(self.twist_deg))
        x = xy_mm[0] - centre_mm[0] - self.shear_mm[0]
        y = xy_mm[1] - centre_mm[1] - self.shear_mm[1]
        return np.stack([centre_mm[0] + c * x + s * y, centre_mm[1] - s * x + c * y])
