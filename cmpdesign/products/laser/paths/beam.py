"""The beam's footprint: an ellipse, because kerf differs between cuts along x and along y.

Everything about kerf is done in *beam units*, where x is divided by the ellipse's half-axis in x, y by the
one
in y: there the footprint is the unit disc, a sweep is a dilation by one, and areas shrink by the constant
factor ``x_mm * y_mm``. Straight sides stay straight and polygons stay convex.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True)
class BeamFootprint:
    """Half-axes of the footprint in mm: half the kerf of cuts that run in y (x) and in x (y)."""

    x_mm: float
    y_mm: float

    @classmethod
    def of_kerf(cls, kerf_x_mm: float, kerf_y_mm: float) -> BeamFootprint:
        return cls(kerf_x_mm / 2, kerf_y_mm / 2)

    @property
    def kerf_mm(self) -> tuple[float, float]:
        """Full widths of a cut that runs in y and of one that runs in x."""
        return 2 * self.x_mm, 2 * self.y_mm

    @property
    def narrow_mm(self) -> float:
        """The narrowest width of a cut in any direction."""
        return 2 * min(self.x_mm, self.y_mm)

    @property
    def area_factor(self) -> float:
        """Square millimetres in a square beam unit."""
        return self.x_mm * self.y_mm

    def units(self, xy_mm: Points) -> Points:
        """(..., 2) millimetres to beam units."""
        return np.asarray(xy_mm / (self.x_mm, self.y_mm))

    def millimetres(self, xy: Points) -> Points:
        """(..., 2) beam units to millimetres."""
        return np.asarray(xy * (self.x_mm, self.y_mm))

    def at_depth(self, depth_mm: float, taper_deg: float) -> BeamFootprint:
        """The footprint at a depth below the front; each wall leans inward by the taper.

        The half-axes may come out zero or negative: then the cut does not reach that deep.
        """
        narrowing = depth_mm * math.tan(math.radians(taper_deg))
        return BeamFootprint(self.x_mm - narrowing, self.y_mm - narrowing)
