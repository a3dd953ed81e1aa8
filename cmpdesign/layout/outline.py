"""Closed outlines as (K, 2) arrays in mm, counter-clockwise, the first point not repeated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

# The polygon deviates from the circle by at most 4e-5 of the radius.
CIRCLE_POINTS = 360


def drop_collinear_points(polygon: Points) -> Points:
    """The polygon without the points that lie on a straight side."""
    before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    lengths = np.hypot(*before.T) * np.hypot(*after.T)
    corners: Points = polygon[np.abs(turn) > 1e-9 * lengths]
    return corners


def corner_offsets(polygon: Points) -> Points:
    """(K, 2): the shift of each corner when every side moves outward by one."""
    side = np.roll(polygon, -1, axis=0) - polygon
    normal = np.stack([side[:, 1], -side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
    before = np.roll(normal, 1, axis=0)
    shifts: Points = (before + normal) / (1 + (before * normal).sum(axis=1))[:, None]
    return shifts


def rectangle_outline(width_mm: float, height_mm: float) -> Points:
    """(4, 2) mm: a rectangle around the origin."""
    return np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width_mm / 2, height_mm / 2)


def circle_outline(diameter_mm: float) -> Points:
    """(K, 2) mm: a polygon inscribed in the circle around the origin."""
    angle = np.linspace(0, 2 * np.pi, CIRCLE_POINTS, endpoint=False)
    return diameter_mm / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def rotation_matrix(angle_deg: float) -> NDArray[np.float64]:
    """(2, 2) matrix R: ``points @ R.T`` rotates counter-clockwise; exact at multiples of 90 degrees."""
    quarters, rest = divmod(angle_deg, 90.0)
    c, s = (1.0, 0.0) if rest == 0 else (np.cos(np.radians(rest)), np.sin(np.radians(rest)))
    for _ in range(int(quarters) % 4):
        c, s = -s, c
    return np.array([(c, -s), (s, c)])
