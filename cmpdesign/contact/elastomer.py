"""The elastic layer: bonded to a rigid support below, loaded from above."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cmpdesign.contact.errors import require


@dataclass(frozen=True)
class Elastomer:
    """A linear elastic layer of uniform thickness, bonded to a rigid support.

    Attributes:
        thickness_mm: h, above 0.
        young_mpa: Young's modulus, above 0. Forces are proportional to it; displacements do not depend on it.
        poisson: 0 to 0.5; silicones are nearly incompressible, 0.5.
        marker_depth_mm: depth of the pattern below the touched surface, from 0 to below the thickness. The pattern
            moves as the elastic layer does at that depth. Forces and the touched surface do not depend on it.

    Raises:
        ContactError: a value out of range.
    """

    thickness_mm: float
    young_mpa: float
    poisson: float = 0.5
    marker_depth_mm: float = 0.0

    def __post_init__(self) -> None:
        for name in ("thickness_mm", "young_mpa"):
            value = getattr(self, name)
            require(math.isfinite(value) and value > 0, name, f"{value:g}", "above 0 and finite")
        require(0 <= self.poisson <= 0.5, "poisson", f"{self.poisson:g}", "from 0 to 0.5 (incompressible)")
        require(
            0 <= self.marker_depth_mm < self.thickness_mm,
            "marker_depth_mm",
            f"{self.marker_depth_mm:g}",
            f"from 0 to below thickness_mm, {self.thickness_mm:g}",
        )

    @property
    def shear_mpa(self) -> float:
        """The shear modulus E / (2 (1 + nu))."""
        return self.young_mpa / (2 * (1 + self.poisson))
