"""Corners: the residue that a round beam leaves, and the spur that compensates the residue.

                 V  nominal corner            Half of a corner, in beam units (footprint = unit disc):
                / \\                           the path turns at P, one unit from both sides, with the half
               / T \\   tip of the spur        angle b; V lies 1 / sin b from P. A plain path leaves the sliver
              /  |  \\                         between V and the disc around P, up to 1 / sin b - 1 long (one
             /   P   \\  corner of the path    unit, half the kerf, at 60 degrees). A spur P-T moves the beam
            /   / \\   \\                       further in and also burns area beside the cell.

The area that a balanced spur burns beside the cell equals the area that is left of the corner. The two sides of a spur
are computed separately, because a spur that bisects a corner at one face does not exactly bisect the corner at the
other face.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import Points

Values = NDArray[np.float64]


def half_angles(path: Points, direction: Points) -> tuple[Values, Values]:
    """Angles between the spur and the path's side after and before each corner.

    Args:
        path: (N, K, 2) corners in beam units, counter-clockwise.
        direction: (N, K, 2) unit vectors along the spurs, outward.

    Returns:
        (N, K) angles to the side after, and (N, K) angles to the side before each corner, rad.
    """
    after, before = np.roll(path, -1, axis=1) - path, np.roll(path, 1, axis=1) - path
    return _angle_between(after, -direction), _angle_between(before, -direction)


def corner_residue_area(half_angle: Values) -> Values:
    """Area that a plain path leaves on one side of a corner, in square beam units."""
    return np.asarray((1 / np.tan(half_angle) - (np.pi / 2 - half_angle)) / 2)


def spur_area(half_angle: Values, length: Values) -> Values:
    """Area that a spur adds on one side of the rounded corner, in square beam units."""
    start, _ = spur_start(half_angle, length)
    line_end = np.sin(half_angle)
    apex = 1 / np.sin(half_angle)
    on_line = np.maximum(line_end - start, 0)
    line = (apex * on_line - (line_end**2 - np.minimum(start, line_end) ** 2) / 2) * np.tan(half_angle)
    rounded = line + _circle_segment_area(np.maximum(start, line_end))
    flat = np.maximum(length - start, 0)
    spur = flat + _circle_segment_area(np.maximum(start - length, 0))
    return np.asarray(spur - rounded)


def spur_start(half_angle: Values, length: Values) -> tuple[Values, Values]:
    """The point where a spur's burn leaves the rounded corner: coordinates along and across the spur from P.

    Both are in beam units.
    """
    flat_from = np.tan(half_angle / 2)
    depth = np.clip(1 - length * np.sin(half_angle), -1, 1)
    chord = np.sqrt(1 - depth**2)
    along = length + depth * np.sin(half_angle) - chord * np.cos(half_angle)
    across = depth * np.cos(half_angle) + chord * np.sin(half_angle)
    is_flat = length >= flat_from
    return np.where(is_flat, flat_from, along), np.where(is_flat, 1.0, across)


def balanced_spur_length(half_angle: Values) -> Values:
    """Length of the spur whose area equals the residue of the corner, in beam units; by bisection."""
    residue = corner_residue_area(half_angle)
    low, high = np.zeros_like(half_angle), 1 / np.sin(half_angle) - 1
    for _ in range(60):
        middle = (low + high) / 2
        too_short = spur_area(half_angle, middle) < residue
        low, high = np.where(too_short, middle, low), np.where(too_short, high, middle)
    return np.asarray((low + high) / 2)


def with_spurs(path: Points, tips: Points) -> Points:
    """(N, 3K, 2) closed paths from the first tip: T0 P0 P1 T1 P1 P2 T2 P2 P0 for triangles."""
    return np.asarray(
        np.stack([tips, path, np.roll(path, -1, axis=1)], axis=2).reshape(len(path), -1, 2), dtype=np.float64
    )


def _circle_segment_area(start: Values) -> Values:
    """Area under the unit circle's upper half from ``start`` (-1 to 1) to 1."""
    s = np.clip(start, -1, 1)
    return np.asarray((np.pi / 2 - s * np.sqrt(1 - s**2) - np.arcsin(s)) / 2)


def _angle_between(a: Points, b: Points) -> Values:
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.asarray(np.abs(np.arctan2(cross, (a * b).sum(axis=-1))))
