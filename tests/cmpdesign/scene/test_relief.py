"""Cells above or below the black in scenes: where rays meet the plane, what is seen, and the truth that stays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cmpdesign.files.layout_json import write_layout
from cmpdesign.layout.layout import AsMade, Layout
from cmpdesign.layout.side import seen_side
from cmpdesign.scene import Camera, Scene, render, standard_layout, standard_scene
from cmpdesign.scene.camera.plain import to_pinhole
from cmpdesign.scene.drawing.relief import parallax_mm, seen_polygons
from cmpdesign.scene.drawing.view import single_view
from tests.support.command import run

SIZE = (640, 480)
TILTED = Camera(30.0, rotation_deg=20.0, tilt_deg=25.0, tilt_axis_deg=70.0, focal_px=600.0)


def with_relief(layout: Layout, height_mm: float) -> Layout:
    side = seen_side(layout.mirrored)
    return replace(layout, as_made=AsMade(layout.digest, "measured", side, cell_height_mm=height_mm))


def relief_scene(height_mm: float, camera: Camera = TILTED) -> Scene:
    return replace(standard_scene(with_relief(standard_layout("honeycomb", 5), height_mm)), camera=camera)


def areas(polygons: np.ndarray) -> np.ndarray:
    x, y = polygons[..., 0], polygons[..., 1]
    return 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("height_mm", [-0.3, 0.2])
def test_parallax_is_where_the_ray_meets_the_plane(height_mm: float, mirrored: bool) -> None:
    """From the camera's place C the point (x, y, h) is seen at C + (P - C) c / (c - h), with its distance c."""
    camera = replace(TILTED, mirrored=mirrored)
    scene = relief_scene(height_mm, camera)
    eye = to_pinhole(camera, scene.layout, SIZE).position_mm
    xy, distance = scene.layout.marker_xy_mm, abs(eye[2])
    met = eye[:2] + (xy - eye[:2]) * distance / (distance - height_mm)
    found = parallax_mm(single_view(scene, SIZE), xy, height_mm)
    np.testing.assert_allclose(found, met - xy, atol=0.03 * np.abs(met - xy).max())


def test_raised_cells_seem_larger_and_recessed_ones_smaller() -> None:
    scene = relief_scene(0.1)
    cells = scene.layout.colored_outlines_mm
    view = single_view(scene, SIZE)
    raised, recessed = (seen_polygons(view, cells, height_mm) for height_mm in (0.1, -0.1))
    assert (areas(raised) > areas(cells)).all()
    assert (areas(recessed) < areas(cells)).all() and (areas(recessed) > 0).all()
    # pits deeper than wide show no floor
    hidden = seen_polygons(single_view(relief_scene(-8.0), SIZE), cells, -8.0)
    assert np.abs(areas(hidden)).max() < 1e-12


def test_a_camera_above_sees_no_walls() -> None:
    """Far away and above, relief is not seen; the picture is that of the flat pad."""
    far = Camera(30.0, focal_px=1e6)
    flat, relief = (render(relief_scene(height_mm, far)).image.astype(int) for height_mm in (0.0, -0.3))
    assert np.abs(flat - relief).max() <= 1


def test_the_truth_is_in_the_plane_of_the_black() -> None:
    flat, relief = (render(relief_scene(height_mm)) for height_mm in (0.0, 0.3))
    np.testing.assert_allclose(relief.truth.marker_xy_px, flat.truth.marker_xy_px, atol=1e-9)
    assert np.abs(relief.image.astype(int) - flat.image).max() > 50


def test_render_draws_the_relief_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    layout = standard_layout("honeycomb", 3)
    for name, height_mm in (("flat", 0.0), ("pits", -0.3)):
        write_layout(with_relief(layout, height_mm), f"{name}.json")
        assert (
            run("render", f"{name}.json", "-o", f"{name}.png", "--pitch", "40", "--tilt", "30").exit_code == 0
        )
    colored = [int((cv2.imread(f"{name}.png").max(axis=2) > 100).sum()) for name in ("flat", "pits")]
    assert colored[1] < 0.97 * colored[0]
