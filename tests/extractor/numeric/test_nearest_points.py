"""The nearest points against those of a tree.

Inside: a point that is passed over changes no number in an image but those beside a gap.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points


@pytest.mark.parametrize("count", [1, 3, 8, 40, 300])
@pytest.mark.parametrize("shape", [(1, 1), (200, 1), (0, 1), (0, 0)])
def test_the_nearest_are_those_of_a_tree(count: int, shape: tuple[float, float]) -> None:
    """Spread evenly, far along one axis, on a line, and all at one place; asked from inside and from outside."""
    rng = np.random.default_rng(count)
    xy = rng.uniform(-50, 50, (count, 2)) * shape
    grid, wanted = bucket_grid(xy), min(8, count)
    for query in rng.uniform(-80, 80, (8, 2)) * shape:
        index, square = np.empty(8, np.int32), np.empty(8)
        found = fill_nearest_points(grid, query[0], query[1], index, square)
        distance = cKDTree(xy).query(query, [*range(1, wanted + 1)])[0]
        assert found == wanted
        np.testing.assert_allclose(np.sqrt(square[:found]), distance, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(xy[index[:found]] - query, axis=1), distance, atol=1e-9)
