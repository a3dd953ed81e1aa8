"""Gridlines that bend more sharply than the markers' smooth map: what frees them, what is solved, what comes of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Camera, Rendered, render
from cmpdesign.scene.standard import standard_layout, standard_scene
from extractor import Extractor, Status, parse_layout
from extractor.complete.consistency_filter import _shifted_rim_markers, _update_shifted_markers
from extractor.layout.lattice_tables import lattice_of
from extractor.layout.topology import Topology, topology_of
from extractor.refine.measure.gridline_bending import (
    MAX_BEND_DEVIATION,
    MAX_BEND_SHARE,
    bend_after_shift,
    estimate_bend_variance,
    measure_roughness,
    update_without_bending,
)
from extractor.refine.synthesis.gridlines import KNOWN, LENGTH, UX, local_maps
from extractor.refine.synthesis.residual_kernel import (
    AA,
    AB,
    AC,
    AD,
    BB,
    BC,
    BD,
    CC,
    CD,
    DD,
    MISFIT,
    SUMS,
    A,
    B,
    C,
    D,
)

Array = NDArray[np.float64]
LAYERS = 6
SIZE = (320, 280)


@cache
def layout(pattern: str = "honeycomb") -> Layout:
    return standard_layout(pattern, LAYERS)


@cache
def mesh(pattern: str = "honeycomb") -> Topology:
    return topology_of(parse_layout(layout_to_json(layout(pattern))))


def rough_at(
    xy: Array, pattern: str = "honeycomb", information: float = 1e4, which: Array | None = None
) -> Array:
    """How rough markers at ``xy`` are, each known to a hundredth of a pixel."""
    own = mesh(pattern)
    maps = local_maps(xy, own.near, own.ring_vectors, own.derivative_stencil)
    diagonal = np.tile([information, 0.0, information], (len(xy), 1))
    which = np.ones(len(xy), np.bool_) if which is None else which
    about = own.edges, own.next_markers, own.third_differences, own.spokes, own.near
    return np.asarray(measure_roughness(xy, maps, diagonal, *about, which))


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_what_is_flat_or_noisy_is_not_rough(pattern: str) -> None:
    xy = 20 * layout(pattern).marker_xy_mm @ np.array([[1.1, 0.2], [-0.3, 0.8]])
    assert rough_at(xy, pattern).max() == 0.0
    noise = np.random.default_rng(0).normal(0, 0.01, xy.shape)
    noisy = rough_at(xy + noise, pattern)
    assert (noisy > 0).mean() < 0.2 and MAX_BEND_SHARE * np.sqrt(noisy.max()) < 0.03


def test_a_kink_is_rough_and_one_moved_marker_is_not() -> None:
    xy = 20 * layout().marker_xy_mm
    kinked = xy.copy()
    kinked[:, 1] += 0.2 * np.maximum(xy[:, 0] - 3, 0)
    near, far = np.abs(xy[:, 0] - 3) < 12, np.abs(xy[:, 0] - 3) > 60
    assert (rough_at(kinked)[near] > 1).all() and rough_at(kinked)[far].max() == 0.0
    some = np.random.default_rng(1).random(len(xy)) < 0.4
    np.testing.assert_array_equal(rough_at(kinked, which=some), np.where(some, rough_at(kinked), 0.0))
    dirty = xy.copy()
    dirty[0] += [4.0, -2.0]
    assert rough_at(dirty).max() == 0.0


def read(curve: Array, density: float = 4e4, stations: int = 9) -> Array:
    """(1, SUMS) what profiles see of a gridline that lies off by ``curve`` at its stations."""
    t = (np.arange(stations) + 0.5) / stations
    terms = np.stack([1 - t, t, t * (1 - t), t * (1 - t) * (1 - 2 * t)])
    gram, votes = density * terms @ terms.T, density * terms @ curve
    out = np.zeros((1, SUMS))
    for column, value in zip((AA, AB, AC, AD, BB, BC, BD, CC, CD, DD), gram[np.triu_indices(4)], strict=True):
        out[0, column] = value
    out[0, [A, B, C, D]] = votes
    out[0, MISFIT] = density * curve @ curve
    return out


@settings(max_examples=60, deadline=None)
@given(
    shape=st.lists(st.floats(-1, 1), min_size=4, max_size=4),
    before=st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=2),
    loose=st.floats(1e-6, 1.0),
)
def test_eliminating_and_following_solves_the_whole_system(
    shape: list[float], before: list[float], loose: float
) -> None:
    """Ends first and bending afterwards is the same as all four unknowns at once, with bending's prior."""
    t = (np.arange(9) + 0.5) / 9
    sums = read(np.stack([1 - t, t, t * (1 - t), t * (1 - t) * (1 - 2 * t)]).T @ shape)
    whole, right = np.empty((4, 4)), sums[0, [A, B, C, D]].copy()
    whole[np.triu_indices(4)] = sums[0, [AA, AB, AC, AD, BB, BC, BD, CC, CD, DD]]
    whole = np.triu(whole) + np.triu(whole, 1).T
    variance = 4.0
    whole[[2, 3], [2, 3]] += variance / loose
    right[2:] -= variance / loose * np.array(before)
    wanted = np.linalg.solve(whole, right)
    to_a, to_b = sums[:, A].copy(), sums[:, B].copy()
    bend = np.array([before])
    kept = update_without_bending(sums, to_a, to_b, np.zeros(1), bend, np.array([loose]), variance)
    ends = np.linalg.solve([[sums[0, AA], sums[0, AB]], [sums[0, AB], sums[0, BB]]], [to_a[0], to_b[0]])
    np.testing.assert_allclose(ends, wanted[:2], atol=1e-6)
    lines = np.zeros((1, 8))
    lines[0, [UX, LENGTH, KNOWN]] = 1.0, 20.0, 1.0
    shift = np.array([[0.0, ends[0]], [0.0, ends[1]]])
    after = bend_after_shift(bend, kept, shift, lines, np.array([[0, 1]], np.int32))
    np.testing.assert_allclose(after[0] - before, wanted[2:], atol=1e-6)


