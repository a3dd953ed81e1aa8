"""Predicts a marker's place from its neighbours by a local quadratic map from layout to image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import localmap as native


class MarkerPredictions(NamedTuple):
    """Predictions of M markers by their neighbours; NaN where the neighbours are too few or on a line.

    Attributes:
        xy_px: (M, 2) float64, the predicted places.
        variance_px2: (M,) float64, the residual variance per axis of the neighbours.
        leverage: (M,) float64, the factor from the variance of the neighbours to that of the prediction.
        noise_px2: (M,) float64, the variance per axis of the prediction by the independent noise of the neighbours.
        neighbour_noise_px2: (M,) float64, the mean of the neighbours' noise.
        neighbour_count: (M,) int32, the number of known neighbours.
    """

    xy_px: NDArray[np.float64]
    variance_px2: NDArray[np.float64]
    leverage: NDArray[np.float64]
    noise_px2: NDArray[np.float64]
    neighbour_noise_px2: NDArray[np.float64]
    neighbour_count: NDArray[np.int32]


def predict_markers(
    xy_px: NDArray[np.float64],
    noise_px2: NDArray[np.float64],
    wanted: NDArray[np.bool_],
    marker_mm: NDArray[np.float64],
    table: NDArray[np.int32],
) -> MarkerPredictions:
    """Predict the wanted markers from their neighbours; a marker's own place is not used.

    Args:
        xy_px: (M, 2) the markers' places, NaN unknown.
        noise_px2: (M,) the variances of their noise, per axis.
        wanted: (M,) bool.
        marker_mm: (M, 2) the markers in the layout.
        table: (M, K) int32, the neighbours of each marker, or -1.
    """
    return native.predict_markers(xy_px, noise_px2, wanted, marker_mm, table)
