"""Covariances are true: Monte Carlo over patterns, flat and deformed, of measured markers and virtual markers.

``test_repair_covariance.py`` has the repaired ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.suites.calibration.camera import camera_cases
from benchmarks.suites.calibration.cases import KnownPicture
from benchmarks.suites.scenes import SCENE_KINDS, SceneCase, cached_extractor, inner_markers
from benchmarks.suites.scoring.calibration import squared_distances, summarise
from benchmarks.suites.stress.frames import CaseImage
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import render
from extractor import Extractor, Reference, Status, VirtualStatus, parse_layout

LAYERS = 8
SIZE = (400, 360)
SEEDS = 3
PRESETS = ("balanced", "accurate")
PATTERNS = ("honeycomb", "round", "elliptical")
Squares = NDArray[np.float64]


class FoundSquares(NamedTuple):
    """d2 of all patterns, by picture: of measured markers inside, of those of the outermost layer, of virtual ones."""

    inner: list[Squares]
    rim: list[Squares]
    virtual: list[Squares]
    interpolated: list[Squares]


@cache
def squares_of(preset: str, kind: str) -> FoundSquares:
    found = FoundSquares([], [], [], [])
    for pattern in PATTERNS:
        case = SceneCase(pattern, kind, layers=LAYERS)
        scene, extractor = case.scene(), cached_extractor(case, preset)  # type: ignore[arg-type]
        inner = inner_markers(scene.layout)
        outermost = scene.layout.marker_layer == LAYERS
        for seed in range(SEEDS):
            seen = render(replace(scene, seed=seed), size=SIZE)
            markers = extractor.extract(seen.image)
            mine = inner & (markers.status == Status.MEASURED)
            assert mine.sum() > 0.99 * inner.sum()
            error = markers.xy_px - seen.truth.marker_xy_px
            found.inner.append(squared_distances(error[mine], markers.cov_px2[mine]))
            rim = outermost & (markers.status == Status.MEASURED)
            found.rim.append(squared_distances(error[rim], markers.cov_px2[rim]))
            error = markers.virtual_xy_px - seen.truth.virtual_xy_px
            for squares, status in (
                (found.virtual, VirtualStatus.MEASURED),
                (found.interpolated, VirtualStatus.INTERPOLATED),
            ):
                virtual = markers.virtual_status == status
                squares.append(squared_distances(error[virtual], markers.virtual_cov_px2[virtual]))
    return found


@pytest.mark.parametrize("kind", SCENE_KINDS)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_covariance_of_a_measured_marker_is_true(preset: str, kind: str) -> None:
    d2 = squares_of(preset, kind).inner
    found = summarise(d2)
    least, most = {"balanced": (0.83, 1.15), "accurate": (0.9, 1.1)}[preset]
    assert least < found.z.value < most
    assert 0.8 < found.median_z < 1.2  # the bulk of them, too
    # six deviations per axis; fast leaves a marker whose triangles were wrong by a quarter of a pixel
    assert np.concatenate(d2).max() < 72


@pytest.mark.parametrize("kind", ["flat", "tilt"])
@pytest.mark.parametrize("preset", PRESETS)
def test_the_outermost_layer_has_larger_covariances(preset: str, kind: str) -> None:
    """Maps are one-sided there. With the couplings of moved ends, z would be up to 1.22."""
    assert 0.85 < summarise(squares_of(preset, kind).rim).z.value < 1.12


@pytest.mark.parametrize("kind", SCENE_KINDS)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_covariance_of_a_measured_virtual_marker_is_true(preset: str, kind: str) -> None:
    found = summarise(squares_of(preset, kind).virtual)
    assert found.count > 1000 and not found.singular
    assert 0.8 < found.z.value < 1.2


@pytest.mark.parametrize("kind", ["flat", "tilt"])
@pytest.mark.parametrize("preset", ["balanced", "accurate"])
def test_the_covariance_of_an_interpolated_virtual_marker_holds_the_errors_of_the_map(
    preset: str, kind: str
) -> None:
    """There is no contrast between black cells. With the errors of the two markers alone, z would be up to 1.2."""
    found = summarise(squares_of(preset, kind).interpolated)
    assert found.count > 1000
    assert 0.9 < found.z.value < 1.15


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
def test_virtual_markers_between_rounded_cells_lie_on_the_gridlines(preset: str) -> None:
    """The sides of all cells are shifted alike, most at their ends. With these shifts, errors would be two to three
    times as large.
    """
    d2, squares = [], []
    for case in camera_cases(False, 11):
        if case.kind == "rounded corners" and len(d2) < 4:
            seen = case.shoot()
            extractor = Extractor(parse_layout(layout_to_json(case.layout)), preset, side="either")  # type: ignore[arg-type]
            markers = extractor.extract(seen.image)
            mine = markers.virtual_status == VirtualStatus.MEASURED
            error = (markers.virtual_xy_px - seen.truths[0].virtual_xy_px)[mine]
            d2.append(squared_distances(error, markers.virtual_cov_px2[mine]))
            squares.append((error**2).mean(axis=1))
    assert np.sqrt(np.concatenate(squares).mean()) < 0.2
    assert 0.5 < summarise(d2).z.value < 1.1


def test_the_covariance_of_the_outermost_layer_holds_halos() -> None:
    """Tone mapping changes the light beside the pattern. With the ratio of all gridlines, every fifth was beyond."""
    d2 = []
    for case in camera_cases(False, 11):
        if case.kind == "tone mapping" and len(d2) < 4:
            seen = case.shoot()
            markers = Extractor(parse_layout(layout_to_json(case.layout)), side="either").extract(seen.image)
            outermost = case.layout.marker_layer == case.layout.marker_layer.max()
            mine = (markers.status == Status.MEASURED) & outermost
            error = markers.xy_px - seen.truths[0].marker_xy_px
            d2.append(squared_distances(error[mine], markers.cov_px2[mine]))
    found = summarise(d2)
    assert found.pictures == 4 and found.count > 200
    assert 0.8 < found.z.value < 1.7 and found.beyond.value < 0.15


@cache
def pictures_of_cameras() -> list[tuple[Reference, KnownPicture | CaseImage]]:
    """Colors beside each other, aberration, motion, demosaicing, compression: the gridlines at a marker disagree."""
    effects = ("shifted colors", "aberration", "motion", "mosaic", "jpeg")
    cases = islice((case for case in camera_cases(False, 11) if case.kind in effects), 20)
    return [(parse_layout(layout_to_json(case.layout)), case.shoot()) for case in cases]


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
def test_the_covariance_holds_what_a_camera_does_to_gridlines(preset: str) -> None:
    d2 = []
    for layout, seen in pictures_of_cameras():
        markers = Extractor(layout, preset, side="either").extract(seen.image)  # type: ignore[arg-type]
        mine = markers.status == Status.MEASURED
        error = markers.xy_px - seen.truths[0].marker_xy_px
        d2.append(squared_distances(error[mine], markers.cov_px2[mine]))
    found = summarise(d2)
    assert found.pictures >= 18 and found.count > 5000
    assert 0.8 < found.z.value < 1.3 and found.beyond.value < 0.04
