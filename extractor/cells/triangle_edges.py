"""Measures the edges of triangles with sub-pixel accuracy, of many triangles together.

The profile of the ink's light across an edge, 1 inside and 0 outside, is integrated: its area gives the edge's position
for any blur, so that the blur need not be known. The edge is the line through two such positions. Profiles run along
the median, not the normal, so that they avoid the other edges in any triangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.image.pyramid import PyramidLevel


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
    native.update_triangle_corners(view, corners, good)
