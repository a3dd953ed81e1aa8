"""Distances of markers from the truth, and their stated deviations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scoring.calibration import squared_distances
from cmpdesign.scene import Rendered
from extractor import Markers

Array = NDArray[np.float64]


def errors_px(markers: Markers, seen: Rendered) -> Array:
    """(M,) px from the truth; NaN where lost."""
    return np.asarray(np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1))


def deviations(markers: Markers, seen: Rendered) -> Array:
    """(M,) the errors per axis in units of the markers' own standard deviations; NaN where lost."""
    error = markers.xy_px - seen.truth.marker_xy_px
    return np.sqrt(squared_distances(error, markers.cov_px2) / 2)


def rms(values: Array) -> float:
    """The root mean square of the known values."""
    return float(np.sqrt(np.nanmean(np.square(values))))
