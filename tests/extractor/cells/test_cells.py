"""Which domains are cells and whole: none that is small beside those around it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from extractor.cells.cells import NEAREST_CELLS, _has_few_larger_neighbours

Array = NDArray[np.float64]


def few_larger(center: Array, area: Array, share: float, most: int) -> NDArray[np.bool_]:
    """The same from all distances."""
    apart = ((center[:, None] - center) ** 2).sum(axis=2)
    around = np.argsort(apart, axis=1, kind="stable")[:, :NEAREST_CELLS]
    return np.asarray((area[:, None] < share * area[around]).sum(axis=1) < most)


@settings(max_examples=60, deadline=None)
@given(
    count=st.integers(NEAREST_CELLS + 1, 200),
    giants=st.sampled_from([0.0, 0.02, 0.1, 0.5]),
    uneven=st.sampled_from([0.05, 0.5, 2.0]),
    seed=st.integers(0, 2**16),
)
def test_domains_are_compared_with_the_nearest(count: int, giants: float, uneven: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    center, area = rng.normal(size=(count, 2)) * [10.0, 3.0], np.exp(uneven * rng.normal(size=count))
    area[rng.random(count) < giants] *= 50.0
    for share, most in ((0.2, 4), (0.7, 3)):
        np.testing.assert_array_equal(
            _has_few_larger_neighbours(center, area, share, most), few_larger(center, area, share, most)
        )


@pytest.mark.parametrize("spread", [1.0, 30.0])
def test_cells_amid_a_few_blots_are_no_fragments(spread: float) -> None:
    """Where all cells are small beside the largest domains, only those are that have these around them."""
    rng = np.random.default_rng(0)
    y, x = np.divmod(np.arange(400.0), 20.0)
    center, area = np.stack([x, y], axis=1), np.ones(400)
    blots = rng.normal(size=(6, 2)) * spread * 0.3 + 10.0
    few = _has_few_larger_neighbours(
        np.concatenate([center, blots]), np.append(area, np.full(6, 60.0)), 0.7, 3
    )
    assert 0 < (~few[:400]).sum() < 40 if spread == 1.0 else few[:400].sum() > 395
    assert few[400:].all()
