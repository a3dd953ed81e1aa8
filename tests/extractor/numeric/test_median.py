"""The median by ranks is the median.

Inside: of many medians in an image a wrong one is an outlier more, which other steps repair.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from extractor.numeric.median import median_of


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=24), st.integers(0, 3))
def test_it_is_numpys(values: list[float], beyond: int) -> None:
    """The numbers may be equal, and other values may follow in the array."""
    own = np.array([*values, values[0], *[np.nan] * beyond])
    assert median_of(own, len(values) + 1) == np.median(own[: len(values) + 1])
