"""The nearest of many points in the plane, by a grid of buckets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import numeric as native

Points = NDArray[np.float64]


def nearest_points(xy: Points, queries: Points, count: int = 1) -> NDArray[np.int32]:
    """(Q, count) the indices of the points (N, 2) that are nearest to each of the queries (Q, 2), the nearest first.

    Args:
        xy: finite.
        queries: finite.
        count: at most N.

    Raises:
        ValueError: ``count`` is larger than N.
    """
    return native.nearest_points(xy, queries, count)
