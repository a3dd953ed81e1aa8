"""The median of a few numbers, for use inside compiled loops.

Sorting takes an unpredictable branch per comparison; counting the smaller numbers of each takes none.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import inlined_no_refcount


@inlined_no_refcount
def median_of(values, count):  # type: ignore[no-untyped-def]
    """The median of the first ``count`` values, at least one and none of them NaN."""
    low, high = -np.inf, -np.inf
    for i in range(count):
        own, smaller = values[i], 0
        for j in range(count):
            smaller += values[j] < own
        low = max(low, own) if smaller <= (count - 1) // 2 else low
        high = max(high, own) if smaller <= count // 2 else high
    return 0.5 * (low + high)
