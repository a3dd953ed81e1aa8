"""Dirt: errors beside dirt agree with the covariances, hidden markers follow from others, and far markers do not
move.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.suites.scoring.reading import read_case
from benchmarks.suites.stress.conditions import matching_cases
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Blob, Camera, Damage, Press, Rendered, Scratch, Surface, composed
from cmpdesign.scene.standard import BLACK_RGB, standard_layout
from extractor import Markers, Status
from tests.support.errors import deviations, errors_px
from tests.support.standard_views import extractor, shown

LAYERS, SIZE = 7, (480, 440)
PATTERNS = ("honeycomb", "round", "elliptical")
GREY_RGB = (150.0, 150.0, 150.0)
SCRATCH = Damage(scratches=(Scratch((-7.0, 0.5), (1.0, 6.5), 0.5, GREY_RGB),))
DROPS = Damage(blobs=tuple(Blob((x, y), 0.7, BLACK_RGB) for x, y in ((1.5, 2.0), (-2.5, 1.0), (0.5, -2.6))))
PRESSED = composed(Press(4.0, 0.5))


@cache
def layout(pattern: str) -> Layout:
    return standard_layout(pattern, LAYERS)


def read(
    pattern: str, preset: str, damage: Damage | None, surface: Surface | None = None, seed: int = 0
) -> tuple[Markers, Rendered]:
    seen = shown(pattern, layers=LAYERS, size=SIZE, damage=damage, surface=surface, seed=seed)
    return extractor(pattern, preset, LAYERS).extract(seen.image), seen


def distance_edges(pattern: str, *places_mm: tuple[float, float]) -> NDArray[np.float64]:
    """(M,) from the nearest of these places; the layouts' pitch is 1 mm."""
    away = layout(pattern).marker_xy_mm[:, None] - np.array(places_mm)
    return np.asarray(np.linalg.norm(away, axis=2).min(axis=1))


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("damage", [SCRATCH, DROPS], ids=["scratch", "black drops"])
def test_markers_beside_dirt_are_as_near_as_they_are_said_to_be(preset: str, damage: Damage) -> None:
    markers, seen = read("honeycomb", preset, damage)
    measured = markers.status == Status.MEASURED
    assert measured.mean() > 0.93
    assert errors_px(markers, seen)[measured].max() < 2.4
    assert deviations(markers, seen)[measured].max() < 6.5


@pytest.mark.parametrize("rgb", [BLACK_RGB, GREY_RGB], ids=["black", "grey"])
@pytest.mark.parametrize("surface", [None, PRESSED], ids=["flat", "pressed"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_dirt_moves_no_marker_that_it_does_not_touch(
    pattern: str, surface: Surface | None, rgb: tuple[float, float, float]
) -> None:
    """The same noise with dirt and without: some edges away all markers stay, within their noise."""
    at = (-2.0, 1.5)
    clean, _ = read(pattern, "accurate", None, surface, seed=3)
    dirty, seen = read(pattern, "accurate", Damage(blobs=(Blob(at, 0.6, rgb),)), surface, seed=3)
    away = distance_edges(pattern, at)
    np.testing.assert_array_equal(dirty.status[away > 2.5], clean.status[away > 2.5])
    moved = np.linalg.norm(dirty.xy_px - clean.xy_px, axis=1)
    moved /= np.sqrt(np.trace(clean.cov_px2, axis1=1, axis2=2) / 2)
    assert np.nanmax(moved[away > 3.0]) < 2.7 and np.nanmedian(moved[away > 3.0]) < 0.12
    beside = away < 2.5
    assert (
        np.nanmax(deviations(dirty, seen)[beside]) < 4.0 and np.nanmax(errors_px(dirty, seen)[beside]) < 0.9
    )


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("left", [0, 1, 2])
def test_what_hardly_shows_lies_where_it_is_said_to_be(pattern: str, preset: str, left: int) -> None:
    """None, one or two of a marker's gridlines remain: the marker is lost, or correct within a twentieth of an edge."""
    for trial in range(4):
        rng = np.random.default_rng(trial)
        marker = int(rng.integers(0, 60))
        own = layout(pattern).edges[(layout(pattern).edges == marker).any(axis=1)]
        hidden = layout(pattern).marker_xy_mm[rng.permutation(own)[left:]].mean(axis=1)
        blobs = tuple(Blob((float(x), float(y)), 0.42, BLACK_RGB) for x, y in hidden)
        markers, seen = read(pattern, preset, Damage(blobs=blobs), seed=trial)
        if markers.status[marker] != Status.LOST:
            assert errors_px(markers, seen)[marker] < 0.05 * 20.0
            assert deviations(markers, seen)[marker] < 6.0
        assert np.nanmax(errors_px(markers, seen)) < 1.0


def test_what_is_bent_sharply_beside_dirt_is_measured() -> None:
    """The rim of a steep press, whose gridlines bend as no dirt does."""
    surface, drop = composed(Press(radius_mm=2.0, depth_mm=0.8, centre_mm=(1.0, -2.0))), (-3.0, 3.0)
    plain, _ = read("honeycomb", "balanced", None, surface)
    markers, seen = read("honeycomb", "balanced", Damage(blobs=(Blob(drop, 0.8, BLACK_RGB),)), surface)
    away = (distance_edges("honeycomb", drop) > 2.5) & (plain.status == Status.MEASURED)
    assert away.sum() > 130
    assert (markers.status[away] == Status.MEASURED).all()
    assert np.abs(markers.xy_px - plain.xy_px)[away].max() < 0.1
    assert errors_px(markers, seen)[away].max() < 0.15


def test_a_corner_beyond_the_border_that_few_cells_placed_inside_is_not_reported() -> None:
    case = matching_cases("overflowing=40/elliptical")[0]
    result = read_case(case, runs=1, timing=False)[0]
    assert result.score.measured > 150 and result.score.outside == 0 and result.score.wrong == 0


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_cut_view_with_dirt_is_read(pattern: str) -> None:
    """Cells at the image's border that hardly show guide nothing, whatever step is taken around them."""
    blobs = tuple(Blob(at, 0.5, BLACK_RGB) for at in ((-2.0, 1.5), (0.3, -2.4)))
    seen = shown(
        pattern, camera=Camera(40.0, 7.3), damage=Damage(blobs=blobs), surface=composed(Press(4.0, 0.6))
    )
    markers = extractor(pattern, "accurate").extract(seen.image)
    found = markers.status != Status.LOST
    assert found.sum() > 30
    deep = found & ((markers.xy_px > 24) & (markers.xy_px < np.array(seen.image.shape[1::-1]) - 24)).all(
        axis=1
    )
    assert errors_px(markers, seen)[found].max() < 2.5  # half of the cell at the image's corner is outside
    assert deviations(markers, seen)[deep].max() < 5.0 and deviations(markers, seen)[found].max() < 6.5
