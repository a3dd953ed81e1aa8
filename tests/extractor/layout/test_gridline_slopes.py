"""How gridlines depend on the markers of a layout: by derivation, and by moving the markers one by one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene.standard import standard_layout
from extractor import Reference, parse_layout
from extractor.layout.gridline_slopes import end_couplings, scatter_bending, slope_weights
from extractor.layout.topology import Topology, topology_of
from extractor.refine.synthesis.gridlines import gridlines, local_maps

PATTERNS = ("honeycomb", "round", "elliptical")
SHARES = (0.0, 1.0)  # curves by the map's tangents, by its second derivatives


def reference(pattern: str) -> Reference:
    return parse_layout(layout_to_json(standard_layout(pattern, 5)))


def bending(topology: Topology, xy: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """(E,) px, the b of the gridlines through the markers (M, 2)."""
    maps = local_maps(xy, topology.ring_markers, topology.ring_vectors, topology.derivative_stencil)
    lines = gridlines(
        xy, maps, np.zeros((len(topology.edges), 2)), topology.edges, topology.edge_vectors, share
    )
    return np.asarray(0.5 * lines[:, 4] * (lines[:, 5] - lines[:, 6]))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_weights_say_how_each_marker_bends_each_gridline(pattern: str) -> None:
    layout = reference(pattern)
    topology = topology_of(layout)
    edges = topology.edges.astype(np.int64)
    edge_mm = np.linalg.norm(np.diff(layout.xy_mm[edges], axis=1), axis=2).mean()
    xy = 20.0 / edge_mm * layout.xy_mm
    slopes = slope_weights(topology.derivative_stencil, topology.ring_markers, edges, topology.edge_vectors)
    normals = np.stack([-topology.edge_vectors[:, 1], topology.edge_vectors[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    step = 1e-4
    for marker in range(0, len(xy), 7):
        moved = np.zeros_like(xy)
        moved[marker] = step, -0.5 * step
        offsets = normals @ moved[marker] / step
        for way, share in enumerate(SHARES):
            found = (bending(topology, xy + moved, share) - bending(topology, xy - moved, share)) / (2 * step)
            weights = 0.5 * (slopes.leave[way] - slopes.arrive[way]) * (slopes.ids == marker)
            assert np.allclose(weights.sum(axis=1) * offsets, found, atol=1e-3)


def test_a_gridline_moves_more_inside_and_less_at_the_rim_than_a_straight_line() -> None:
    """Inside, cardinal cubics have 1.1; at the rim of one row, the parabola through three markers has 7/8."""
    layout = reference("honeycomb")
    topology = topology_of(layout)
    rim = layout.layer[topology.edges] == layout.layer.max()
    couplings = topology.end_couplings
    inside = ~rim.any(axis=1) & (layout.layer[topology.edges] < layout.layer.max() - 2).all(axis=1)
    assert np.allclose(couplings[inside, :2], 1.0867, atol=1e-3)
    inward = rim[:, 0] != rim[:, 1]
    at_rim = np.where(rim[inward, 0], couplings[inward, 0], couplings[inward, 1])
    assert np.median(at_rim) == pytest.approx(7 / 8, abs=0.04) and at_rim.max() < 0.95


def test_without_maps_gridlines_are_straight() -> None:
    topology = topology_of(reference("honeycomb"))
    edges = topology.edges.astype(np.int64)
    nothing = np.zeros_like(topology.derivative_stencil)
    slopes = slope_weights(nothing, topology.ring_markers, edges, topology.edge_vectors)
    assert np.allclose(end_couplings(slopes, edges)[:, 3:], 1.0)
    bent = scatter_bending(slopes, edges, topology.edge_vectors, topology.spokes)
    assert np.allclose(bent[:, 1:], 0.0)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_scatter_bends_gridlines_as_random_markers_do(pattern: str) -> None:
    """The markers' shifts by the bending of all gridlines at each, by Monte Carlo."""
    layout = reference(pattern)
    topology = topology_of(layout)
    edges, count = topology.edges.astype(np.int64), len(layout.xy_mm)
    edge_mm = np.linalg.norm(np.diff(layout.xy_mm[edges], axis=1), axis=2).mean()
    xy = 200.0 / edge_mm * layout.xy_mm
    normals = np.stack([-topology.edge_vectors[:, 1], topology.edge_vectors[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    gridlines_at = np.zeros((count, 2, 2))
    np.add.at(gridlines_at, edges, (normals[:, :, None] * normals[:, None])[:, None])
    rng, draws, total = np.random.default_rng(3), 400, np.zeros(count)
    for _ in range(draws):
        b = bending(topology, xy + rng.normal(0.0, 1.0, xy.shape), 1.0)
        pull = np.zeros((count, 2))
        np.add.at(pull, edges, (normals * b[:, None])[:, None])
        shift = np.linalg.solve(gridlines_at, pull[..., None])[..., 0]
        total += (shift * shift).sum(axis=1) / draws
    # gridlines that bend each by itself, of variance 1, move a marker by the inverse of their sum
    variance = total / np.trace(np.linalg.inv(gridlines_at), axis1=1, axis2=2)
    found = variance[edges].mean(axis=1)
    assert np.allclose(topology.scatter_bending[:, 2].mean(), found.mean(), rtol=0.1)
