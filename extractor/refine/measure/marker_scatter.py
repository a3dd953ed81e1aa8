"""Scatter of the markers: their independent deviations from the smooth map that all markers define.

The markers of castings scatter. Where a marker deviates independently, the sides of its cells are straight, and the
tangents of a map through such markers are wrong by as much as the markers scatter. The differences of markers along
their gridlines distinguish scatter from bending. Independent scatter of variance v per axis gives third differences (1,
3, 3, 1) a variance of 20 v, and fourth ones (1, 4, 6, 4, 1) of 70 v. Where a map bends, its fourth differences are
smaller against its third ones. With r the largest ratio of both variances there,

    v = (fourth - r third) / (70 - 20 r) - noise,

where both variances are computed from the lower quartile of all gridlines of the picture, so that rims, slips and dirt
have no influence. The share of v in the fourth differences, 70 v / fourth (by their median), is the weight of the map's
second derivatives over its tangents in the prior of a gridline's shape; the error of second derivatives by scatter is a
fifth of the error of tangents. This error is the smallest variance of the gridline's bending.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure as native
from extractor.layout.topology import Topology


class MarkerScatter(NamedTuple):
    """Independent scatter of the markers of a picture.

    Attributes:
        variance_px2: px^2, of one axis.
        share: 0 to 1, of the variance of the fourth differences.
    """

    variance_px2: float
    share: float


NO_SCATTER = MarkerScatter(0.0, 0.0)


def measure_scatter(
    xy: NDArray[np.float64],
    maps: NDArray[np.float64],
    diagonal: NDArray[np.float64],
    topology: Topology,
) -> MarkerScatter:
    """The scatter of the markers of a picture.

    Args:
        xy: (M, 2) px, the markers, NaN where unknown.
        maps: (M, 2, 5), as ``local_maps`` gives them.
        diagonal: (M, 3) 1/px^2, the information's diagonal blocks.
        topology: of the layout.
    """
    return native.measure_scatter(xy, maps, diagonal, topology)
