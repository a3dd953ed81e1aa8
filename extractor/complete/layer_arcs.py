"""Heavy omission (the article's Fig. 8): a quadratic through the markers of one layer within a sextant.

The variance of a place on it has two parts: departures of the surface from the quadratic, by the residuals, and the
stated errors of the markers, as these hardly show in residuals. One quadratic rests on few markers and may seem to fit
better than it does; the residuals of all quadratics of the picture count, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native


class LayerPlaces(NamedTuple):
    """Places of M markers on the quadratics through their layers and sextants.

    Attributes:
        xy_px: (M, 2) float64, NaN where there are too few markers, as where a marker is known.
        misfit_px2: (M,) float64, from the marker to the quadratic, per axis, by the residuals of this quadratic alone.
        variance_px2: (M,) float64, of the place, per axis. Both are infinite without a place.
    """

    xy_px: NDArray[np.float64]
    misfit_px2: NDArray[np.float64]
    variance_px2: NDArray[np.float64]


def predict_by_layer(xy: NDArray[np.float64], noise_px2: NDArray[np.float64], layers: int) -> LayerPlaces:
    """Places of the unknown markers between known ones, on the quadratic through their layer and sextant.

    For a corner of the layer, which belongs to two sextants, the place with the smaller misfit is taken.

    Args:
        xy: (M, 2) px, NaN where unknown.
        noise_px2: (M,) the variances of the known ones, per axis.
        layers: number of layers.
    """
    return native.predict_by_layer(np.ascontiguousarray(xy), noise_px2, layers)
