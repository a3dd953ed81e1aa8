"""The median by ranks is the median, and selected numbers are those of the sorted ones.

Inside: of many medians in an image a wrong one is an outlier more, which other steps repair.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from extractor.numeric.median import median_of, select


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=24), st.integers(0, 3))
def test_it_is_numpys(values: list[float], beyond: int) -> None:
    """The numbers may be equal, and other values may follow in the array."""
    own = np.array([*values, values[0], *[np.nan] * beyond])
    assert median_of(own, len(values) + 1) == np.median(own[: len(values) + 1])


@given(st.lists(st.integers(-20, 20) | st.floats(-1e9, 1e9), min_size=1, max_size=200), st.floats(0.0, 1.0))
def test_a_selected_number_has_its_place(values: list[float], part: float) -> None:
    """Also where most numbers are equal."""
    own, place = np.array(values, np.float64), round(part * (len(values) - 1))
    chosen = select(own, place)
    assert chosen == own[place] == np.sort(values)[place]
    assert (own[:place] <= chosen).all() and (own[place:] >= chosen).all()
    assert np.array_equal(np.sort(own), np.sort(values))


def test_an_order_against_the_method_is_selected_too() -> None:
    """Numbers that rise to the middle and fall again take many partitions."""
    half = np.arange(2000.0)
    own = np.concatenate([half, half[::-1]])
    assert select(own.copy(), 1000) == np.sort(own)[1000]
