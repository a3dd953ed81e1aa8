"""The renderer's own error, against a picture by scan lines that shares no step with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.suites.scanlines import ImageWindow, fit_edge_offsets, measure_render_error, reference_image
from cmpdesign.scene import (
    Camera,
    Dent,
    Optics,
    Pinhole,
    Scene,
    Sensor,
    Twist,
    composed,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.drawing.view import scene_views

SIZE = (200, 160)
WINDOW = ImageWindow(70, 50, 60, 60)
LENS = (-0.2, 0.05, 0.001, -0.002, 0.0)


def scene(kind: str) -> Scene:
    standard = standard_scene(standard_layout(layers=4))
    # Turned by 30 degrees: no gridline runs along the scan lines.
    looking = {"distance_mm": 14.0, "field_of_view_deg": 40.0, "tilt_deg": 12.0, "roll_deg": 30.0}
    if kind == "flat":
        return replace(standard, camera=Camera(20, 7.3))
    if kind == "distorted":
        return replace(standard, camera=Pinhole.looking(SIZE, distortion=LENS, **looking))  # type: ignore[arg-type]
    camera = Pinhole.looking(SIZE, back=True, **looking)  # type: ignore[arg-type]
    return replace(standard, camera=camera, surface=composed(Twist(2.0, 9.0), Dent(1.5, 0.5)))


@pytest.mark.parametrize("kind", ["flat", "distorted", "pressed"])
@pytest.mark.parametrize(("blur_px", "grey_rms", "grey_largest"), [(1.0, 0.01, 0.06), (0.0, 0.02, 0.5)])
def test_its_error_is_a_few_ten_thousandths_of_a_pixel(
    kind: str, blur_px: float, grey_rms: float, grey_largest: float
) -> None:
    found = measure_render_error(kind, scene(kind), blur_px, WINDOW, SIZE)
    assert found.edges > 12
    assert found.edge_rms_px < 2e-4 and found.edge_largest_px < 5e-4
    assert found.grey_rms < grey_rms and found.grey_largest < grey_largest


def test_the_comparison_sees_a_hundredth_of_a_pixel() -> None:
    flat = scene("flat")
    moved = replace(flat, camera=Camera(20, 7.3, centre_px=(99.5 + 0.01, 79.5)))
    clean = replace(flat, sensor=Sensor(bits=16, response="linear"), optics=Optics(1.0))
    view = scene_views(clean, SIZE)[0]
    here = reference_image(clean, view, WINDOW)
    drawn = render(replace(moved, sensor=clean.sensor, optics=Optics(1.0)), size=SIZE).image
    there = drawn[50:110, 70:130]
    assert np.abs(there / 257 - here).max() > 0.3
    shifts = fit_edge_offsets(there / 257 - here, here, clean.layout, view, WINDOW)
    assert 0.004 < np.sqrt((shifts**2).mean()) < 0.01
