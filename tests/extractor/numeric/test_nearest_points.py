"""The nearest points against those of a tree.

Inside: a point that is passed over changes no number in an image but those beside a gap.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from extractor.numeric.nearest_points import nearest_points


@pytest.mark.parametrize("count", [1, 3, 8, 40, 300])
@pytest.mark.parametrize("shape", [(1, 1), (200, 1), (0, 1), (0, 0)])
def test_the_nearest_are_those_of_a_tree(count: int, shape: tuple[float, float]) -> None:
    """Spread evenly, far along one axis, on a line, and all at one place; asked from inside and from outside."""
    rng = np.random.default_rng(count)
    xy = rng.uniform(-50, 50, (count, 2)) * shape
    queries, wanted = rng.uniform(-80, 80, (8, 2)) * shape, min(8, count)
    index = nearest_points(xy, queries, wanted)
    distance = cKDTree(xy).query(queries, [*range(1, wanted + 1)])[0]
    found = np.linalg.norm(xy[index] - queries[:, None], axis=2)
    np.testing.assert_allclose(found, distance, atol=1e-9)


def test_more_points_than_there_are_cannot_be_the_nearest() -> None:
    with pytest.raises(ValueError, match="count is larger"):
        nearest_points(np.zeros((3, 2)), np.zeros((1, 2)), 4)
