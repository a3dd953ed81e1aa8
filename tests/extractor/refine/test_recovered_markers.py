"""What synthesis has lost: which gridlines are read around it, what stays untouched, and what is sure, by how much."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.suites.scoring.reading import cached_extractor
from benchmarks.suites.stress.frames import plain_frame
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene.standard import standard_layout
from extractor import Status, parse_layout
from extractor.layout.topology import Topology, topology_of
from extractor.refine.acceptance import (
    DIRT_DEVIATION,
    MAX_SHIFT,
    MAX_SHIFT_ALL_CELLS,
    accepted_markers,
    add_dirt_variance,
    update_lost_markers,
    update_unaccepted_markers,
)
from extractor.refine.recovered_markers import REFERENCE_INTERVAL, _lost_and_reference_gridlines
from extractor.refine.solve.subproblem import number_subproblem, replaced_table_rows, selected_rows

Array = NDArray[Any]


@cache
def mesh() -> Topology:
    return topology_of(parse_layout(layout_to_json(standard_layout("honeycomb", 6))))


@pytest.mark.parametrize("lost", [[0], [0, 1, 60], [90]])
def test_gridlines_around_come_first_and_few_others(lost: list[int]) -> None:
    own, which = mesh(), np.zeros(len(mesh().spokes), np.bool_)
    which[lost] = True
    read, count = _lost_and_reference_gridlines(which, own.edges)
    first = [e for e, (a, b) in enumerate(own.edges) if a in lost or b in lost]
    assert read[:count].tolist() == first
    others = [e for e in range(0, len(own.edges), REFERENCE_INTERVAL) if e not in set(first)]
    assert read[count:].tolist() == others


def test_some_gridlines_alone_are_a_mesh_of_their_own() -> None:
    own = mesh()
    which = np.array([3, 7, 8, 40, 41, 100])
    markers, ends, around = number_subproblem(which, own.edges, own.spokes)
    np.testing.assert_array_equal(markers[ends], own.edges[which])
    assert len(set(markers.tolist())) == len(markers) == len(around)
    for k, m in enumerate(markers):
        kept = np.isin(own.spokes[m], which)
        np.testing.assert_array_equal(around[k] >= 0, kept)
        np.testing.assert_array_equal(which[around[k][kept]], own.spokes[m][kept])
    table = np.random.default_rng(0).normal(size=(len(own.edges), 3))
    np.testing.assert_array_equal(selected_rows(table, which), table[which])
    other = replaced_table_rows(table, which, np.zeros((len(which), 3)))
    assert (other[which] == 0).all() and (np.delete(other, which, 0) == np.delete(table, which, 0)).all()


def test_what_was_lost_is_put_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Markers of a clean image, taken from it: between what profiles and triangles say, and as sure as it claims."""
    shot, chosen = plain_frame("honeycomb", 0).shoot(), [20, 21, 130, 200, 250]

    def taken(xy: Array, cov: Array, *others: Any) -> tuple[Array, bool]:
        xy[chosen], cov[chosen] = np.nan, np.nan
        return update_unaccepted_markers(xy, cov, *others)  # type: ignore[no-any-return]

    monkeypatch.setattr("extractor.refine.refiner.update_unaccepted_markers", taken)
    markers = cached_extractor("honeycomb", 11).extract(shot.image)
    assert (markers.status[chosen] == Status.MEASURED).all()
    error = np.linalg.norm(markers.xy_px - shot.truths[0].marker_xy_px, axis=1)[chosen]
    sigma = np.sqrt(np.trace(markers.cov_px2, axis1=1, axis2=2))[chosen]
    assert (error < 3 * sigma).all() and (sigma < 0.6).all()
    assert error.max() < 0.2


def test_what_hardly_shows_is_sure_only_where_others_put_it() -> None:
    """Of four markers the first guides others; the next two do not, and one of these lies far from where it must."""
    start = np.zeros((4, 2))
    xy, cov = np.array([[3.0, 0.0], [0.3, 0.0], [3.0, 0.0], [np.nan, np.nan]]), np.ones((4, 2, 2))
    guiding, edge = np.where([[True], [False], [False], [True]], xy, np.nan), np.full(4, 10.0)
    unsure, some = update_unaccepted_markers(xy, cov, guiding, start, edge, False, 0.0)
    assert some and unsure.tolist() == [False, True, True, True]
    lost = update_lost_markers(xy, cov, unsure, np.zeros((4, 2)), start, edge)
    assert lost.tolist() == [False, False, True, True]
    assert np.isnan(xy[2:]).all() and np.isnan(cov[2:]).all() and np.isfinite(xy[:2]).all()
    lost = update_lost_markers(
        xy, cov, unsure, np.full((4, 2), np.nan), start, edge
    )  # nor where nobody knows
    assert lost.tolist() == [False, True, True, True]


def test_a_marker_far_from_its_triangles_is_not_sure_and_less_so_where_all_agree() -> None:
    """In a steep view triangles that agree lie 0.12 edges off: what synthesis says there stands."""
    edges, spokes = np.array([[0, 1]], np.int32), np.full((2, 6), -1, np.int32)
    spokes[:, 0] = 0
    diagonal, beside = np.array([[1e4, 0.0, 1e4]] * 2), np.zeros((1, 4))
    start, edge, every = np.array([[0.0, 0.0], [30.0, 0.0]]), np.full(2, 10.0), np.ones(2, np.bool_)
    for whole, limit in ((True, MAX_SHIFT_ALL_CELLS), (False, MAX_SHIFT)):
        for share, sure in ((0.95, True), (1.05, False)):
            near = start, edge, np.full(2, whole)
            measured = start + [0.0, share * limit * 10.0]
            xy, cov = accepted_markers(measured, diagonal, beside, np.zeros(1), edges, spokes, *near, every)
            assert np.isfinite(xy).all() == np.isfinite(cov).all() == sure
    assert 0.12 < MAX_SHIFT_ALL_CELLS < MAX_SHIFT


def test_gridlines_that_are_not_trusted_widen_a_covariance_and_unread_ones_do_not() -> None:
    spokes = np.array([[0, 1, 2, -1, -1, -1], [2, 3, -1, -1, -1, -1], [4, 5, -1, -1, -1, -1]], np.int32)
    use, edge = np.array([1.0, 0.4, 0.7, 1.0, 0.0, 0.0]), np.array([10.0, 20.0, 10.0])
    cov = np.broadcast_to(np.diag([0.01, 0.02]), (3, 2, 2)).copy()
    add_dirt_variance(cov, use, spokes, edge)
    wider = (DIRT_DEVIATION * edge * np.array([0.3, 0.15, 0.0])) ** 2
    for axis, before in enumerate((0.01, 0.02)):
        np.testing.assert_allclose(cov[:, axis, axis], before + wider)
    assert (cov[:, 0, 1] == 0.0).all() and (cov[:, 1, 0] == 0.0).all()
