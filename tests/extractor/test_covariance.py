"""Covariances are true: Monte Carlo over patterns, flat and deformed, of measured markers and virtual markers.

``test_repair_covariance.py`` has the repaired ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.support.scenes import SCENE_KINDS, SceneCase, cached_extractor, inner_markers
from cmpdesign.scene import render
from extractor import Status, VirtualStatus

LAYERS = 8
SIZE = (400, 360)
SEEDS = 3
PRESETS = ("fast", "balanced", "accurate")
PATTERNS = ("honeycomb", "round", "elliptical")
Squares = NDArray[np.float64]


def squares(error: Squares, covariance: Squares) -> Squares:
    """(N,) squared errors (N, 2) over their covariances (N, 2, 2), per axis."""
    return np.asarray(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) / 2)


@cache
def normalised(preset: str, kind: str) -> tuple[Squares, Squares]:
    """Of the measured inner markers and the measured virtual markers of all patterns."""
    markers_found, virtual_found = [], []
    for pattern in PATTERNS:
        case = SceneCase(pattern, kind, layers=LAYERS)
        scene, extractor = case.scene(), cached_extractor(case, preset)  # type: ignore[arg-type]
        inner = inner_markers(scene.layout)
        for seed in range(SEEDS):
            seen = render(replace(scene, seed=seed), size=SIZE)
            markers = extractor.extract(seen.image)
            mine = inner & (markers.status == Status.MEASURED)
            assert mine.sum() > 0.99 * inner.sum()
            error = markers.xy_px - seen.truth.marker_xy_px
            markers_found.append(squares(error[mine], markers.cov_px2[mine]))
            virtual = markers.virtual_status == VirtualStatus.MEASURED
            error = markers.virtual_xy_px - seen.truth.virtual_xy_px
            virtual_found.append(squares(error[virtual], markers.virtual_cov_px2[virtual]))
    return np.concatenate(markers_found), np.concatenate(virtual_found)


@pytest.mark.parametrize("kind", SCENE_KINDS)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_covariance_of_a_measured_marker_is_true(preset: str, kind: str) -> None:
    found, _ = normalised(preset, kind)
    assert 0.9 < np.sqrt(found.mean()) < {"fast": 1.25, "balanced": 1.15, "accurate": 1.1}[preset]
    # the bulk of them too: half of all squares of normal errors in two axes lie below ln 2 of their mean
    assert 0.85 < np.sqrt(np.median(found)) / np.sqrt(np.log(2)) < 1.2
    assert np.sqrt(found.max()) < 6


@pytest.mark.parametrize("kind", SCENE_KINDS)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_covariance_of_a_measured_virtual_marker_is_true(preset: str, kind: str) -> None:
    _, found = normalised(preset, kind)
    assert len(found) > 1000
    assert 0.85 < np.sqrt(found.mean()) < 1.2
