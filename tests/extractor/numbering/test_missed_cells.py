"""What a reduced scale may have missed: what the inks look like is told by some cells of every ink."""

from __future__ import annotations

import numpy as np
import pytest

from extractor.numbering.missed_cells import MAX_SAMPLED_CELLS, _mean_ink_colors

INKS = np.array(
    [[0, 0, 0], [20, 30, 200], [30, 160, 40], [190, 60, 20]], np.uint8
)  # none, red, green, blue; BGR


@pytest.mark.parametrize("count", [3, 61, 2 * MAX_SAMPLED_CELLS + 1, 3 * MAX_SAMPLED_CELLS + 2, 363, 900])
def test_every_ink_is_seen_though_the_cells_come_row_by_row(count: int) -> None:
    """Along a row red, green and blue follow each other, however many cells there are."""
    ink = (np.arange(count) % 3 + 1).astype(np.uint8)
    image = np.repeat(np.repeat(INKS[ink][None], 9, axis=1), 9, axis=0)
    center = np.stack([9.0 * np.arange(count) + 4.0, np.full(count, 4.0)], axis=1)
    every = np.arange(count)
    usual, strength = _mean_ink_colors(
        image, center, np.full(count, 40.0), every.astype(np.int32), every, ink
    )
    for own in (1, 2, 3):
        pure = INKS[own] - INKS[own].min().astype(float)
        np.testing.assert_allclose(usual[own], pure, atol=1e-6)
        np.testing.assert_allclose(strength[own], np.linalg.norm(pure), atol=1e-6)
