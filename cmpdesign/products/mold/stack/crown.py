"""The crown of a domed pad: its height over the plan, and how a flat pattern comes on it.

Every surface of a domed pad is the same crown, moved along z. So thicknesses are constant along the
direction in which the mold opens, all parts pull straight, and one lid fits every layer; measured at right
angles to the surface, a layer is thinner by the cosine of the slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mold.solids.loops import Points

# Steeper walls of a pad are seen at a grazing angle and no longer pull straight off the plates.
STEEPEST_DEG = 60.0
# The ends of a cylindrical crown lean like this: upright ones would tear every layer, which has no thickness there.
END_SLOPE = 1.0


@dataclass(frozen=True)
class Crown:
    """A spherical or cylindrical (axis along y) cap; a cylinder is cut off at both ends by planes at 45 degrees.

    Attributes:
        radius_mm: of the sphere or cylinder.
        reach_mm: half width of the cap at its foot, where its height is 0.
        length_mm: half length of a cylindrical cap in y at its foot; the reach of a spherical one.
    """

    shape: Literal["sphere", "cylinder"]
    radius_mm: float
    reach_mm: float
    length_mm: float

    @property
    def height_mm(self) -> float:
        """At the apex, over the foot."""
        return float(self.radius_mm - np.sqrt(self.radius_mm**2 - self.reach_mm**2))

    @property
    def slope_deg(self) -> float:
        """At the foot, where it is steepest."""
        return float(np.degrees(np.arcsin(self.reach_mm / self.radius_mm)))

    def z_mm(self, xy_mm: Points) -> NDArray[np.float64]:
        """(N,) height over the foot."""
        away = np.hypot(*xy_mm.T) if self.shape == "sphere" else np.abs(xy_mm[:, 0])
        away = np.minimum(away, self.reach_mm)
        heights: NDArray[np.float64] = np.sqrt(self.radius_mm**2 - away**2) - np.sqrt(
            self.radius_mm**2 - self.reach_mm**2
        )
        if self.shape == "cylinder":
            heights = np.clip(END_SLOPE * (self.length_mm - np.abs(xy_mm[:, 1])), 0, heights)
        return heights

    def volume_mm3(self) -> float:
        """Closed form: a spherical cap, or a circular segment times its length, less what the ends cut off."""
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
    """Where a flat pattern's points lie in plan once it is on the crown.

    "equidistant" keeps the lengths from the apex (sphere: the azimuthal equidistant projection; cylinder: the
    unrolled sheet); "vertical" leaves the plan as it is.
    """
    if projection == "vertical":
        return xy_mm
    if shape == "cylinder":
        return np.stack([radius_mm * np.sin(xy_mm[:, 0] / radius_mm), xy_mm[:, 1]], axis=-1)
    away = np.hypot(*xy_mm.T)
    shrink = np.sinc(away / radius_mm / np.pi)
    plan: Points = xy_mm * shrink[:, None]
    return plan
