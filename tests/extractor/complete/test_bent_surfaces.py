"""Markers on surfaces that are bent: begun, drawn and repaired where what is around them says, and no farther."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene.standard import standard_layout
from extractor import Status, parse_layout
from extractor.cells.cells import Cells
from extractor.complete.consistency_filter import _shifted_rim_markers, _update_shifted_markers
from extractor.complete.repair import RepairedMarkers, repair_markers
from extractor.layout.lattice_tables import Lattice, lattice_of
from extractor.layout.neighbour_tables import MIN_QUADRATIC_NEIGHBOURS
from extractor.layout.topology import Topology, topology_of
from extractor.localmap.neighbour_prediction import MIN_CUBIC_NEIGHBOURS, cubic_variance
from extractor.numbering.lattice_walk import Numbering
from extractor.numbering.marker_places import InitialMarkers, merge_corners
from extractor.refine.estimate import RefinedMarkers
from extractor.refine.measure.gridline_weights import RIM_DEVIATION_PX, markers_after_shift

Array = NDArray[np.float64]
LAYERS, EDGE_PX, SIZE = 6, 20.0, (400, 400)


@cache
def layout() -> Layout:
    return standard_layout("honeycomb", LAYERS)


@cache
def lattice() -> Lattice:
    return lattice_of(parse_layout(layout_to_json(layout())))


@cache
def mesh() -> Topology:
    return topology_of(parse_layout(layout_to_json(layout())))


def twisted(amount: float) -> Array:
    """(M, 2) px: a surface turned the more the farther from the middle: odd about every marker on top of it."""
    x, y = lattice().marker_mm.T
    angle = amount * np.exp(-(x**2 + y**2) / 8.0)
    turned = np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)], axis=1)
    return EDGE_PX * turned * [1.0, -1.0] + 200.0


def repaired(xy: Array, lost: list[int], agreed: bool = True) -> RepairedMarkers:
    """What repair makes of markers measured to a hundredth of a pixel but for the lost ones; do triangles agree?"""
    count = len(xy)
    seen = xy + np.random.default_rng(0).normal(0.0, 0.01, xy.shape)
    cov = np.tile(1e-4 * np.eye(2), (count, 1, 1))
    seen[lost], cov[lost] = np.nan, np.nan
    free = np.zeros(count)
    refined = RefinedMarkers(seen, cov, np.ones(count, np.bool_), free, 1.0, 2.0, None, np.empty((0, 0, 3)))
    vouched = np.full(count, agreed)
    places = InitialMarkers(seen, np.full(count, EDGE_PX), np.empty((0, 3), np.int32), vouched, vouched)
    return repair_markers(refined, places, lattice(), SIZE)


# -- repair


@pytest.mark.parametrize("agreed", [True, False])
def test_a_marker_that_neither_triangles_nor_neighbours_vouch_for_is_lost(agreed: bool) -> None:
    xy = twisted(0.0)
    lost = [int(m) for m in mesh().near[0] if m >= 0]
    assert (repaired(xy, lost, agreed).status[0] == Status.MEASURED) == agreed


def test_a_cubic_leaves_nothing_of_a_cubic_and_the_noise_of_noise() -> None:
    x, y = lattice().marker_mm.T
    cubic = np.stack([20 * x + x**3 - 2 * x * y**2, 20 * y + y**3 + x**2 * y], axis=1) + 200.0
    wanted = lattice().neighbours.min(axis=1) >= 0
    assert (
        np.sqrt(cubic_variance(cubic, wanted, lattice().marker_mm, lattice().neighbours)[wanted]).max() < 1e-5
    )
    noise = np.random.default_rng(3).normal(0.0, 0.2, cubic.shape)
    left = cubic_variance(cubic + noise, wanted, lattice().marker_mm, lattice().neighbours)
    assert np.sqrt(left[wanted].mean()) == pytest.approx(0.2, rel=0.1)
    assert np.isinf(left[~wanted]).all()


def test_too_few_neighbours_say_nothing_of_a_cubic() -> None:
    xy, wanted = twisted(0.5), np.zeros(len(layout().marker_xy_mm), np.bool_)
    wanted[0] = True
    around = lattice().neighbours[0]
    xy[around[MIN_CUBIC_NEIGHBOURS:]] = np.nan
    assert np.isfinite(cubic_variance(xy, wanted, lattice().marker_mm, lattice().neighbours)[0])
    xy[around[0]] = np.nan
    assert np.isinf(cubic_variance(xy, wanted, lattice().marker_mm, lattice().neighbours)[0])


@pytest.mark.parametrize("amount", [0.0, 0.4, 0.7, 0.9])
def test_a_marker_amid_whole_rings_is_repaired_where_a_quadratic_misses_them(amount: float) -> None:
    xy = twisted(amount)
    found = repaired(xy, [0])
    assert found.status[0] == Status.REPAIRED
    away = np.hypot(*(found.xy_px[0] - xy[0]))
    assert away < 0.05 * EDGE_PX and away < 3.0 * np.sqrt(found.cov_px2[0, 0, 0])


def test_it_is_not_where_its_rings_have_gaps_or_the_surface_is_too_bent() -> None:
    gaps = [0, *lattice().neighbours[0][:6:2].tolist()]
    assert repaired(twisted(0.0), gaps).status[0] == Status.REPAIRED
    assert repaired(twisted(0.9), gaps).status[0] == Status.LOST
    assert repaired(twisted(3.0), [0]).status[0] == Status.LOST


@pytest.mark.parametrize(
    ("agreed", "off_px", "kept"), [(False, 2.6, True), (False, 3.6, False), (True, 2.6, False)]
)
def test_only_from_a_guess_a_corner_of_the_rim_may_slide(agreed: bool, off_px: float, kept: bool) -> None:
    """Its triangle, if there was one, was where the neighbours are; the guess too, but it says nothing."""
    flat = EDGE_PX * lattice().marker_mm + 200.0
    corner = int(np.flatnonzero(lattice().layer == LAYERS)[LAYERS // 2])
    xy, cov = flat.copy(), np.tile(1e-4 * np.eye(2), (len(flat), 1, 1))
    xy[corner, 0] += off_px
    all_agree = np.full(len(flat), agreed)
    edge, table = np.full(len(flat), EDGE_PX), lattice()
    slid = _shifted_rim_markers(xy, cov, np.ones(len(flat)), flat, edge, table.rim)
    _update_shifted_markers(
        xy, cov, slid, flat, edge, all_agree, table.neighbours, table.inward_neighbours, table.marker_mm
    )
    if kept:
        assert xy[corner, 0] == flat[corner, 0] + off_px
        assert np.sqrt(cov[corner, 0, 0]) == pytest.approx(0.5 * off_px, rel=0.01)
    elif agreed:
        np.testing.assert_array_equal(xy[corner], flat[corner])
    else:
        assert np.isnan(xy[corner]).all()


# -- places


@pytest.mark.parametrize(("tip_off", "believed"), [(0.0, True), (0.03, True), (0.2, False)])
def test_one_corner_of_a_triangle_is_believed_where_the_markers_around_say_the_same(
    tip_off: float, believed: bool
) -> None:
    """Dirt on the rim's cells moves their centers and two of their corners, or the third, the pattern's tip, too."""
    x, y = lattice().marker_mm.T
    xy = EDGE_PX * np.stack([x + 0.05 * x**2, 0.05 * y**2 - y], axis=1) + 200.0
    ids = lattice().corner_ids[:, [0, 2, 1]]  # clockwise in the image
    alone = lattice().cells_per_marker[ids] == 1
    at_rim = np.flatnonzero(alone.sum(axis=1) == 1)[::5]
    center, corner = xy[ids].mean(axis=1), xy[ids].copy()
    center[at_rim, 0] += 0.3 * EDGE_PX
    corner[at_rim] -= EDGE_PX * np.where(alone[at_rim], tip_off, 0.35)[..., None] * [0.0, 1.0]
    cells = Cells(center, lattice().ink, np.full(len(ids), 170.0), corner)
    numbering = Numbering(np.arange(len(ids), dtype=np.int32), False, np.full(2, 200.0), 0)
    tips = ids[at_rim][alone[at_rim]]
    away = np.hypot(*(merge_corners(cells, numbering, lattice(), SIZE).xy_px[tips] - xy[tips]).T) / EDGE_PX
    amid = (lattice().neighbours[tips] >= 0).sum(
        axis=1
    ) >= MIN_QUADRATIC_NEIGHBOURS  # a side, not where two meet
    assert amid.sum() >= 3
    assert (np.isclose(away, tip_off, atol=1e-6) if believed else away > 0.25)[amid].all()


# -- steps


@pytest.mark.parametrize(
    ("where", "known_px", "trusted", "guides"),
    [
        ("rim", 0.5 * RIM_DEVIATION_PX, 1.0, True),
        ("rim", 0.5 * RIM_DEVIATION_PX, 0.1, False),  # dirt lies on its gridlines
        ("rim", 2.0 * RIM_DEVIATION_PX, 1.0, False),
        ("inside", 0.5 * RIM_DEVIATION_PX, 1.0, False),  # the map through those all around knows better
    ],
)
def test_what_the_image_shows_well_is_drawn_there_at_the_rim(
    where: str, known_px: float, trusted: float, guides: bool
) -> None:
    """Two gridlines nearly in line show a corner worse than others are shown, and still better than the map does."""
    xy = twisted(0.0)
    marker = int(np.flatnonzero(lattice().layer == LAYERS)[2]) if where == "rim" else 0
    least, use = np.full(len(xy), 0.001**-2.0), np.ones(len(mesh().edges))
    least[marker] = known_px**-2
    use[mesh().spokes[marker][mesh().spokes[marker] >= 0]] = trusted
    measured, guiding = markers_after_shift(xy, np.full(xy.shape, 0.25), least, use, mesh().spokes)
    np.testing.assert_array_equal(measured, xy + 0.25)
    assert np.isfinite(guiding[np.arange(len(xy)) != marker]).all()
    assert np.isfinite(guiding[marker]).all() == guides
