"""Cells with an obtuse corner, as round and elliptical patterns have at their rims: their triangles are found whole."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.scene import Camera, Sensor
from extractor import Status
from tests.support.errors import errors_px, rms
from tests.support.standard_views import extractor, shown

LAYERS, PITCH_PX = 9, 20.0


@pytest.mark.parametrize("pattern", ["round", "elliptical"])
def test_rim_markers_of_obtuse_cells_are_measured(pattern: str) -> None:
    """In sRGB pictures, domains are larger than cells: the first positions are near, and no marker is lost."""
    error_px = []
    for turn_deg in range(0, 360, 30):
        camera = Camera(PITCH_PX, turn_deg)
        seen = shown(pattern, layers=LAYERS, size=(640, 480), camera=camera, sensor=Sensor(noise=2.0))
        for preset in ("balanced", "accurate"):
            markers = extractor(pattern, preset, LAYERS).extract(seen.image)
            assert (markers.status == Status.MEASURED).all(), (turn_deg, preset)
            if preset == "balanced":
                error_px.append(errors_px(markers, seen))
    assert rms(np.concatenate(error_px)) < 0.04
