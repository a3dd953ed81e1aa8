"""Delaunay triangulation of points in the plane, with the triangles' neighbours.

A general library takes twice the time of the rest of the numbering. Points are inserted one by one along the rows
of a grid (Lawson 1977): a walk from the previous point leads to the triangle that contains the new point; the triangle
is split; then every edge whose other triangle has the new point in its circumcircle is flipped.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import numeric as native


def delaunay(points: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The Delaunay triangles of finite points (N, 2) float64.

    Only the first of coincident points is used. Slivers along the hull may be missing.

    Returns:
        (F, 3) int32 the triangles' corners, turning from x to y; (F, 3) int32 the triangle across the edge opposite to
        each corner, or -1.
    """
    faces, neighbours = native.delaunay(points)
    return faces, neighbours
