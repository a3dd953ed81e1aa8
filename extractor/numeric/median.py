"""The median of a few numbers, by the compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import numeric as native


def median_of(values: NDArray[np.float64], count: int) -> float:
    """The median of the first ``count`` values, at least one and none of them NaN."""
    return float(native.median_of(values, count))
