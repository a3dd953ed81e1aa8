"""Markers that dirt leads astray: which they are, and what is measured around dirt."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Blob, Damage, Press, Scratch, Surface, composed, render
from cmpdesign.scene.standard import BLACK_RGB, standard_layout, standard_scene
from extractor import Extractor, Markers, Status, parse_layout
from extractor.layout.topology import Topology, topology_of
from extractor.presets import Preset
from extractor.refine.outliers import outlier_markers, suspect_markers
from extractor.refine.synthesis.gridlines import local_maps

Array = NDArray[np.float64]
SCRATCH = Damage(scratches=(Scratch((-7.0, 0.5), (1.0, 6.5), 0.5, (150.0, 150.0, 150.0)),))
DROPS = Damage(blobs=tuple(Blob((x, y), 0.7, BLACK_RGB) for x, y in ((1.5, 2.0), (-2.5, 1.0), (0.5, -2.6))))
LAYERS = 7
EDGE_PX = 10.0
PATTERNS = ("honeycomb", "round", "elliptical")


@cache
def layout(pattern: str) -> Layout:
    return standard_layout(pattern, LAYERS)


@cache
def mesh(pattern: str) -> Topology:
    return topology_of(parse_layout(layout_to_json(layout(pattern))))


def strays_in(xy: Array, pattern: str, doubted: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    own = mesh(pattern)
    maps = local_maps(xy, own.near, own.ring_vectors, own.derivative_stencil)
    doubted = np.zeros(len(xy), np.bool_) if doubted is None else doubted
    edge = np.full(len(xy), EDGE_PX)
    lattice = own.edges, own.next_markers, own.third_differences, own.spokes, own.next_edges, own.near
    return np.asarray(outlier_markers(xy, maps, doubted, edge, *lattice))


def smooth(pattern: str, bend: float, turn: float) -> Array:
    """A turned and bent pattern with edges of about 10 px."""
    mm = layout(pattern).marker_xy_mm
    pitch = np.linalg.norm(mm[1] - mm[2])
    x, y = EDGE_PX * mm.T / pitch
    x, y = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    reach = EDGE_PX * LAYERS
    return np.stack([x + bend * x * y / reach, y + bend * (x * x - y * y) / reach], axis=1)


@pytest.mark.parametrize("pattern", PATTERNS)
@settings(max_examples=30, deadline=None)
@given(
    bend=st.floats(-0.15, 0.15),
    turn=st.floats(0, 6.3),
    seed=st.integers(0, 2**32 - 1),
    far=st.floats(0.8, 8.0),
)
def test_one_marker_that_was_moved_is_found_and_no_other(
    pattern: str, bend: float, turn: float, seed: int, far: float
) -> None:
    """Anywhere but at the rim, where it is the end of what it is judged by, in noise as of a first round."""
    rng = np.random.default_rng(seed)
    xy = smooth(pattern, bend, turn)
    xy += rng.normal(0, 0.03, xy.shape)
    assert not strays_in(xy, pattern).any()
    moved = rng.integers(0, 1 + 3 * (LAYERS - 1) * LAYERS)
    angle = rng.uniform(0, 2 * np.pi)
    xy[moved] += far * np.array([np.cos(angle), np.sin(angle)])
    assert np.flatnonzero(strays_in(xy, pattern)).tolist() == [moved]


def test_a_marker_of_the_rim_is_found() -> None:
    """Gridlines end there: it is the last of four along most of them."""
    last = len(mesh("honeycomb").spokes) - 3
    xy = smooth("honeycomb", 0.1, 0.3)
    xy[last] += [1.5, 2.0]
    assert np.flatnonzero(strays_in(xy, "honeycomb")).tolist() == [last]


def test_strays_do_not_hide_each_other() -> None:
    """A row of markers along a scratch, each moved by what the scratch's side happens to be."""
    xy = smooth("honeycomb", 0.0, 0.0)
    row = np.flatnonzero((np.abs(xy[:, 1]) < 1) & (np.abs(xy[:, 0]) < 45))
    moves = np.random.default_rng(3).normal(0, 2.0, (len(row), 2))
    xy[row] += moves
    found = np.flatnonzero(strays_in(xy, "honeycomb"))
    assert set(found) <= set(row)
    assert len(found) >= 0.7 * len(row) >= 5


@pytest.mark.parametrize("pattern", PATTERNS)
def test_what_is_dented_or_slips_a_little_does_not_stray(pattern: str) -> None:
    xy = smooth(pattern, 0.0, 0.2)
    slip, dent = xy.copy(), xy.copy()
    slip[:, 1] += 0.4 * (xy[:, 0] > 3)
    away = xy - [4.0, 1.0]
    square = (away**2).sum(axis=1, keepdims=True)
    dent += 0.35 * away * np.exp(-square / (2 * (1.5 * EDGE_PX) ** 2))
    assert not strays_in(slip, pattern).any()
    assert not strays_in(dent, pattern).any()


def test_doubt_is_the_mean_of_what_was_read() -> None:
    own = mesh("honeycomb")
    use, read = np.ones(len(own.edges)), np.ones(len(own.edges), np.bool_)
    assert not suspect_markers(use, read, own.spokes)[1]
    use[own.spokes[0][:3]] = 0.0
    doubted, some = suspect_markers(use, read, own.spokes)
    assert some and np.flatnonzero(doubted).tolist() == [0]
    read[own.spokes[0][:3]] = False  # what is not read does not count
    assert not suspect_markers(use, read, own.spokes)[1]


def read(damage: Damage, preset: Preset, surface: Surface | None = None) -> tuple[Markers, Array, Array]:
    """The markers, their errors in px, and these over their deviations."""
    scene = replace(standard_scene(layout("honeycomb")), damage=damage, surface=surface)
    seen = render(scene, size=(480, 440))
    markers = Extractor(parse_layout(layout_to_json(layout("honeycomb"))), preset).extract(seen.image)
    off = markers.xy_px - seen.truth.marker_xy_px
    deviations = np.sqrt(np.einsum("mi,mij,mj->m", off, np.linalg.inv(markers.cov_px2), off) / 2)
    return markers, np.linalg.norm(off, axis=1), deviations


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("damage", [SCRATCH, DROPS], ids=["scratch", "black drops"])
def test_markers_beside_dirt_are_as_near_as_they_are_said_to_be(preset: Preset, damage: Damage) -> None:
    markers, error, deviations = read(damage, preset)
    measured = markers.status == Status.MEASURED
    assert measured.sum() > 0.93 * len(error)
    assert error[measured].max() < 1.6 and deviations[measured].max() < 6.0


def test_what_is_bent_sharply_beside_dirt_is_measured() -> None:
    """The rim of a steep press, whose gridlines bend as no dirt does."""
    surface = composed(Press(radius_mm=2.0, depth_mm=0.8, centre_mm=(1.0, -2.0)))
    plain, _, _ = read(Damage(), "balanced", surface)
    markers, error, _ = read(Damage(blobs=(Blob((-3.0, 3.0), 0.8, BLACK_RGB),)), "balanced", surface)
    xy = layout("honeycomb").marker_xy_mm
    away = (np.linalg.norm(xy - [-3.0, 3.0], axis=1) > 2.5) & (plain.status == Status.MEASURED)
    assert away.sum() > 130
    assert (markers.status[away] == Status.MEASURED).all()
    assert np.abs(markers.xy_px - plain.xy_px)[away].max() < 0.1
    assert error[away].max() < 0.15
