"""Uncertain markers beside dirt: the estimate of the neighbours is weighted against the measurement."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.scene import Blob, Damage, Press, composed
from cmpdesign.scene.standard import BLACK_RGB, standard_layout
from extractor import Status
from tests.support.errors import deviations, errors_px, rms
from tests.support.standard_views import extractor, shown

LAYERS, SIZE = 8, (420, 400)
PLACES = ((-2.0, 1.5), (0.3, -2.4), (2.6, 0.8), (-0.9, 3.1), (-3.2, -1.4))
DROPS = Damage(blobs=tuple(Blob(at, 0.45, BLACK_RGB) for at in PLACES))


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize(
    ("pattern", "limit_px"), [("honeycomb", 0.09), ("round", 0.26), ("elliptical", 0.09)]
)
def test_under_dirt_others_help(pattern: str, limit_px: float, preset: str) -> None:
    """Drops on a pressed pattern: without the neighbours, the errors of markers under drops are more than twice as
    large. The errors agree with the covariances."""
    away = np.linalg.norm(standard_layout(pattern, LAYERS).marker_xy_mm[:, None] - np.array(PLACES), axis=2)
    near, error, normalised = away.min(axis=1) < 1.2, [], []
    for seed in range(3):
        seen = shown(
            pattern, layers=LAYERS, size=SIZE, damage=DROPS, surface=composed(Press(4.0, 0.5)), seed=seed
        )
        markers = extractor(pattern, preset, LAYERS).extract(seen.image)
        assert (markers.status[near] != Status.LOST).all()
        error += list(errors_px(markers, seen)[near])
        normalised += list(deviations(markers, seen)[near])
    assert rms(np.array(error)) < limit_px
    assert rms(np.array(normalised)) < 1.0 and max(normalised) < 2.7