def test_a_stiff_gridline_loses_the_bending_it_had() -> None:
    sums = read(np.zeros(9))
    to_a, to_b = sums[:, A].copy(), sums[:, B].copy()
    kept = update_without_bending(sums, to_a, to_b, np.zeros(1), np.array([[0.3, -0.1]]), np.zeros(1), 4.0)
    np.testing.assert_array_equal(kept[0, :2], [-0.3, 0.1])
    assert to_a[0] > 0  # the image shows a straight gridline: without its bending its start lies higher


@pytest.mark.parametrize(("b", "least", "most"), [(0.0, 0.0, 0.03), (1.0, 0.5, 1.5)])
def test_freedom_is_what_gridlines_show(b: float, least: float, most: float) -> None:
    own = mesh()
    t = (np.arange(9) + 0.5) / 9
    sums = np.repeat(read(b * t * (1 - t)), len(own.edges), axis=0)
    rough = np.full(len(layout().marker_xy_mm), 100.0)
    given_ = sums, sums[:, A], sums[:, B], np.zeros(len(sums)), np.zeros((len(sums), 2)), rough
    lines = np.zeros((len(sums), 8))
    lines[:, LENGTH] = 20.0
    loose = estimate_bend_variance(*given_, np.ones(len(sums)), lines, own.edges, 4.0)
    assert (least <= np.sqrt(loose)).all() and (np.sqrt(loose) <= max(most, 0.015 * 10 + 1e-9)).all()
    short = lines.copy()
    short[:, LENGTH] = 2.0
    held = estimate_bend_variance(*given_, np.ones(len(sums)), short, own.edges, 4.0)
    assert (np.sqrt(held) <= MAX_BEND_DEVIATION * 2.0 + 1e-9).all()
    tight = estimate_bend_variance(*given_[:-1], 1e-4 * rough, np.ones(len(sums)), lines, own.edges, 4.0)
    assert (np.sqrt(tight) <= MAX_BEND_SHARE * 0.1 + 1e-9).all()


