"""Where something is damaged, covariances cover the true errors: of repaired and fitted markers, and of measured ones
beside the damage (Monte Carlo over damaged scenes)."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.calibration import DAMAGE_KINDS, normalised_squares


@pytest.mark.parametrize(
    "preset",
    [
        "balanced",
        pytest.param("fast", marks=pytest.mark.slow),
        pytest.param("accurate", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize(("status", "least"), [("repaired", 200), ("fitted", 80)])
def test_the_covariance_of_a_repaired_marker_is_true(preset: str, status: str, least: int) -> None:
    found = normalised_squares(preset)[status]
    assert len(found) >= least
    assert 0.8 < np.sqrt(found.mean()) < 1.3
    assert np.sqrt(found.max()) < 6.0


@pytest.mark.parametrize("preset", ["balanced", pytest.param("accurate", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", DAMAGE_KINDS)
def test_the_covariance_of_a_measured_marker_beside_damage_is_true(preset: str, kind: str) -> None:
    found = normalised_squares(preset)[kind]
    assert len(found) > 6000
    assert 0.8 < np.sqrt(found.mean()) < 1.3
    assert np.mean(found > 3.0**2) < 0.03
