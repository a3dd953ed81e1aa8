"""Quadratic maps through the markers of two rings, with regularised curvature, for many markers at once.

The maps are used where markers of the rings are unknown: around damage, in images that cut the pattern, and in small
patterns. An unknown neighbour has no weight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import localmap as native
from extractor.layout.topology import FIRM_RIDGE, MIN_FIRM_MARKERS


class RegularisedMapLimits(NamedTuple):
    """Limits of regularised maps.

    Attributes:
        min_sine2: least squared sine of the angle between the neighbours' directions. Chosen.
        min_neighbours: known markers; fewer do not determine the slopes. Derived: two slopes.
        min_curved_neighbours: known markers; with fewer the map is linear. Derived: five derivatives.
        min_firm_neighbours: known markers; with fewer the curvature is held by ``weak_ridge``. Chosen.
        firm_ridge, weak_ridge, linear_ridge: added to the diagonal of the curvature's normal equations with enough
            neighbours, with some, and with too few; the unit is that of the layout's vectors. Chosen; the last one is
            so large that nothing curves.
    """

    min_sine2: float = 0.05
    min_neighbours: int = 2
    min_curved_neighbours: int = 5
    min_firm_neighbours: int = MIN_FIRM_MARKERS
    firm_ridge: float = FIRM_RIDGE
    weak_ridge: float = 0.02
    linear_ridge: float = 1e9


LIMITS = RegularisedMapLimits()


def fill_quadratic_derivatives(
    xy: NDArray[np.float64],
    markers: NDArray[np.int64],
    ring_markers: NDArray[np.int32],
    ring_vectors: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Write the derivatives x, y, xx, xy, yy of the image coordinates where the neighbours determine them.

    Args:
        xy: (M, 2) px, the markers' places, NaN unknown.
        markers: (n,) the markers to evaluate.
        ring_markers: (M, K) int32, their neighbours, or -1. ring_vectors: (M, K, 2) the vectors to them in the layout.
        out: (M, 2, 5) float64, receives the derivatives of x and y.
    """
    native.fill_quadratic_derivatives(xy, markers, ring_markers, ring_vectors, out, LIMITS)
