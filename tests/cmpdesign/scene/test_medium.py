"""Scenes through a window and a gel: rays by Snell's law, the limits of air, the extractor's result, bad values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.scene import (
    Camera,
    Dent,
    Medium,
    Optics,
    Pinhole,
    Plain,
    Scene,
    SceneError,
    WindowPlane,
    load_scene,
    render,
)
from cmpdesign.scene.camera.pinhole import project_3d
from cmpdesign.scene.drawing.render import render_truth
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Extractor, View, parse_layout
from extractor import Medium as ReadMedium
from tests.support.layouts import small_layout, small_text
from tests.support.light_rays import Slab, from_camera, slab_at_rest, to_camera
from tests.support.view_scenes import binocular, binocular_scene, contact

GEL, WINDOW = (4.0, 1.41), (2.0, 1.49)
MEDIUM = Medium(*GEL, *WINDOW)
SIZE = (640, 480)
TILTED = WindowPlane((0.05, -0.3, 0.95), 26.0)


def camera(**options: Any) -> Pinhole:
    return Pinhole.looking(
        SIZE, distance_mm=40.0, field_of_view_deg=40.0, tilt_deg=22.0, azimuth_deg=60.0, back=True, **options
    )


def window_of(view: Pinhole) -> Slab:
    if view.window is None:
        return slab_at_rest(view.R_camera_from_layout, view.t_camera_from_layout_mm, GEL, WINDOW)
    normal = np.array(view.window.normal) / np.linalg.norm(view.window.normal)
    return Slab(normal, view.window.distance_mm, *WINDOW, GEL[1])


CAMERAS = [camera(), camera(mirror=True), replace(camera(roll_deg=30.0), window=TILTED)]


@pytest.mark.parametrize("view", CAMERAS)
@pytest.mark.parametrize("height_mm", [-1.5, 0.0, 0.5])
def test_points_are_drawn_where_the_light_of_their_pixels_comes_from(view: Pinhole, height_mm: float) -> None:
    y, x = np.mgrid[0:480:24, 0:640:24].reshape(2, -1)
    xy_px = np.column_stack([x, y]).astype(float)
    seen = np.column_stack([(xy_px - view.centre_px) / view.focal_px, np.ones(len(xy_px))])
    start, direction = from_camera(window_of(view), seen)
    start = (start - view.t_camera_from_layout_mm) @ view.R_camera_from_layout
    direction = direction @ view.R_camera_from_layout
    points = start + direction * ((height_mm - start[:, 2]) / direction[:, 2])[:, None]
    np.testing.assert_allclose(project_3d(view, points, MEDIUM), xy_px, atol=1e-9)


@pytest.mark.parametrize("view", CAMERAS)
def test_light_from_a_drawn_point_reaches_the_camera(view: Pinhole) -> None:
    """Reciprocity: the pixel's ray, followed into the gel and back from the point, ends where it began."""
    points = contact(small_layout("honeycomb", 6).marker_xy_mm)
    xy_px = project_3d(view, points, MEDIUM)
    seen = np.column_stack([(xy_px - view.centre_px) / view.focal_px, np.ones(len(xy_px))])
    slab = window_of(view)
    _, inward = from_camera(slab, seen)
    in_camera = points @ view.R_camera_from_layout.T + view.t_camera_from_layout_mm
    start, outward = to_camera(slab, in_camera, -inward)
    assert np.linalg.norm(np.cross(start, outward), axis=1).max() < 1e-10


def test_no_thickness_is_air_to_the_last_byte() -> None:
    scene = binocular_scene(contact, 3)
    thin = replace(scene, medium=Medium(0.0, 1.41, 0.0, 1.49))
    size = (960, 360)
    assert thin.medium is None
    assert render(thin, size=size).image.tobytes() == render(scene, size=size).image.tobytes()


def test_indices_of_one_are_air() -> None:
    scene = binocular_scene(contact, 3)
    clear = render_truth(replace(scene, medium=Medium(4.0, 1.0, 2.0, 1.0)), size=(960, 360))
    np.testing.assert_allclose(
        clear.marker_xy_px, render_truth(scene, size=(960, 360)).marker_xy_px, atol=1e-9
    )


def view_of(pinhole: Pinhole) -> View:
    return View(
        pinhole.name or "one",
        pinhole.focal_px,
        pinhole.centre_px,
        pinhole.distortion,
        R_camera_from_layout=pinhole.R_camera_from_layout,
        t_camera_from_layout_mm=pinhole.t_camera_from_layout_mm,
        medium=ReadMedium(*GEL, *WINDOW),
    )


@pytest.mark.parametrize("mirror", [False, True])
def test_the_extractor_projects_what_the_scene_draws(mirror: bool) -> None:
    """Two implementations that share no code, through lenses that distort."""
    scene = replace(binocular_scene(contact, mirror=mirror), medium=MEDIUM)
    truth = render_truth(scene, size=(960, 360))
    for pinhole, drawn in zip(binocular(mirror=mirror), truth.marker_xy_px, strict=True):
        np.testing.assert_allclose(view_of(pinhole).project(truth.marker_xyz_mm), drawn, atol=1e-9)


