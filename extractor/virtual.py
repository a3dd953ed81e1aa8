"""Virtual markers: points on the gridlines between two markers, numbered by edge and place (section III-B-3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .reference import Reference
from .types import Status, VirtualStatus


def interpolate(
    reference: Reference, xy_px: NDArray[np.float64], status: NDArray[np.uint8]
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """(E, m, 2) points at the fractions (j+1)/(m+1) of every edge from its smaller id, and their (E, m) status.

    Straight between the edge's two markers; lost where either of them is.
    """
    count = reference.virtual_per_edge
    fraction = ((np.arange(count) + 1) / (count + 1))[:, None]
    start, end = xy_px[reference.edges[:, 0], None], xy_px[reference.edges[:, 1], None]
    points = start * (1 - fraction) + end * fraction
    known = (status[reference.edges] != Status.LOST).all(axis=1)
    kind = np.where(known, VirtualStatus.INTERPOLATED, VirtualStatus.LOST).astype(np.uint8)
    return points, np.repeat(kind[:, None], count, axis=1)
