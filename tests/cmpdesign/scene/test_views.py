"""Views in space: projections against OpenCV's, surfaces that leave the plane, several views in one image."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import COLORS
from cmpdesign.scene import (
    Blob,
    Camera,
    Damage,
    Dent,
    Optics,
    Pinhole,
    Press,
    Scene,
    SceneError,
    Sensor,
    composed,
    cramer_rao,
    render,
    standard_layout,
)
from cmpdesign.scene.camera.lens import LensKind
from cmpdesign.scene.camera.pinhole import distort_points, project_3d
from cmpdesign.scene.camera.plain import camera_homography, to_pinhole
from cmpdesign.scene.drawing.view import single_view
from cmpdesign.scene.standard import INKS

SIZE = (320, 240)
BARREL = (-0.21, 0.06, 0.002, -0.003, -0.01)
Points = NDArray[np.float64]


@pytest.fixture(scope="module")
def layout() -> Layout:
    return standard_layout(layers=3)


def steep(**changes: object) -> Pinhole:
    values: dict[str, object] = {
        "distance_mm": 14.0,
        "field_of_view_deg": 40.0,
        "tilt_deg": 25.0,
        "azimuth_deg": 70.0,
        "roll_deg": 12.0,
    }
    return Pinhole.looking(SIZE, **{**values, **changes})  # type: ignore[arg-type]


def halves(**changes: object) -> tuple[Pinhole, Pinhole]:
    """The left and the right half of the image, from both sides."""
    left = steep(area_px=(0, 0, 160, 240), name="left", azimuth_deg=180, **changes)
    return left, steep(area_px=(160, 0, 160, 240), name="right", azimuth_deg=0, **changes)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(-0.15, 0.15), min_size=5, max_size=5),
    st.lists(st.floats(-3, 3), min_size=9, max_size=9),
)
def test_projection_is_opencvs(distortion: list[float], places: list[float]) -> None:
    camera = steep(distortion=tuple(distortion))
    xyz = np.array(places).reshape(3, 3)
    turn, _ = cv2.Rodrigues(camera.R_camera_from_layout)
    expected, _ = cv2.projectPoints(
        xyz, turn, camera.t_camera_from_layout_mm, camera.intrinsics, np.array(distortion)
    )
    np.testing.assert_allclose(project_3d(camera, xyz), expected[:, 0], atol=1e-7)


@pytest.mark.parametrize(
    ("lens", "distortion"),
    [
        ("perspective", (0.3, 0.1, 0.001, -0.002, 0.01, 0.7, 0.2, 0.02)),
        ("perspective", (0.3, 0.1, 0.001, -0.002, 0.01, 0.7, 0.2, 0.02, 0.002, -0.001, 0.003, 0.001)),
        ("fisheye", (0.02, -0.01, 0.003, -0.001)),
    ],
)
def test_wide_lenses_are_opencvs(lens: LensKind, distortion: tuple[float, ...]) -> None:
    camera = steep(distortion=distortion, lens=lens)
    xyz = np.random.default_rng(5).uniform(-6, 6, (200, 3))
    turn, _ = cv2.Rodrigues(camera.R_camera_from_layout)
    project = cv2.fisheye.projectPoints if lens == "fisheye" else cv2.projectPoints
    shift = camera.t_camera_from_layout_mm[:, None]
    expected = project(xyz[:, None], turn, shift, camera.intrinsics, np.array(distortion))[0]
    np.testing.assert_allclose(project_3d(camera, xyz), expected[:, 0], atol=1e-9)


def test_a_view_without_distortion_is_its_homography(layout: Layout) -> None:
    truth = render(Scene(layout, steep()), size=SIZE).truth
    assert truth.H is not None and truth.H[2, 2] == 1
    at = np.column_stack([layout.marker_xy_mm, np.ones(len(layout.marker_xy_mm))]) @ truth.H.T
    np.testing.assert_allclose(at[:, :2] / at[:, 2:], truth.marker_xy_px, atol=1e-9)
    np.testing.assert_allclose(project_3d(steep(), truth.marker_xyz_mm), truth.marker_xy_px, atol=1e-9)
    assert not truth.marker_xyz_mm[:, 2].any() and truth.virtual_xyz_mm.shape[2] == 3
    assert render(Scene(layout, steep(distortion=BARREL)), size=SIZE).truth.H is None


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_plain_camera_stands_somewhere_in_space(layout: Layout, mirrored: bool) -> None:
    camera = Camera(25, 31, 40, 77, (140, 130), 410, mirrored)
    in_space = to_pinhole(camera, layout, SIZE)
    assert np.linalg.det(in_space.R_camera_from_layout) == pytest.approx(1)
    assert (in_space.position_mm[2] < 0) == mirrored == in_space.mirrored
    assert in_space.homography is not None
    np.testing.assert_allclose(
        in_space.homography, camera_homography(camera, layout, SIZE), rtol=1e-9, atol=1e-9
    )


def test_what_it_looks_at_lies_in_its_middle() -> None:
    for side in (False, True):
        camera = steep(target_mm=(1.0, -2.0, 0.5), back=side, area_px=(40, 20, 101, 61))
        np.testing.assert_allclose(project_3d(camera, np.array([[1.0, -2.0, 0.5]])), [[90, 50]], atol=1e-9)
        assert np.linalg.norm(camera.position_mm - [1.0, -2.0, 0.5]) == pytest.approx(14.0)
        assert (camera.position_mm[2] < 0.5) == side
    straight = Pinhole.looking((100, 80), distance_mm=10, field_of_view_deg=90)
    right, up = project_3d(straight, np.array([[1.0, 0, 0], [0, 1.0, 0]])) - (49.5, 39.5)
    np.testing.assert_allclose([right, up], [[5, 0], [0, -5]], atol=1e-9)
    turned = Pinhole.looking((100, 80), distance_mm=10, field_of_view_deg=90, roll_deg=90)
    np.testing.assert_allclose(project_3d(turned, np.array([[1.0, 0, 0]])), [[49.5, 34.5]], atol=1e-9)


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("mirror", [False, True])
def test_a_mirror_flips_and_the_back_flips(layout: Layout, back: bool, mirror: bool) -> None:
    camera = steep(back=back, mirror=mirror)
    assert np.linalg.det(camera.R_camera_from_layout) == pytest.approx(-1 if mirror else 1)
    truth = render(Scene(layout, camera), size=SIZE).truth
    a, b, c = truth.marker_xy_px[layout.cell_corners[0]]
    turn = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]  # corners are counter-clockwise from the front
    assert truth.mirrored == (back != mirror) == bool(turn > 0)


def test_a_reflected_camera_sees_what_the_mirror_shows() -> None:
    camera, point, normal = steep(), np.array([1.0, 2.0, -3.0]), np.array([0.3, -0.2, 2.0])
    xyz = np.array([[0.5, 0.2, 0.0], [-1.0, 2.0, 0.3]])
    n = normal / np.linalg.norm(normal)
    behind = xyz - 2 * ((xyz - point) @ n)[:, None] * n
    seen = project_3d(camera.reflected(point.tolist(), normal.tolist()), xyz)
    np.testing.assert_allclose(seen, project_3d(camera, behind), atol=1e-9)


def test_a_flat_surface_in_space_is_the_flat_picture(layout: Layout) -> None:
    scene = Scene(layout, Camera(30, 10, 30, 20), optics=Optics(1.0), inks=INKS)
    flat = render(scene, size=SIZE)
    lifted = render(replace(scene, surface=composed(Dent(2.0, 0.0))), size=SIZE)
    assert np.abs(flat.image.astype(int) - lifted.image).max() <= 1
    np.testing.assert_allclose(lifted.truth.marker_xy_px, flat.truth.marker_xy_px, atol=1e-9)
    assert flat.truth.H is not None and lifted.truth.H is None


def test_a_dent_moves_away_from_a_camera_before_it(layout: Layout) -> None:
    """Pressed points recede in a view from the front: the points come closer to the point that the camera looks at."""
    surface = composed(Dent(2.0, 1.0))
    for back, sign in ((False, -1), (True, 1)):
        camera = Pinhole.looking(SIZE, distance_mm=12, field_of_view_deg=40, back=back)
        drawn = render(Scene(layout, camera, surface=surface), size=SIZE).truth
        rest = render(Scene(layout, camera), size=SIZE).truth
        centre = rest.marker_xy_px[0]
        change = np.linalg.norm(drawn.marker_xy_px - centre, axis=1) - np.linalg.norm(
            rest.marker_xy_px - centre, axis=1
        )
        assert (sign * change[layout.marker_layer == 1] > 0.5).all()
        assert drawn.marker_xyz_mm[0, 2] == -1.0
        np.testing.assert_allclose(project_3d(camera, drawn.marker_xyz_mm), drawn.marker_xy_px, atol=1e-9)


def test_heights_add_up_and_planar_parts_come_first(layout: Layout) -> None:
    xy = layout.marker_xy_mm
    press = Press(2.0, 0.2)
    at = composed(press, Dent(2.0, 0.3), Dent(1.0, 0.1))(xy)
    moved = press(xy)
    np.testing.assert_allclose(at[:, :2], moved)
    np.testing.assert_allclose(at[:, 2], (Dent(2.0, 0.3)(moved) + Dent(1.0, 0.1)(moved))[:, 2])


def test_each_view_is_drawn_as_if_alone(layout: Layout) -> None:
    damage = Damage(blobs=(Blob((0.5, 0.4), 0.3),), missing_share=0.1)
    scene = Scene(layout, halves(), composed(Dent(1.5, 0.5)), optics=Optics(1.0), damage=damage, seed=3)
    both = render(scene, size=SIZE)
    truth = both.truth
    assert truth.marker_xy_px.shape == (2, 37, 2) and truth.visible.shape == (2, 37)
    assert truth.virtual_xy_px.shape[:2] == (2, len(layout.edges))
    np.testing.assert_array_equal(truth.mirrored, [False, False])
    for number, view in enumerate(scene.camera):  # type: ignore[arg-type]
        alone = render(replace(scene, camera=view), size=SIZE)
        x, y, width, height = view.area_px
        window = slice(y, y + height), slice(x, x + width)
        np.testing.assert_array_equal(alone.image[window], both.image[window])
        outside = np.ones(SIZE[::-1], bool)
        outside[window] = False
        assert not alone.image[outside].any()
        for name in ("marker_xy_px", "visible", "virtual_xy_px", "cell_visible"):
            np.testing.assert_array_equal(getattr(truth, name)[number], getattr(alone.truth, name))
        shown = alone.truth.marker_xy_px[alone.truth.visible]
        assert (shown[:, 0] >= x - 0.5).all() and (shown[:, 0] < x + width - 0.5).all()
        np.testing.assert_array_equal(truth.marker_xyz_mm, alone.truth.marker_xyz_mm)


def test_colors_lie_in_every_view_where_the_truth_says(layout: Layout) -> None:
    drawn = render(Scene(layout, halves(), inks=INKS), size=SIZE)
    checked = 0
    for xy_px, seen in zip(drawn.truth.marker_xy_px, drawn.truth.cell_visible, strict=True):
        for cell in np.flatnonzero(seen):
            x, y = xy_px[layout.cell_corners[cell]].mean(axis=0).round().astype(int)
            expected = INKS[COLORS[layout.cell_color[cell]]][::-1]
            np.testing.assert_allclose(drawn.image[y, x], expected, atol=1)
            checked += 1
    assert checked > 60


def test_flat_views_have_a_homography_each(layout: Layout) -> None:
    truth = render(Scene(layout, halves()), size=SIZE).truth
    assert truth.H is not None and truth.H.shape == (2, 3, 3)
    one = render(Scene(layout, halves()[:1]), size=SIZE).truth
    assert one.marker_xy_px.shape == (1, 37, 2)


def test_a_bound_is_one_views(layout: Layout) -> None:
    scene = Scene(layout, halves(), sensor=Sensor(noise=2.0), optics=Optics(1.0))
    with pytest.raises(SceneError, match="2 views"):
        cramer_rao(scene, size=SIZE)
    left = replace(scene, camera=halves()[0])
    finite = np.isfinite(cramer_rao(left, size=SIZE)).all(axis=(1, 2))
    np.testing.assert_array_equal(finite, render(left, size=SIZE).truth.visible)


def test_the_lens_turns_back_where_it_says() -> None:
    camera = steep(distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
    assert camera.reach == pytest.approx(np.sqrt(1 / 0.9))
    r = np.linspace(0, camera.reach * 0.999, 200)
    assert (np.diff(distort_points(camera, np.column_stack([r, 0 * r]))[:, 0]) > 0).all()
    assert steep(distortion=(0.1, 0.1, 0, 0, 0.1)).reach == np.inf


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda s: replace(s, camera=steep(distance_mm=2.0, tilt_deg=60)), "behind the camera"),
        (lambda s: replace(s, camera=steep(distance_mm=2.0, tilt_deg=60, name="left")), "view left: a part"),
        (lambda s: replace(s, camera=steep(distortion=(-8.0, 0, 0, 0, 0))), "back on itself at 0.204"),
        (lambda s: replace(s, surface=composed(Dent(2.0, 9.0)), camera=steep(tilt_deg=60)), "turn away"),
        (lambda s: replace(s, camera=()), "no view"),
        (lambda s: replace(s, camera=(steep(), steep())), "views 0 and 1 share pixels"),
        (lambda s: replace(s, camera=steep(area_px=(300, 0, 30, 30))), "leaves the image of 320 x 240"),
        (lambda s: steep(area_px=(-1, 0, 30, 30)), "area_px is"),
        (lambda s: Pinhole((1, 0), (0, 0)), "focal_px is"),
        (lambda s: Pinhole((1, 1), (np.nan, 0)), "finite"),
        (lambda s: Pinhole((1, 1), (0, 0), R_camera_from_layout=np.diag([1.0, 1, 1.1])), "no rotation"),
        (lambda s: Pinhole((1, 1), (0, 0), t_camera_from_layout_mm=np.zeros(2)), "shape"),
        (lambda s: steep(distance_mm=0), "distance_mm is 0"),
        (lambda s: steep(tilt_deg=86), "tilt_deg is 86"),
        (lambda s: steep(field_of_view_deg=180), "field_of_view_deg is 180"),
    ],
)
def test_bad_views_are_named(layout: Layout, make: object, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        render(make(Scene(layout)), size=SIZE)  # type: ignore[operator]


def test_only_one_view_is_looked_at(layout: Layout) -> None:
    with pytest.raises(SceneError, match="2 views, one is needed"):
        single_view(Scene(layout, halves()), SIZE)
