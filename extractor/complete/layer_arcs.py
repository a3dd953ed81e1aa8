"""Heavy omission (the article's Fig. 8): a quadratic through the markers of one layer within a sextant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native


class LayerLimits(NamedTuple):
    """Limits of the quadratics through layers.

    Attributes:
        min_markers: known markers of a layer within a sextant, for a quadratic with a residual. Derived: three
            coefficients, and two equations over.
    """

    min_markers: int = 5


LIMITS = LayerLimits()


def predict_by_layer(xy: NDArray[np.float64], layers: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places of the unknown markers between known ones, on the quadratic through their layer and sextant.

    Args:
        xy: (M, 2) px, NaN where unknown.
        layers: number of layers.

    Returns:
        (M, 2) px, NaN where there are too few markers; and (M,) the variance of these places, px^2 per axis, from the
        residual of the fit, infinite without a place. For a corner of the layer, which belongs to two sextants, the
        place with the smaller variance is taken.
    """
    predicted, variance = native.predict_by_layer(np.ascontiguousarray(xy), layers, LIMITS)
    return np.asarray(predicted), np.asarray(variance)