@pytest.mark.parametrize(
    ("refined_off", "found_off", "agreed", "free_px", "expected"),
    [
        ((4.0, 0.0), (0.0, 0.0), True, 1.0, "found"),  # it slid: back to where its triangle is
        ((4.0, 0.0), (0.0, 0.0), False, 1.0, "lost"),
        ((4.0, 0.0), (0.0, 0.0), True, 0.0, "refined"),  # its gridlines do not bend: refinement is believed
        ((0.0, 0.0), (4.0, 0.0), True, 1.0, "refined"),  # refinement is where the neighbours say
        ((9.0, 0.0), (5.0, 0.0), True, 1.0, "lost"),  # neither is
    ],
)
def test_a_corner_of_the_rim_that_slid_is_not_believed(
    refined_off: tuple[float, float],
    found_off: tuple[float, float],
    agreed: bool,
    free_px: float,
    expected: str,
) -> None:
    lattice = lattice_of(parse_layout(layout_to_json(layout())))
    flat = 20 * layout().marker_xy_mm + 200
    count, corner = len(flat), int(np.flatnonzero(lattice.layer == LAYERS)[LAYERS // 2])  # amid a side
    xy, found = flat.copy(), flat.copy()
    xy[corner] += refined_off
    found[corner] += found_off
    cov = np.tile(1e-4 * np.eye(2), (count, 1, 1))
    all_agree = np.full(count, agreed)
    after, edge = xy.copy(), np.full(count, 20.0)
    slid = _shifted_rim_markers(after, cov, np.full(count, free_px), found, edge, lattice.rim)
    _update_shifted_markers(
        after,
        cov,
        slid,
        found,
        edge,
        all_agree,
        lattice.neighbours,
        lattice.inward_neighbours,
        lattice.marker_mm,
    )
    others = np.arange(count) != corner
    np.testing.assert_array_equal(after[others], flat[others])
    wanted = {"found": found[corner], "refined": xy[corner], "lost": [np.nan, np.nan]}[expected]
    np.testing.assert_array_equal(after[corner], wanted)
    assert (cov[corner, 0, 0] == pytest.approx(0.8**2)) == (expected == "found")


LOADS = {"press": Motion(1.0), "shear": Motion(1.0, (0.5, 0.0)), "twist": Motion(1.0, twist_deg=10.0)}


@cache
def pressed(load: str, seed: int) -> Rendered:
    """A ball whose rim lies between markers, pressed, dragged or turned in a layer of 4 mm; 20 px to an edge."""
    surface = solve(Elastomer(4.0, 0.2, 0.48), Ball(12.0), LOADS[load]).surface()
    shown = standard_scene(layout())
    return render(replace(shown, surface=surface, camera=Camera(20.0), seed=seed), size=SIZE)


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("load", sorted(LOADS))
def test_markers_under_a_contact_are_as_good_as_they_say(load: str, preset: str) -> None:
    extractor = Extractor(parse_layout(layout_to_json(layout())), preset)  # type: ignore[arg-type]
    squares, errors = [], []
    for seed in range(2):
        seen = pressed(load, seed)
        markers = extractor.extract(seen.image)
        inner = (layout().marker_layer < LAYERS) & (markers.status == Status.MEASURED)
        assert inner.sum() >= (layout().marker_layer < LAYERS).sum() - 1
        error = (markers.xy_px - seen.truth.marker_xy_px)[inner]
        squares.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(markers.cov_px2[inner]), error) / 2)
        errors.append(error)
    assert np.sqrt(np.concatenate(squares).mean()) < 1.4
    assert np.abs(np.concatenate(errors)).max() < 0.3
