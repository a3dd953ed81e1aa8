"""The crown of a domed pad: its height over the plan, and the projection of a flat pattern on the crown.

Every surface of a domed pad is the same crown, moved along z. Thicknesses are therefore constant along the direction
in which the mold opens, all parts pull straight, and one lid fits every silicone layer. Measured at right angles to the
surface, a silicone layer is thinner by the cosine of the slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mold.solids.loops import Points

# Steepest slope of a crown. The camera sees steeper surfaces at a grazing angle, and plates do not pull off them.
STEEPEST_DEG = 60.0
# Slope of the ends of a cylindrical crown. At upright ends every silicone layer would have no thickness and tear.
END_SLOPE = 1.0


@dataclass(frozen=True)
class Crown:
    """A spherical or cylindrical (axis along y) cap; a cylinder is cut off at both ends by planes at 45 degrees.

    Attributes:
        shape: "sphere" or "cylinder".
        radius_mm: radius of the sphere or cylinder.
        reach_mm: half width of the cap at its foot, where the height is 0.
        length_mm: half length in y of a cylindrical cap at its foot; ``reach_mm`` of a spherical cap.
    """

    shape: Literal["sphere", "cylinder"]
    radius_mm: float
    reach_mm: float
    length_mm: float

    @property
    def height_mm(self) -> float:
        """Height of the apex over the foot."""
        return float(self.radius_mm - np.sqrt(self.radius_mm**2 - self.reach_mm**2))

    @property
    def slope_deg(self) -> float:
        """Slope at the foot, the steepest of the crown."""
        return float(np.degrees(np.arcsin(self.reach_mm / self.radius_mm)))

    def z_mm(self, xy_mm: Points) -> NDArray[np.float64]:
        """(N,) height over the foot at (N, 2) points in plan."""
        distance = np.hypot(*xy_mm.T) if self.shape == "sphere" else np.abs(xy_mm[:, 0])
        distance = np.minimum(distance, self.reach_mm)
        heights: NDArray[np.float64] = np.sqrt(self.radius_mm**2 - distance**2) - np.sqrt(
            self.radius_mm**2 - self.reach_mm**2
        )
        if self.shape == "cylinder":
            heights = np.clip(END_SLOPE * (self.length_mm - np.abs(xy_mm[:, 1])), 0, heights)
        return heights

    def volume_mm3(self) -> float:
        """Volume in closed form: a spherical cap, or a circular segment times length, less the volume cut off."""
        height, radius = self.height_mm, self.radius_mm
        if self.shape == "sphere":
            return float(np.pi * height**2 * (3 * radius - height) / 3)
        half = np.arcsin(self.reach_mm / radius)
        level = radius - height
        under_arc = self.reach_mm * level + radius**2 * half
        segment = under_arc - 2 * self.reach_mm * level
        # The segment's first moment over its chord: the integral of z^2 / 2.
        moment = self.reach_mm * (radius**2 + level**2 - self.reach_mm**2 / 3) - level * under_arc
        return float(2 * (self.length_mm * segment - moment / END_SLOPE))


def project_on_crown(xy_mm: Points, shape: str, radius_mm: float, projection: str) -> Points:
    """Project the points of a flat pattern on a crown.

    Args:
        xy_mm: (N, 2) points of the flat pattern.
        shape: "sphere" or "cylinder".
        radius_mm: radius of the crown.
        projection: "equidistant" keeps lengths from the apex (sphere: azimuthal equidistant projection; cylinder:
            unrolled sheet); "vertical" leaves the points as they are.

    Returns:
        (N, 2) places in plan, mm.
    """
    if projection == "vertical":
        return xy_mm
    if shape == "cylinder":
        return np.stack([radius_mm * np.sin(xy_mm[:, 0] / radius_mm), xy_mm[:, 1]], axis=-1)
    distance = np.hypot(*xy_mm.T)
    factor = np.sinc(distance / radius_mm / np.pi)
    plan: Points = xy_mm * factor[:, None]
    return plan


def project_from_crown(plan_mm: Points, shape: str, radius_mm: float, projection: str) -> Points:
    """The points (N, 2) of the flat pattern at places in plan; the inverse of ``project_on_crown``."""
    if projection == "vertical":
        return plan_mm
    if shape == "cylinder":
        return np.stack([radius_mm * np.arcsin(plan_mm[:, 0] / radius_mm), plan_mm[:, 1]], axis=-1)
    sine = np.hypot(*plan_mm.T) / radius_mm
    flat: Points = plan_mm * np.where(sine > 0, np.arcsin(sine) / np.where(sine > 0, sine, 1.0), 1.0)[:, None]
    return flat
