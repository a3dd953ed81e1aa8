"""The article's measures of a pressed cube: the edge-point set, its circumscribed square, the response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
CONTACT_DISPLACEMENT_SHARE = 0.5  # of the largest displacement: markers beyond it are in contact


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """The markers that moved by more than half of the largest displacement.

    Attributes:
        xy_mm: (K, 2) where they are.
        moved_mm: (K,) by how much they moved, along the direction of the load.
    """

    xy_mm: Points
    moved_mm: Points


def edge_points(xyz_mm: Points, displacement_mm: Points, direction: tuple[float, float, float]) -> EdgePoints:
    """Of markers (M, 3), NaN where unknown, those of the contact; empty when none is known.

    The displacement counts along a unit vector: (0, 0, -1) for a press, the way of the shear for a shear.
    """
    along = displacement_mm @ np.asarray(direction)
    known = np.isfinite(along)
    if not known.any() or np.nanmax(along) <= 0:
        return EdgePoints(np.empty((0, 2)), np.empty(0))
    chosen = known & (np.where(known, along, -np.inf) > CONTACT_DISPLACEMENT_SHARE * np.nanmax(along))
    return EdgePoints(xyz_mm[chosen, :2], along[chosen])


def circumscribed_square_mm(xy_mm: Points, turn_deg: float = 0.0) -> float | None:
    """Side of the square around a point set (K, 2) that lies as the object does; None without points.

    The set's width and height along the object's axes differ, as the pattern's points are spaced; a square that
    touches the set on opposite sides and holds it has the larger of both.
    """
    if not len(xy_mm):
        return None
    cos, sin = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return float(np.ptp(xy_mm @ np.array([[cos, -sin], [sin, cos]]), axis=0).max())


def mean_extent_mm(xy_mm: Points) -> float | None:
    """The mean of the set's width and height: the other way to make a square of them."""
    return float(np.ptp(xy_mm, axis=0).mean()) if len(xy_mm) else None


def shear_response(points: EdgePoints, shear_mm: float) -> float | None:
    """Mean displacement of the edge points along the shear, in units of the shear; None without points."""
    return float(points.moved_mm.mean()) / shear_mm if len(points.moved_mm) else None
