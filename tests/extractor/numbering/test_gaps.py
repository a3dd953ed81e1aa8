"""Across gaps and beside dirt: what is numbered there is right, and no dirt is the white cell."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from benchmarks.suites.scoring.reading import cached_extractor
from benchmarks.suites.scoring.score import MarkerScore, score_markers
from benchmarks.suites.stress.damage import missing_hole, with_scratches
from benchmarks.suites.stress.frames import PATTERNS, RGB, PatternFrame, plain_frame
from extractor.cells.cells import Cells
from extractor.complete.layer_arcs import predict_by_layer
from extractor.layout.lattice_tables import Lattice, cells_at, lattice_of
from extractor.numbering.gaps.detached_cells import number_detached_cells
from extractor.numbering.gaps.gap_check import inconsistent_cells, is_white_cell_contradicted
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points


def read(frame: PatternFrame) -> MarkerScore:
    shot = frame.shoot()
    return score_markers(cached_extractor(frame.layout.pattern, 11).extract(shot.image), shot, promised=True)


@cache
def lattice(pattern: str) -> Lattice:
    return lattice_of(cached_extractor(pattern, 11).layout)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 999),
    count=st.integers(1, 300),
    shape=st.sampled_from([(1, 1), (200, 1), (0, 1), (0, 0)]),
)
def test_the_nearest_are_those_of_a_tree(seed: int, count: int, shape: tuple[float, float]) -> None:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-50, 50, (count, 2)) * shape
    grid, wanted = bucket_grid(xy), min(8, count)
    for query in rng.uniform(-80, 80, (5, 2)) * shape:
        index, square = np.empty(8, np.int32), np.empty(8)
        found = fill_nearest_points(xy, grid, query[0], query[1], index, square)
        distance = cKDTree(xy).query(query, [*range(1, wanted + 1)])[0]
        assert found == wanted
        np.testing.assert_allclose(np.sqrt(square[:found]), distance, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(xy[index[:found]] - query, axis=1), distance, atol=1e-9)


def test_a_layers_quadratic_is_numpys() -> None:
    """In layer 8, sextant 2: markers off a quadratic by noise, three of them lost; the others as polyfit has them."""
    rng = np.random.default_rng(1)
    ids, step = 3 * 8 * 7 + 1 + np.arange(16, 25), np.linspace(-1, 1, 9)
    xy = np.full((397, 2), np.nan)
    rows = np.vander(step, 3)
    xy[ids] = rows @ rng.uniform(-40, 40, (3, 2)) + rng.normal(0, 0.2, (9, 2))
    known = np.ones(9, np.bool_)
    known[[2, 5, 6]] = False
    xy[ids[~known]] = np.nan
    place, variance = predict_by_layer(xy, 11)
    terms = np.polyfit(step[known], xy[ids[known]], 2)
    left = ((xy[ids[known]] - rows[known] @ terms) ** 2).sum() / (2 * 3)
    leverage = np.diag(rows @ np.linalg.inv(rows[known].T @ rows[known]) @ rows.T)
    np.testing.assert_allclose(place[ids[~known]], (rows @ terms)[~known])
    np.testing.assert_allclose(variance[ids[~known]], (left * (1 + leverage))[~known])
    assert np.isnan(place[np.setdiff1d(np.arange(397), ids[~known])]).all()


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("step", [(1, 1), (-1, 2), (2, -1)])
def test_cells_around_the_white_one_tell_that_all_is_a_step_aside(
    pattern: str, step: tuple[int, int]
) -> None:
    """Whatever was numbered beyond a gap: these lead back to the white cell, or past it; far from it, nobody tells."""
    table = lattice(pattern)
    center, whole = table.center_mm * (20.0, -20.0), np.ones(len(table.ink), np.bool_)
    white_mm = table.white_cell_frame[0]
    right, white_px = np.arange(len(center), dtype=np.int32), white_mm * (20.0, -20.0)
    shifted = cells_at(table.axial + np.array(step, np.int32), table)
    assert not is_white_cell_contradicted(center, whole, right, white_px, white_mm, table.layout_cells)
    assert is_white_cell_contradicted(center, whole, shifted, white_px, white_mm, table.layout_cells)
    far = np.linalg.norm(center - white_px, axis=1) > 130.0
    assert not is_white_cell_contradicted(
        center, whole & far, shifted, white_px, white_mm, table.layout_cells
    )
    assert not is_white_cell_contradicted(
        center, whole & False, shifted, white_px, white_mm, table.layout_cells
    )


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_part_numbered_one_step_aside_is_refused(pattern: str) -> None:
    """The cells right of a gap, numbered as those of their ink one step farther, fit each other, but not the rest: it
    is they that fall, or if the white cell is on their side, the others."""
    table = lattice(pattern)
    corners = table.marker_mm[table.corner_ids] * (20.0, -20.0)
    center = corners.mean(axis=1)
    cells = Cells(center, table.ink, np.full(len(center), 170.0), corners[:, [0, 2, 1]])
    right = np.arange(len(center), dtype=np.int32)
    gap, beyond = np.abs(center[:, 0] - 45) < 25, center[:, 0] >= 70
    white_px = center[np.argmin(np.hypot(*center.T))]
    right[gap] = -1
    for reference_px in (white_px, None):
        assert not inconsistent_cells(cells, right, table, False, reference_px).any()
    shifted = np.where(beyond, cells_at(table.axial + np.array([1, 1], np.int32), table), right)
    refused = inconsistent_cells(cells, shifted.astype(np.int32), table, False, white_px)
    assert refused[beyond & (shifted >= 0)].all()
    assert not refused[~beyond].any()
    others = inconsistent_cells(cells, shifted.astype(np.int32), table, False, center[beyond][0])
    assert others[~beyond & ~gap].all() and not others[beyond].all()


@pytest.mark.parametrize(
    ("pattern", "seed", "count", "width_mm", "rgb", "aside"),
    [
        ("honeycomb", 1374, 2, 0.49, (32.0, 76.0, 160.0), 1.08),
        ("elliptical", 1028, 3, 0.86, (46.0, 183.0, 143.0), 1.03),
        ("round", 1099, 3, 0.6, (191.0, 93.0, 131.0), 2.49),
        ("elliptical", 1160, 2, 0.86, (167.0, 153.0, 178.0), 1.3),
        ("honeycomb", 1308, 3, 0.39, (82.0, 138.0, 45.0), 1.37),
        ("elliptical", 1466, 3, 0.22, (168.0, 49.0, 83.0), 1.22),
    ],
)
def test_dirt_of_any_color_is_not_the_white_cell(
    pattern: str, seed: int, count: int, width_mm: float, rgb: RGB, aside: float
) -> None:
    """Scratches that cross black cells, and cut the pattern into parts that have no white cell of their own."""
    figures = read(with_scratches(plain_frame(pattern, seed), count, width_mm, rgb, aside))
    assert figures.wrong == 0
    assert figures.kept >= 0.96 * figures.sure


def test_a_block_beyond_a_scratch_is_numbered() -> None:
    figures = read(with_scratches(plain_frame("honeycomb", 0), 5, 0.3))
    assert figures.wrong == 0 and figures.kept >= 0.99 * figures.sure


@pytest.mark.parametrize("pattern", PATTERNS)
def test_cells_in_a_row_beside_a_hole_have_corners(pattern: str) -> None:
    figures = read(missing_hole(plain_frame(pattern, 0), 0.3))
    assert figures.wrong == 0 and figures.kept >= 0.98 * figures.sure


@pytest.mark.parametrize("pattern", PATTERNS)
def test_cells_that_touch_by_corners_are_numbered(pattern: str) -> None:
    """Three of ten cells missing, at random: the mesh falls to pieces, but corners hold together."""
    figures = [read(plain_frame(pattern, seed).damaged(missing_share=0.3)) for seed in (3, 4, 5)]
    assert all(one.wrong == 0 for one in figures)
    assert sum(one.kept for one in figures) >= 0.99 * sum(one.sure for one in figures)


@pytest.mark.parametrize("pieces", [1, 2, 3])
def test_a_cell_in_pieces_beyond_a_gap_has_no_number(pieces: int) -> None:
    """Each of them would be taken for the cell; without triangles, only the prediction tells which that is."""
    own, px = lattice("honeycomb"), 20.0
    x = own.center_mm[:, 0]
    known, beyond = np.flatnonzero(x < 0.0), np.flatnonzero((x > 3.0) & (np.abs(own.center_mm[:, 1]) < 2.0))
    target = beyond[np.argmin(x[beyond])]
    held = np.concatenate([known, np.repeat(target, pieces)])
    center = px * own.center_mm[held]
    center[len(known) :, 1] += 4.0 * np.arange(pieces)
    count, area = len(held), px * px * own.size_mm[held] ** 2 * 0.75**0.5 / 2
    numbers = np.concatenate([known, np.full(pieces, -1)]).astype(np.int32)
    cells = Cells(center, own.ink[held], area, np.full((count, 3, 2), np.nan))
    after = number_detached_cells(cells, Numbering(numbers, False, center[: len(known)].mean(axis=0), 0), own)
    assert (after.cell[: len(known)] == known).all()
    assert after.cell[len(known) :].tolist() == ([target] if pieces == 1 else [-1] * pieces)
