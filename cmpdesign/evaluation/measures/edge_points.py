"""The article's measures of a pressed cube: the edge-point set, its circumscribed square, the response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
CONTACT_DISPLACEMENT_SHARE = (
    0.5  # of the largest displacement; markers with a larger displacement are in contact
)


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """The markers with a displacement of more than half of the largest displacement.

    Attributes:
        xy_mm: (K, 2) deformed positions.
        displacement_mm: (K,) displacement along the direction of the load.
    """

    xy_mm: Points
    displacement_mm: Points


def edge_points(xyz_mm: Points, displacement_mm: Points, direction: tuple[float, float, float]) -> EdgePoints:
    """The edge points among markers; empty when no displacement is known.

    Args:
        xyz_mm: (M, 3) deformed positions, NaN where unknown.
        displacement_mm: (M, 3) displacements, NaN where unknown.
        direction: unit vector along which displacements count: (0, 0, -1) for a press, the shear's direction for a
            shear.
    """
    along = displacement_mm @ np.asarray(direction)
    known = np.isfinite(along)
    if not known.any() or np.nanmax(along) <= 0:
        return EdgePoints(np.empty((0, 2)), np.empty(0))
    chosen = known & (np.where(known, along, -np.inf) > CONTACT_DISPLACEMENT_SHARE * np.nanmax(along))
    return EdgePoints(xyz_mm[chosen, :2], along[chosen])


def circumscribed_square_mm(xy_mm: Points, turn_deg: float = 0.0) -> float | None:
    """Side in mm of the square around points (K, 2) mm, with the object's orientation; None without points.

    The points' width and height along the object's axes differ, because of the pattern's spacing. The circumscribed
    square has the larger of both.
    """
    extents = _extents_mm(xy_mm, turn_deg)
    return float(extents.max()) if len(xy_mm) else None


def mean_extent_mm(xy_mm: Points, turn_deg: float = 0.0) -> float | None:
    """The mean of the points' width and height, a variant of the fitted square; None without points."""
    return float(_extents_mm(xy_mm, turn_deg).mean()) if len(xy_mm) else None


def _extents_mm(xy_mm: Points, turn_deg: float) -> Points:
    """(2,) mm: width and height of points (K, 2) mm along the object's axes; zeros without points."""
    if not len(xy_mm):
        return np.zeros(2)
    cos, sin = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return np.asarray(np.ptp(xy_mm @ np.array([[cos, -sin], [sin, cos]]), axis=0))


def shear_response(points: EdgePoints, shear_mm: float) -> float | None:
    """Mean displacement of the edge points along the shear, in units of the shear; None without points."""
    return float(points.displacement_mm.mean()) / shear_mm if len(points.displacement_mm) else None
