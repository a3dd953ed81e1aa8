"""The median of a few numbers, and the number at a place of the sorted numbers, by the compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import numeric as native


def median_of(values: NDArray[np.float64], count: int) -> float:
    """The median of the first ``count`` values, at least one and none of them NaN."""
    return native.median_of(values, count)


def select(values: NDArray[np.float64], place: int) -> float:
    """The number at a place of the sorted values (n,), none of them NaN.

    The order of the values changes: none before the place is larger, none after it smaller.
    """
    return native.select(values, place)
