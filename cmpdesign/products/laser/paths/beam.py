"""The beam's footprint: an ellipse, because the kerf of cuts along x differs from the kerf of cuts along y.

Kerf compensation is computed in beam units: x is divided by the ellipse's half-axis in x, and y by the half-axis
in y. In beam units the footprint is the unit disc, a sweep of the beam is a dilation by one, and areas are smaller by
the factor ``x_mm * y_mm``. Straight sides stay straight and polygons stay convex.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True)
class BeamFootprint:
    """Half-axes of the footprint, mm: ``x_mm`` is half the kerf of cuts along y, ``y_mm`` of cuts along x.

    Both are 0 for paths that are not compensated: a beam without width has no beam units and burns the path itself.
    """

    x_mm: float
    y_mm: float

    @classmethod
    def of_kerf(cls, kerf_x_mm: float, kerf_y_mm: float) -> BeamFootprint:
        return cls(kerf_x_mm / 2, kerf_y_mm / 2)

    @property
    def kerf_mm(self) -> tuple[float, float]:
        """Full widths of a cut along y and of a cut along x."""
        return 2 * self.x_mm, 2 * self.y_mm

    @property
    def is_point(self) -> bool:
        """The beam has no width."""
        return self.x_mm == 0 and self.y_mm == 0

    @property
    def smallest_hole_mm(self) -> float:
        """The diameter of the smallest round hole: the largest radius of curvature of the footprint, twice."""
        narrow, wide = sorted(self.kerf_mm)
        return wide**2 / narrow if narrow > 0 else 0.0

    @property
    def narrow_mm(self) -> float:
        """The smallest width of a cut over all directions."""
        return 2 * min(self.x_mm, self.y_mm)

    @property
    def area_factor(self) -> float:
        """Square millimetres in a square beam unit."""
        return self.x_mm * self.y_mm

    def to_beam_units(self, xy_mm: Points) -> Points:
        """(..., 2) points from millimetres to beam units."""
        return np.asarray(xy_mm / (self.x_mm, self.y_mm))

    def to_millimetres(self, xy: Points) -> Points:
        """(..., 2) points from beam units to millimetres."""
        return np.asarray(xy * (self.x_mm, self.y_mm))

    def at_depth(self, depth_mm: float, taper_deg: float) -> BeamFootprint:
        """The footprint at a depth below the front, if each wall leans inward by the taper.

        Half-axes of zero or less mean that the cut does not reach this depth; a beam without width does not change.
        """
        if self.is_point:
            return self
        narrowing = depth_mm * math.tan(math.radians(taper_deg))
        return BeamFootprint(self.x_mm - narrowing, self.y_mm - narrowing)
