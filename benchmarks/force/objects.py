"""Rigid objects of the finite-element truth: a skeleton (points, a disk or a circle) with a radius around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DIFFERENCE_MM = 1e-5


@dataclass(frozen=True)
class RigidObject:
    """All points within ``radius_mm`` of a skeleton whose lowest point touches the plane z = 0.

    Attributes:
        kind: "points", "disk" or "circle".
        radius_mm: of the ball around every skeleton point.
        centres_mm: (K, 2) of the points, or (1, 2) of the disk or circle.
        skeleton_mm: radius of the disk or circle.
    """

    kind: str
    radius_mm: float
    centres_mm: tuple[tuple[float, float], ...]
    skeleton_mm: float = 0.0

    def gap(self, x: Array) -> tuple[Array, Array]:
        """Distances (N,) and outward unit normals (N, 3) at points (N, 3) of the object's frame."""
        off = x - self._nearest(x)
        distance = np.maximum(np.linalg.norm(off, axis=1), 1e-12)
        return distance - self.radius_mm, off / distance[:, None]

    def turn(self, x: Array) -> Array:
        """(N, 3, 3) derivative of the normals by the points."""
        columns = []
        for axis in range(3):
            step = DIFFERENCE_MM * np.eye(3)[axis]
            columns.append((self.gap(x + step)[1] - self.gap(x - step)[1]) / (2 * DIFFERENCE_MM))
        return np.stack(columns, axis=2)

    def _nearest(self, x: Array) -> Array:
        centres = np.column_stack(
            [np.asarray(self.centres_mm), np.full(len(self.centres_mm), self.radius_mm)]
        )
        if self.kind == "points":
            which = np.linalg.norm(x[:, None] - centres[None], axis=2).argmin(axis=1)
            return np.asarray(centres[which])
        off = x[:, :2] - centres[0, :2]
        rho = np.maximum(np.hypot(*off.T), 1e-9)
        wanted = (
            np.full_like(rho, self.skeleton_mm)
            if self.kind == "circle"
            else np.minimum(rho, self.skeleton_mm)
        )
        return np.column_stack(
            [centres[0, :2] + off * (wanted / rho)[:, None], np.full(len(x), self.radius_mm)]
        )
