"""The median of a few numbers, inside compiled loops.

Sorting them takes a branch a comparison that nobody can guess; counting how many are smaller than each takes none.
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
