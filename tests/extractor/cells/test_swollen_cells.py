"""Bled or overexposed cells overlap: cells with a common corner keep the corner, and no block is dropped."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.scene import Camera, Damage, Optics, Scene, Sensor, render
from cmpdesign.scene.standard import INKS
from extractor import Extractor, Status, parse_layout
from tests.support.layouts import small_layout, small_text
from tests.support.pictures import srgb_light, srgb_values

LAYERS, PITCH_MM = 6, 1.5


@pytest.mark.parametrize(
    ("exposure", "bleed", "pitch_px", "tilt_deg", "least_share"),
    [(8, 0.07, 20.0, 35.0, 0.7), (16, 0.0, 14.0, 30.0, 0.9)],
)
def test_overlapping_cells_keep_their_numbers(
    exposure: float, bleed: float, pitch_px: float, tilt_deg: float, least_share: float
) -> None:
    """Two cells are missing, so that the numbering is checked across gaps; ``bleed`` is in pitches."""
    scene = Scene(
        small_layout("honeycomb", LAYERS),
        camera=Camera(pitch_px, 17.0, tilt_deg),
        optics=Optics(0.9),
        sensor=Sensor(noise=1.0),
        damage=Damage(missing_cells=(4, 31), bleed_mm=bleed * PITCH_MM),
        inks=INKS,
        seed=3,
    )
    shot = render(scene, size=(int(13 * pitch_px), int(12 * pitch_px)))
    light = np.minimum(exposure * srgb_light(shot.image), 255)
    markers = Extractor(parse_layout(small_text("honeycomb", LAYERS))).extract(
        np.rint(srgb_values(light)).astype(np.uint8)
    )
    assert markers.reason is None and markers.quality is not None and markers.quality.clipping > 0.5
    assert (markers.status == Status.MEASURED).mean() > least_share
    error_px = np.linalg.norm(markers.xy_px - shot.truth.marker_xy_px, axis=1)
    assert np.nanmax(error_px) < 0.5 * pitch_px
