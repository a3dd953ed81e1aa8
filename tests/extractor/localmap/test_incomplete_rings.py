"""Maps at incomplete rings: weighted least squares, and nothing where the neighbours lie on one line.

Inside: an image does not allow a choice of each neighbour, and least squares by numpy does.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor import parse_layout
from extractor.layout.lattice_tables import lattice_of
from extractor.refine.synthesis.gridlines import local_maps
from tests.support.layouts import small_text

Array = NDArray[np.float64]


def lone(xy: Array, near: NDArray[np.int32], offset: Array, m: int) -> Array:
    """(2, 5) the derivatives at one marker by numpy."""
    known = [k for k, n in enumerate(near[m]) if n >= 0 and np.isfinite(xy[n, 0])]
    x, y = offset[m, known].T
    terms, weight = np.stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y]), (x * x + y * y) ** -2
    held = 1e9 if len(known) < 5 else 0.02 if len(known) < 8 else 0.001
    gram = (weight * terms) @ terms.T + np.diag([0.0, 0.0, held, held, held])
    return np.asarray(np.linalg.solve(gram, (weight * terms) @ (xy[near[m, known]] - xy[m])).T)


@pytest.mark.parametrize("missing", [0.0, 0.3, 0.75])
def test_each_is_the_weighted_least_squares_quadratic(missing: float) -> None:
    lattice = lattice_of(parse_layout(small_text("honeycomb", 5)))
    near = lattice.neighbours  # two rings
    offset = (lattice.marker_mm[near] - lattice.marker_mm[:, None]) / 1.5  # in edges
    rng = np.random.default_rng(int(100 * missing))
    xy = rng.normal(size=(len(near), 2))
    xy[rng.random(len(xy)) < missing] = np.nan
    out = local_maps(xy, near, offset, np.zeros((len(xy), 5, near.shape[1])))
    told = np.flatnonzero(np.isfinite(out[:, 0, 0]))
    assert len(told) > 12
    for m in told:
        np.testing.assert_allclose(out[m], lone(xy, near, offset, m), rtol=1e-6, atol=1e-8)
    assert np.isnan(xy[np.isnan(out[:, 0, 0])]).any() or missing == 0


def test_neighbours_along_one_line_tell_nothing() -> None:
    offset = np.zeros((1, 18, 2))
    offset[0, :3] = [[1.0, 0.1], [-1.0, -0.1], [2.0, 0.21]]
    near = np.full((1, 18), -1, np.int32)
    near[0, :3] = 0
    out = local_maps(np.zeros((1, 2)), near, offset, np.zeros((1, 5, 18)))
    assert np.isnan(out).all()