def found_px(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The positions of the scene's markers by the extractor, and their true positions."""
    drawn = render(scene, size=SIZE)
    markers = Extractor(parse_layout(small_text("honeycomb", 6)), side="either").extract(drawn.image)
    return markers.xy_px[drawn.truth.visible], drawn.truth.marker_xy_px[drawn.truth.visible]


def test_pictures_are_where_their_truth_is() -> None:
    """The whole drawing, gridlines included, is seen through the medium: read positions agree with the truth."""
    scene = Scene(
        small_layout("honeycomb", 6),
        CAMERAS[0],
        contact,
        background=Plain(BLACK_RGB),
        optics=Optics(1.0),
        inks=INKS,
        medium=MEDIUM,
    )
    read, true = found_px(scene)
    assert np.nanmax(np.abs(read - true)) < 0.05 and np.isfinite(read).mean() > 0.95
    in_air = render_truth(replace(scene, medium=None), size=SIZE).marker_xy_px
    assert np.abs(true - in_air[: len(true)]).max() > 5


def test_a_plain_camera_sees_through_the_medium_too() -> None:
    layout = small_layout("honeycomb", 6)
    scene = Scene(layout, Camera(pitch_px=20.0, focal_px=500.0), medium=MEDIUM)
    larger = render_truth(scene, size=SIZE).marker_xy_px - (319.5, 239.5)
    plain = render_truth(replace(scene, medium=None), size=SIZE).marker_xy_px - (319.5, 239.5)
    distance_mm = 500.0 * layout.parameters["pitch_mm"] / 20.0
    near_normal = distance_mm / (distance_mm - GEL[0] * (1 - 1 / GEL[1]) - WINDOW[0] * (1 - 1 / WINDOW[1]))
    inner = layout.marker_layer == 1
    ratio = np.linalg.norm(larger[inner], axis=1) / np.linalg.norm(plain[inner], axis=1)
    np.testing.assert_allclose(ratio, near_normal, rtol=2e-4)


def test_a_surface_that_is_pressed_into_the_window_is_refused() -> None:
    scene = Scene(small_layout(), camera(), Dent(radius_mm=4, depth_mm=4.5), medium=MEDIUM)
    with pytest.raises(
        SceneError, match=r"a part of the pattern lies in the window, 0.5 mm beyond .* press less"
    ):
        render_truth(scene, size=SIZE)


def test_a_camera_within_the_gel_is_refused() -> None:
    scene = Scene(small_layout(), camera(name="left"), medium=replace(MEDIUM, gel_mm=60.0))
    with pytest.raises(
        SceneError, match=r"view left: the camera stands .* within .* = 62 mm; move the camera away"
    ):
        render_truth(scene, size=SIZE)


SCENE = """
[[view]]
distance_mm = 40
field_of_view_deg = 40
back = true
window_normal = [0.0, 0.1, 1.0]
window_distance_mm = 30.0

[medium]
gel_mm = 4
gel_index = 1.41
window_mm = 2.0
window_index = 1.49
"""


def read_scene(folder: Path, text: str) -> Scene:
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return load_scene(folder / "scene.toml", small_layout()).scene()


def test_a_medium_is_read_from_a_scene_file(tmp_path: Path) -> None:
    scene = read_scene(tmp_path, SCENE)
    assert scene.medium == Medium(4, 1.41, 2.0, 1.49)
    assert isinstance(scene.camera, Pinhole) and scene.camera.window == WindowPlane((0.0, 0.1, 1.0), 30.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("gel_index = 1.41", "", "[medium] gel_index is missing; give the gel's index"),
        ("gel_index = 1.41", "gel_index = 0.5", "[medium] gel_index is 0.5; it must lie between 1 and 4"),
        ("window_mm = 2.0", "window_mm = -2.0", "[medium] window_mm is -2; it must lie between 0 and 1000 mm"),
        ("gel_mm = 4", 'gel_mm = "4"', '[medium] gel_mm is "4"; it must be a valid number in mm'),
        ("gel_mm = 4", "gel = 4", "[medium] gel is unknown (did you mean gel_mm?)"),
        ("window_distance_mm = 30.0", "", "window_normal and window_distance_mm go together"),
        ("window_distance_mm = 30.0", "window_distance_mm = -1.0", "the distance is above 0 mm"),
        ("[0.0, 0.1, 1.0]", "[0.0, 0.1, -1.0]", "the normal points away from the camera"),
    ],
)  # fmt: skip
def test_a_medium_that_cannot_be_names_table_and_key(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in SCENE
    with pytest.raises(SceneError) as error:
        read_scene(tmp_path, SCENE.replace(old, new))
    assert said in str(error.value) and "\n" not in str(error.value)
