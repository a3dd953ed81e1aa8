"""Covariances of repaired and fitted markers, and of measured markers beside damage, cover the true errors (Monte
Carlo over damaged scenes)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.suites.calibration.damaged import DAMAGE_KINDS
from benchmarks.suites.calibration.reading import PictureReading, SuiteJob, read_pictures
from benchmarks.suites.scoring.calibration import summarise
from benchmarks.suites.scoring.squares import MEASURED

LARGEST_D2 = 72.0  # six deviations per axis


@cache
def damage_readings(preset: str) -> list[PictureReading]:
    return read_pictures(SuiteJob("damage", (preset,)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "preset",
    [
        "balanced",
        pytest.param("accurate", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize(("status", "least"), [("repaired", 200), ("fitted", 80)])
def test_the_covariance_of_a_repaired_marker_is_true(preset: str, status: str, least: int) -> None:
    d2 = [reading.squares[status] for reading in damage_readings(preset)]
    found = summarise(d2)
    assert found.count >= least and not found.singular
    assert 0.7 < found.z.value < {"repaired": 1.3, "fitted": 1.5}[status]
    assert np.concatenate(d2).max() < LARGEST_D2


@pytest.mark.parametrize("preset", ["balanced", pytest.param("accurate", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", DAMAGE_KINDS)
def test_the_covariance_of_a_measured_marker_beside_damage_is_true(preset: str, kind: str) -> None:
    d2 = [reading.squares[MEASURED] for reading in damage_readings(preset) if reading.kind == kind]
    found = summarise(d2)
    assert found.count > 6000 and not found.singular
    assert 0.8 < found.z.value < 1.3
    assert found.beyond.value < 0.06
