"""How gridlines move and bend with the markers of a layout: as found by moving markers, and by random ones.

Inside: covariances show a wrong coupling at the rim only, and only in the mean of many images. At incomplete rings an
image does not allow a choice of each neighbour, and least squares by numpy does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene.standard import standard_layout
from extractor import Reference, parse_layout
from extractor.layout.lattice_tables import lattice_of
from extractor.layout.topology import Topology, topology_of
from extractor.refine.solve.fisher_information import covariances
from extractor.refine.synthesis.gridlines import gridlines, local_maps
from tests.support.layouts import small_text

PATTERNS = ("honeycomb", "round", "elliptical")
SIDE_SUMS = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0  # of straight lines between 0 and 1


def reference(pattern: str) -> Reference:
    return parse_layout(layout_to_json(standard_layout(pattern, 5)))


def places(layout: Reference, edge_px: float) -> NDArray[np.float64]:
    chords = np.diff(layout.xy_mm[layout.edges.astype(np.int64)], axis=1)
    return np.asarray(edge_px / np.linalg.norm(chords, axis=2).mean() * layout.xy_mm)


def normals(topology: Topology) -> NDArray[np.float64]:
    across = np.stack([-topology.edge_vectors[:, 1], topology.edge_vectors[:, 0]], axis=1)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def slopes(
    topology: Topology, xy: NDArray[np.float64], share: float, curves_at_rim: bool = False
) -> NDArray[np.float64]:
    """(E, 2) px, the slopes at both ends of the gridlines, times their length."""
    maps = local_maps(xy, topology.ring_markers, topology.ring_vectors, topology.derivative_stencil)
    if not curves_at_rim:
        maps[(topology.spokes < 0).any(axis=1), :, 2:] = 0.0
    straight = np.zeros((len(topology.edges), 2))
    lines = gridlines(xy, maps, straight, topology.edges, topology.edge_vectors, share)
    return np.asarray(lines[:, 4:5] * lines[:, 5:7])


@pytest.mark.parametrize("way", [0, 1], ids=["tangents", "second derivatives"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_couplings_inside_are_those_of_moved_ends(pattern: str, way: int) -> None:
    layout = reference(pattern)
    topology, xy, step = topology_of(layout), places(layout, 20.0), 1e-4
    across, inner = normals(topology), (topology.ring_markers >= 0).all(axis=1)
    for e in np.flatnonzero(inner[topology.edges].all(axis=1))[::3]:
        moved = np.empty((2, 2))  # both ends of the straight line that fits best, by the moved end
        for by, marker in enumerate(topology.edges[e]):
            there, back = xy.copy(), xy.copy()
            there[marker] += step * across[e]
            back[marker] -= step * across[e]
            change = slopes(topology, there, way)[e] - slopes(topology, back, way)[e]
            leave, arrive = change / (2 * step)
            moved[:, by] = (by == 0) + (4 * leave - arrive) / 30, (by == 1) + (leave - 4 * arrive) / 30
        product = SIDE_SUMS @ moved
        expected = 3 * product[0, 0], 3 * product[1, 1], 3 * (product[0, 1] + product[1, 0])
        assert topology.end_couplings[e, 3 * way : 3 * way + 3] == pytest.approx(expected, abs=2e-3)


def test_a_gridline_moves_more_inside_than_a_straight_line() -> None:
    """Cardinal cubics have 1.1."""
    layout = reference("honeycomb")
    topology, layer = topology_of(layout), layout.layer[layout.edges.astype(np.int64)]
    inside = (layer < layout.layer.max() - 2).all(axis=1)
    assert np.allclose(topology.end_couplings[inside, :2], 1.0867, atol=1e-3)


class Pulls(NamedTuple):
    """How a marker that moves changes the pulls of all gridlines on the markers, (M, 2, M, 2): of curves, of straight
    lines. The latter is also the covariance of the pulls by noise.
    """

    curved: NDArray[np.float64]
    straight: NDArray[np.float64]


def pulls_of(topology: Topology, xy: NDArray[np.float64], strength: NDArray[np.float64], way: int) -> Pulls:
    """By moving each marker along both axes."""
    edges, across, step = topology.edges.astype(np.int64), normals(topology), 1e-4
    found = Pulls(*np.zeros((2, *xy.shape, *xy.shape)))
    for m, axis in np.ndindex(*xy.shape):
        moved = np.zeros_like(xy)
        moved[m, axis] = step
        change = slopes(topology, xy + moved, way) - slopes(topology, xy - moved, way)
        leave, arrive = change.T / (2 * step)
        straight = ((edges == m) * across[:, axis, None]) @ SIDE_SUMS
        curved = straight + np.stack([leave / 20 - arrive / 30, leave / 30 - arrive / 20], axis=1)
        for total, pull in zip(found, (curved, straight), strict=True):
            for at in (0, 1):
                np.add.at(total[..., m, axis], edges[:, at], (strength * pull[:, at])[:, None] * across)
    return found


@pytest.mark.parametrize("way", [0, 1], ids=["tangents", "second derivatives"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_noise_moves_the_outermost_layers_as_the_covariances_say(pattern: str, way: int) -> None:
    """Noise of equal strength along all gridlines; the markers move until its pulls on each of them cancel."""
    layout = reference(pattern)
    topology, layer = topology_of(layout), layout.layer
    edges, across, count = topology.edges.astype(np.int64), normals(topology), len(layer)
    strength = np.linalg.norm(topology.edge_vectors, axis=1) * (topology.edge_cells >= 0).any(axis=1)
    curved, straight = (
        pull.reshape(2 * count, 2 * count) for pull in pulls_of(topology, places(layout, 20.0), strength, way)
    )
    response = np.linalg.inv(curved)
    variance = np.diag(response @ straight @ response.T).reshape(count, 2).sum(axis=1)
    own = strength[:, None] * topology.covariance_couplings[:, 3 * way : 3 * way + 3] * [1 / 3, 1 / 3, 1 / 6]
    square = np.stack([across[:, 0] ** 2, across.prod(axis=1), across[:, 1] ** 2], axis=1)
    diagonal = np.zeros((count, 3))
    for at in (0, 1):
        np.add.at(diagonal, edges[:, at], own[:, at, None] * square)
    blocks = diagonal, own[:, 2:] * square[:, [0, 1, 1, 2]]
    stated = covariances(*blocks, topology.edges, topology.spokes, 0.0, np.ones(count, np.bool_))
    ratio = variance / np.trace(stated, axis1=1, axis2=2)
    inside = ratio[layer <= 2].mean()
    for outer in (
        4,
        5,
    ):  # with the couplings of moved ends, the variances of layer 5 would be 7 to 20 % too small
        assert ratio[layer == outer].mean() == pytest.approx(inside, rel=0.015)
    assert ratio == pytest.approx(inside, rel=0.04)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_scatter_bends_gridlines_as_random_markers_do(pattern: str) -> None:
    """The shifts of the markers by the bending of all gridlines at each, over those by independent bending."""
    layout = reference(pattern)
    topology, xy = topology_of(layout), places(layout, 200.0)
    edges, across = topology.edges.astype(np.int64), normals(topology)
    sums = np.zeros((len(xy), 2, 2))
    np.add.at(sums, edges, (across[:, :, None] * across[:, None])[:, None])
    rng, draws, squares = np.random.default_rng(3), 300, np.zeros(len(xy))
    for _ in range(draws):
        leave, arrive = slopes(topology, xy + rng.normal(0.0, 1.0, xy.shape), 1.0, True).T
        pull = np.zeros_like(xy)
        np.add.at(pull, edges, (across * 0.5 * (leave - arrive)[:, None])[:, None])
        squares += (np.linalg.solve(sums, pull[..., None]) ** 2).sum(axis=(1, 2)) / draws
    known = 0.25 * np.trace(sums, axis1=1, axis2=2)
    if pattern == "honeycomb":
        layer = layout.layer[edges]
        inside, outside = (
            (layer < layout.layer.max() - 2).all(axis=1),
            (layer == layout.layer.max()).any(axis=1),
        )
        means = [float(topology.scatter_bending[chosen, 2].mean()) for chosen in (inside, outside)]
        assert means == pytest.approx([0.083, 0.3], abs=0.03)
    assert topology.scatter_bending[:, 2].mean() == pytest.approx((known * squares)[edges].mean(), rel=0.1)


def lone(
    xy: NDArray[np.float64], near: NDArray[np.int32], offset: NDArray[np.float64], m: int
) -> NDArray[np.float64]:
    """(2, 5) the derivatives at one marker by numpy."""
    known = [k for k, n in enumerate(near[m]) if n >= 0 and np.isfinite(xy[n, 0])]
    x, y = offset[m, known].T
    terms, weight = np.stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y]), (x * x + y * y) ** -2
    held = 1e9 if len(known) < 5 else 0.02 if len(known) < 8 else 0.001
    gram = (weight * terms) @ terms.T + np.diag([0.0, 0.0, held, held, held])
    return np.asarray(np.linalg.solve(gram, (weight * terms) @ (xy[near[m, known]] - xy[m])).T)


@pytest.mark.parametrize("missing", [0.0, 0.3, 0.75])
def test_a_map_at_an_incomplete_ring_is_the_weighted_least_squares_quadratic(missing: float) -> None:
    lattice = lattice_of(parse_layout(small_text("honeycomb", 5)))
    near = lattice.neighbours  # two rings
    offset = (lattice.marker_mm[near] - lattice.marker_mm[:, None]) / 1.5  # in edges
    rng = np.random.default_rng(int(100 * missing))
    xy = rng.normal(size=(len(near), 2))
    xy[rng.random(len(xy)) < missing] = np.nan
    out = local_maps(xy, near, offset, np.zeros((len(xy), 5, near.shape[1])))
    known = (near >= 0) & np.isfinite(xy[near, 0])
    span = [np.linalg.matrix_rank(offset[m, known[m]]) if known[m].any() else 0 for m in range(len(xy))]
    for m in range(len(xy)):
        if np.isnan(xy[m, 0]) or span[m] < 2:  # own place and two ways determine slopes
            assert np.isnan(out[m]).all()
        else:
            np.testing.assert_allclose(out[m], lone(xy, near, offset, m), rtol=1e-6, atol=1e-8)


def test_neighbours_along_one_line_give_no_map() -> None:
    offset = np.zeros((1, 18, 2))
    offset[0, :3] = [[1.0, 0.1], [-1.0, -0.1], [2.0, 0.21]]
    near = np.full((1, 18), -1, np.int32)
    near[0, :3] = 0
    out = local_maps(np.zeros((1, 2)), near, offset, np.zeros((1, 5, 18)))
    assert np.isnan(out).all()
