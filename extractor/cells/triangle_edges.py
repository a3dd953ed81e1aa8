"""Measures the edges of triangles with sub-pixel accuracy, of many triangles together.

The profile of the ink's light across an edge, 1 inside and 0 outside, is integrated: its area gives the edge's position
for any blur, so that the blur need not be known. The edge is the line through two such positions. Profiles run along
the median, not the normal, so that they avoid the other edges in any triangle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.image.pyramid import PyramidLevel


class TriangleEdgeLimits(NamedTuple):
    """Limits of the measurement of edges.

    Attributes:
        first_profile: of an edge, from its start to the first profile, and from the second one to its end. Chosen.
        half_profile: samples on each side of an edge. Chosen.
        border_margin_px: from profiles to the last row and column; more than half a sub-pixel step. Derived.
        profile_reach: half length of a profile in the first pass, in vectors from the cell's center to the edge's
            middle. Chosen.
        fine_reach_px: half length of a profile, about; longer profiles are followed by shorter ones. Measured: rule
            "shorter profiles".
        next_reach: half length of a profile, relative to the pass before. Measured: rule "shorter profiles".
        max_passes: the first one and those with shorter profiles. Measured: rule "shorter profiles".
        ink_radius: of the disc in which the ink's color is measured, relative to the corner's distance from the center.
            Chosen.
        background_place: of the disc of the color outside an edge, in vectors from the cell's center to the edge's
            middle. Derived: the middle of a neighbour as large.
        background_radius: of this disc, relative to the edge's distance from the center. Chosen.
        min_depth_px: distance of a valid edge from the cell's center. Chosen.
        min_contrast: norm over the three 8-bit channels, between the ink and the color outside a valid edge. Chosen.
        min_sine: two edges that meet at less than 3 degrees have no corner. Chosen.
        max_corner_shift: of a valid triangle, in units of the corner's distance from the center. Chosen.
        min_profile_level, max_profile_level: to which a profile's share of ink is limited. Chosen.
        smallest_contrast: of a squared contrast, to divide by. Derived: it only keeps a division from failing.
    """

    first_profile: float = 0.25
    half_profile: int = 4
    border_margin_px: float = 0.01
    profile_reach: float = 0.5
    fine_reach_px: float = 8.0
    next_reach: float = 0.25
    max_passes: int = 3
    ink_radius: float = 0.2
    background_place: float = 2.0
    background_radius: float = 0.4
    min_depth_px: float = 0.3
    min_contrast: float = 12.0
    min_sine: float = 0.05
    max_corner_shift: float = 1.0
    min_profile_level: float = -0.2
    max_profile_level: float = 1.2
    smallest_contrast: float = 1e-9


LIMITS = TriangleEdgeLimits()


def update_triangle_corners(
    view: PyramidLevel, corners: NDArray[np.float64], good: NDArray[np.bool_]
) -> None:
    """Move the corners of triangles to the intersections of their measured edges.

    The first profiles reach across the cell; for large cells shorter profiles follow.

    Args:
        view: the image.
        corners: (N, 3, 2) float64 px, clockwise in the image, updated.
        good: (N,) bool, the triangles to measure; set to False for those without valid edges.
    """
    native.update_triangle_corners(view, corners, good, LIMITS)
