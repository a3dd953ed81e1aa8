"""The markers' normal equations against numpy's, where they are singular, too.

Inside: no image has exactly singular equations, and a solution that is nearly right is as good as its noise.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from extractor import parse_layout
from extractor.layout.topology import Topology, topology_of
from extractor.refine.solve.fisher_information import covariances, solve_shifts
from tests.support.layouts import small_text

WEAK = 1e-2


@cache
def mesh() -> Topology:
    return topology_of(parse_layout(small_text("honeycomb", 4)))


def test_shifts_solve_the_equations() -> None:
    """The information of six gridlines at a marker; a gridline gives the positions of its ends across the line only."""
    own, rng = mesh(), np.random.default_rng(2)
    count = len(own.spokes)
    angle, weight = rng.uniform(0, np.pi, len(own.edges)), rng.uniform(50.0, 200.0, len(own.edges))
    across = weight[:, None, None] * np.stack([[np.cos(a), np.sin(a)] for a in angle])[:, :, None]
    across = across * np.stack([[np.cos(a), np.sin(a)] for a in angle])[:, None]
    whole = WEAK * np.eye(2 * count)
    for (a, b), block in zip(own.edges, across, strict=True):
        for m, n, share in ((a, a, 1 / 3), (b, b, 1 / 3), (a, b, 1 / 6), (b, a, 1 / 6)):
            whole[2 * m : 2 * m + 2, 2 * n : 2 * n + 2] += share * block
    blocks = whole.reshape(count, 2, count, 2).transpose(0, 2, 1, 3)
    every = np.arange(count)
    diagonal = blocks[every, every].reshape(count, 4)[:, [0, 1, 3]]
    beside = blocks[own.edges[:, 0], own.edges[:, 1]].reshape(-1, 4)
    right = rng.normal(size=(count, 2))
    exact = np.linalg.solve(whole, right.ravel()).reshape(count, 2)
    found = solve_shifts(diagonal, beside, own.edges, right)
    assert np.abs(found - exact).max() < 0.01 * np.abs(exact).max()
    inverse = np.linalg.inv(whole).reshape(count, 2, count, 2)[every, :, every]
    cov = covariances(diagonal, beside, own.edges, own.spokes, 4 * WEAK, np.ones(count, np.bool_))
    known = np.isfinite(cov[:, 0, 0])
    assert known.mean() > 0.9
    np.testing.assert_allclose(
        np.sqrt(np.trace(cov[known], axis1=1, axis2=2)),
        np.sqrt(np.trace(inverse[known], axis1=1, axis2=2)),
        rtol=0.1,
    )


def test_singular_systems_are_solved_where_they_tell_something() -> None:
    """No information; one gridline alone; two markers of which only the difference is known."""
    own = mesh()
    count, edges = len(own.spokes), np.asarray(own.edges)
    every = np.ones(count, np.bool_)
    diagonal, beside = np.zeros((count, 3)), np.zeros((len(edges), 4))
    assert np.isnan(covariances(diagonal, beside, own.edges, own.spokes, 4 * WEAK, every)).all()
    diagonal[:, [0, 2]] = WEAK
    right = np.zeros((count, 2))
    assert not solve_shifts(diagonal, beside, own.edges, right).any()
    a, b = edges[0]
    for value in (1.0, 1e4, 1e8):
        diagonal[:, [0, 2]] = WEAK
        diagonal[[a, b], 0] += value  # along x only: of y nothing is known
        beside[0, 0] = -value
        right[a, 0], right[b, 0] = value, -value
        shift = solve_shifts(diagonal, beside, own.edges, right)
        assert np.isfinite(shift).all() and shift[a, 0] - shift[b, 0] == pytest.approx(1.0, rel=0.02)
        assert not shift[:, 1].any()
        cov = covariances(diagonal, beside, own.edges, own.spokes, 4 * WEAK, every)
        known = np.isfinite(cov[:, 0, 0])
        assert (np.linalg.eigvalsh(cov[known]) > 0).all()
