"""Cells that look larger than they are: found, taken out of what gridlines say, and out of where triangles were."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.suites.scoring.reading import cached_extractor
from benchmarks.suites.stress.frames import CaseImage, plain_frame
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene.standard import standard_layout
from extractor import Markers, parse_layout
from extractor.layout.topology import Topology, topology_of
from extractor.refine.synthesis.dot_gain import (
    markers_without_dot_gain,
    measure_dot_gain,
    update_without_dot_gain,
)
from extractor.refine.synthesis.residual_kernel import AA, AB, AC, AD, BB, BC, BD, MISFIT, SUMS, C, D

Array = NDArray[Any]
BLUR = 0.6


@cache
def mesh() -> Topology:
    return topology_of(parse_layout(layout_to_json(standard_layout("honeycomb", 6))))


def read(off: float, scatter: float = 0.0) -> tuple[Array, Array, Array, Array, Array]:
    """Sums, votes, contrasts and the sense of gridlines whose cells are larger by ``level_shift`` px, and nothing
    else."""
    rng, count = np.random.default_rng(0), len(mesh().edges)
    sums = np.zeros((count, SUMS))
    sums[:, [AA, BB]], sums[:, AB] = rng.uniform(2, 4, (count, 2)), rng.uniform(0.5, 1, count)
    for k in (AC, AD, BC, BD):
        sums[:, k] = rng.uniform(-1, 1, count)
    sense = rng.choice([-1.0, 1.0], count)
    contrasts = sense[:, None] * rng.uniform(20, 90, (count, 3))
    sense[(mesh().edge_cells >= 0).all(axis=1)] = 0.0
    apart = off * sense + scatter * rng.normal(size=count)
    to_a, to_b = apart * (sums[:, AA] + sums[:, AB]), apart * (sums[:, AB] + sums[:, BB])
    sums[:, C], sums[:, D] = apart * (sums[:, AC] + sums[:, BC]), apart * (sums[:, AD] + sums[:, BD])
    sums[:, MISFIT] = apart * (to_a + to_b)
    return sums, to_a, to_b, contrasts, sense


@pytest.mark.parametrize("off", [0.3, -0.15])
def test_what_all_gridlines_say_alike_is_found(off: float) -> None:
    *said, _ = read(off, scatter=0.1)
    assert measure_dot_gain(*said, mesh().edge_cells, BLUR) == pytest.approx(off, abs=0.02)


def test_a_little_is_none() -> None:
    *said, _ = read(0.05)
    assert measure_dot_gain(*said, mesh().edge_cells, BLUR) == 0.0
    before = [part.copy() for part in said]
    assert not update_without_dot_gain(*said, mesh().edge_cells, 0.0).any()
    for own, old in zip(said, before, strict=True):
        np.testing.assert_array_equal(own, old)


def test_it_is_taken_out_of_all_that_gridlines_say() -> None:
    sums, to_a, to_b, contrasts, sense = read(0.3)
    aside = update_without_dot_gain(sums, to_a, to_b, contrasts, mesh().edge_cells, 0.3)
    np.testing.assert_allclose(aside, 0.3 * sense)
    for rest in (to_a, to_b, sums[:, C], sums[:, D], sums[:, MISFIT]):
        np.testing.assert_allclose(rest, 0.0, atol=1e-12)


def test_gridlines_that_were_not_read_say_nothing() -> None:
    sums, to_a, to_b, contrasts, _ = read(0.3)
    sums[::2], to_a[::2], to_b[::2] = 0.0, 0.0, 0.0
    assert measure_dot_gain(sums, to_a, to_b, contrasts, mesh().edge_cells, BLUR) == pytest.approx(0.3)
    assert not update_without_dot_gain(sums, to_a, to_b, contrasts, mesh().edge_cells, 0.3)[::2].any()
    few = np.arange(len(sums)) < 60
    assert measure_dot_gain(sums * few[:, None], to_a, to_b, contrasts, mesh().edge_cells, BLUR) == 0.0


@pytest.mark.parametrize("turn", [1, -1])
def test_a_triangle_shrinks_by_as_much_on_every_side(turn: int) -> None:
    corner = np.array([[0.0, 0.0], [20.0, 1.0], [8.0, 15.0]])
    cell = np.arange(3)[::turn].reshape(1, 3)
    inner = markers_without_dot_gain(corner, cell, 0.7)
    for k in range(3):
        along = corner[(k + 1) % 3] - corner[k]
        inward = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        np.testing.assert_allclose((inner[[k, (k + 1) % 3]] - corner[k]) @ inward, 0.7)


def test_what_has_no_cell_or_is_unknown_stays() -> None:
    xy = np.array([[0.0, 0.0], [20.0, 1.0], [np.nan, np.nan], [5.0, 5.0]])
    np.testing.assert_array_equal(markers_without_dot_gain(xy, np.array([[0, 1, 2]]), 0.7), xy)


def off(markers: Markers, shot: CaseImage) -> tuple[float, float]:
    """The errors' RMS per axis, px: of the outermost layer, and of all virtual markers."""
    truth, outermost = shot.truths[0], shot.scene.layout.marker_layer == 11
    error = (markers.xy_px - truth.marker_xy_px)[outermost]
    virtual = markers.virtual_xy_px - truth.virtual_xy_px
    return float(np.sqrt(np.nanmean(error**2))), float(np.sqrt(np.nanmean(virtual**2)))


@pytest.mark.parametrize("pattern", ["honeycomb", "round"])
@pytest.mark.parametrize("gamma", [0.45, 2.2])
def test_a_curved_response_moves_neither_rim_nor_virtual_markers(pattern: str, gamma: float) -> None:
    """Where the cells' swelling is left in, the rim is off by 0.5 to 1 px, and virtual markers by 0.3 to 0.5 px."""
    shot = plain_frame(pattern, 0).taken(gamma=gamma).shoot()
    rim, virtual = off(cached_extractor(pattern, 11).extract(shot.image), shot)
    assert rim < 0.12 and virtual < 0.08


@pytest.mark.parametrize("pattern, seed", [("honeycomb", 0), ("round", 2), ("elliptical", 8)])
def test_bled_inks_lose_no_rim_and_widen_no_blur(pattern: str, seed: int) -> None:
    """Elliptical loses three markers where the rim may not move by its swelling, five where triangles keep theirs."""
    shot = plain_frame(pattern, seed).damaged(bleed_mm=0.1).shoot()
    markers = cached_extractor(pattern, 11).extract(shot.image)
    assert np.isnan(markers.xy_px[:, 0]).sum() <= 1
    assert off(markers, shot)[0] < 1.0
    found = markers.stages["refine"].blur_px
    assert found == pytest.approx(np.sqrt(1.0 + 1 / 3), rel=0.15)
