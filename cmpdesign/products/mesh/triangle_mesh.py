"""A named, colored triangle mesh in mm, the input of all mesh writers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A closed triangle mesh.

    Attributes:
        name: name of the mold part or silicone layer.
        color: "#rrggbb".
        points: (P, 3) float64, mm.
        triangles: (T, 3) int64, counter-clockwise from outside.
    """

    name: str
    color: str
    points: NDArray[np.float64]
    triangles: NDArray[np.int64]

    def volume_mm3(self) -> float:
        """The enclosed volume: the sum of the tetrahedra between the triangles and the first point."""
        a, b, c = np.moveaxis((self.points - self.points[0])[self.triangles], 1, 0)
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)

    def moved(self, x_mm: float, y_mm: float, z_mm: float, turned: bool = False) -> TriangleMesh:
        """The mesh after a translation; ``turned`` first turns the mesh about the x axis by 180 degrees."""
        flip = np.array([1.0, -1.0, -1.0]) if turned else np.ones(3)
        return replace(self, points=self.points * flip + np.array([x_mm, y_mm, z_mm]))
