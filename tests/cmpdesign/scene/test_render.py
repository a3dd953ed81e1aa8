"""Scenes: the image agrees with its truth, every part has the stated effect, and the same scene gives the same
bytes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.errors import OutputError
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, GREEN, RED
from cmpdesign.scene import (
    Blob,
    Busy,
    Camera,
    Damage,
    Glare,
    Gradient,
    Light,
    Optics,
    Paper,
    Picture,
    Plain,
    Press,
    Scene,
    SceneError,
    Scratch,
    Sensor,
    Shear,
    Surface,
    Twist,
    colored_leds,
    composed,
    load_truth,
    render,
    save_truth,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.camera.plain import project_by_homography
from cmpdesign.scene.standard import INKS

SIZE = (320, 280)
Points = NDArray[np.float64]


@pytest.fixture(scope="module")
def layout() -> Layout:
    return standard_layout(layers=2)


@pytest.fixture(scope="module")
def small(layout: Layout) -> Scene:
    """Large cells, 16 bits of light, no noise: the measured error is the renderer's error."""
    camera = Camera(pitch_px=60, rotation_deg=3)
    return Scene(layout, camera, optics=Optics(1.0), sensor=Sensor(bits=16, response="linear"), inks=INKS)


def edge_on_rows(image: NDArray[np.uint16], at: Points, reach: int) -> Points:
    """Where a steep edge crosses the rows nearest to the points ``at`` (N, 2) px, by integrated profiles.

    Blur and pixel boxes do not change the integral of an edge's profile, so the function uses no property of the
    renderer.
    """
    found = []
    for x, y in at:
        left, row = round(x) - reach, round(y)
        profile = image[row, left : left + 2 * reach + 1].astype(np.float64)
        low, high = profile[0], profile[-1]
        bright = (profile - low) @ (high - low) / ((high - low) @ (high - low))
        found.append((left + 2 * reach + 0.5 - bright.sum(), row))
    return np.array(found)


def steep_lines(scene: Scene, marker: int, blur_reach: int) -> list[Points]:
    """Lines x = a y + b (a, b) fitted to the image along the four steep gridlines of a marker, NaN-free."""
    drawn = render(scene, size=SIZE)
    xy = drawn.truth.marker_xy_px
    lines = []
    for a, b in scene.layout.edges:
        if marker not in (a, b) or abs(xy[b] - xy[a])[1] < 30:
            continue
        rows = np.arange(np.ceil(0.4 * xy[a, 1] + 0.6 * xy[b, 1]), np.floor(0.6 * xy[a, 1] + 0.4 * xy[b, 1]))
        if len(rows) == 0:
            rows = np.arange(
                np.ceil(0.6 * xy[a, 1] + 0.4 * xy[b, 1]), np.floor(0.4 * xy[a, 1] + 0.6 * xy[b, 1])
            )
        x = xy[a, 0] + (rows - xy[a, 1]) / (xy[b, 1] - xy[a, 1]) * (xy[b, 0] - xy[a, 0])
        measured = edge_on_rows(drawn.image, np.stack([x, rows], axis=-1), blur_reach)
        lines.append(np.polyfit(measured[:, 1], measured[:, 0], 1))
    return lines


@pytest.mark.parametrize("blur_px", [0.0, 0.5, 1.0, 1.5])
@pytest.mark.parametrize("marker", [0, 3, 4, 6])
def test_a_corner_lies_where_the_truth_says(small: Scene, marker: int, blur_px: float) -> None:
    scene = replace(small, optics=Optics(blur_px))
    truth = render(scene, size=SIZE).truth.marker_xy_px[marker]
    lines = steep_lines(scene, marker, blur_reach=9)
    assert len(lines) == 4
    slopes, offsets = np.array(lines).T
    y, x = np.linalg.lstsq(np.stack([-slopes, np.ones(4)], axis=-1), offsets, rcond=None)[0]
    assert np.hypot(x - truth[0], y - truth[1]) < 0.001


def test_virtual_markers_lie_on_the_curved_gridlines(small: Scene) -> None:
    scene = replace(small, surface=composed(Twist(radius_mm=1.5, angle_deg=14), Press(1.2, 0.15)))
    drawn = render(scene, size=SIZE)
    straight = drawn.truth.marker_xy_px[scene.layout.edges].mean(axis=1)
    middle = drawn.truth.virtual_xy_px[:, 2]
    bend = np.linalg.norm(middle - straight, axis=1)
    assert bend.max() > 1.0
    checked = 0
    for (a, b), line in zip(scene.layout.edges, drawn.truth.virtual_xy_px, strict=True):
        run = np.abs(drawn.truth.marker_xy_px[b] - drawn.truth.marker_xy_px[a])
        if (
            run[1] < 1.5 * run[0]
            or not drawn.truth.visible[[a, b]].all()
            or min(scene.layout.marker_layer[[a, b]]) > 1
        ):
            continue
        measured = edge_on_rows(drawn.image, line[2:3], 8)
        # The true gridline at that row, from a parabola through the inner virtual markers.
        x = np.polyval(np.polyfit(line[:, 1] - line[2, 1], line[:, 0], 4), measured[:, 1] - line[2, 1])
        assert abs(measured[0, 0] - x[0]) < 0.004
        checked += 1
    assert checked >= 8


@pytest.mark.parametrize("surface", [None, composed(Press(2.0, 0.4), Twist(1.5, 12.0, (0.3, 0.1)))])
def test_both_engines_draw_the_same_picture(small: Scene, surface: Surface | None) -> None:
    scene = replace(small, surface=surface)
    compiled, plain = (
        render(scene, size=(160, 120), engine=engine).image for engine in ("compiled", "numpy")
    )
    assert np.abs(compiled.astype(int) - plain.astype(int)).max() <= 1


def test_the_same_scene_gives_the_same_bytes(layout: Layout) -> None:
    damage = Damage(missing_share=0.2, bleed_mm=0.05, blobs=(Blob((0.5, 0.5), 0.3),))
    scene = replace(standard_scene(layout, seed=5), damage=damage, background=Busy(30))
    first, second = render(scene, size=(160, 120)), render(scene, size=(160, 120))
    assert first.image.tobytes() == second.image.tobytes()
    assert first.image.dtype == np.uint8 and first.image.shape == (120, 160, 3)
    other = render(replace(scene, seed=6), size=(160, 120))
    assert first.image.tobytes() != other.image.tobytes()


def test_damage_does_not_change_the_noise_elsewhere(layout: Layout) -> None:
    scene = standard_scene(layout)
    plain = render(scene, size=(160, 120)).image
    cell = int(np.flatnonzero(layout.cell_color == RED)[0])
    damaged = render(replace(scene, damage=Damage(missing_cells=(cell,))), size=(160, 120)).image
    changed = (plain != damaged).any(axis=2)
    assert 0 < changed.sum() < 600


def test_colors_are_the_inks_and_rotation_is_counter_clockwise(small: Scene) -> None:
    drawn = render(replace(small, sensor=None), size=SIZE)
    corners = drawn.truth.marker_xy_px[small.layout.cell_corners]
    for color in range(5):
        for x, y in corners[small.layout.cell_color == color].mean(axis=1).round().astype(int):
            bgr = np.asarray(small.ink(color))[::-1]
            np.testing.assert_allclose(drawn.image[y, x], bgr, atol=1)
    quarter = render(replace(small, camera=Camera(pitch_px=60, rotation_deg=90)), size=SIZE).truth
    first = quarter.marker_xy_px[1] - quarter.marker_xy_px[0]  # designed at 120 degrees, now at 210
    np.testing.assert_allclose(
        first, 60 * np.array([np.cos(np.radians(210)), -np.sin(np.radians(210))]), atol=1e-6
    )


def test_a_mirrored_view_is_the_picture_flipped(small: Scene) -> None:
    camera = Camera(pitch_px=60, centre_px=(159.5, 140))
    front = render(replace(small, camera=camera), size=SIZE)
    back = render(replace(small, camera=replace(camera, mirrored=True)), size=SIZE)
    assert (front.truth.mirrored, back.truth.mirrored) == (False, True)
    difference = front.image[:, ::-1].astype(int) - back.image
    assert np.abs(difference).max() <= 2
    np.testing.assert_allclose(back.truth.marker_xy_px[:, 0], 319 - front.truth.marker_xy_px[:, 0], atol=1e-9)


def test_the_homography_maps_layout_to_image(small: Scene) -> None:
    tilted = replace(small, camera=Camera(30, 20, tilt_deg=50, tilt_axis_deg=33, focal_px=500))
    truth = render(tilted, size=SIZE).truth
    assert truth.H is not None and truth.H[2, 2] == 1
    np.testing.assert_allclose(
        project_by_homography(truth.H, small.layout.marker_xy_mm), truth.marker_xy_px, atol=1e-9
    )
    edge_px = np.linalg.norm(np.diff(truth.marker_xy_px[small.layout.edges], axis=1)[:, 0], axis=1)
    assert edge_px.max() / edge_px.min() > 1.4
    assert render(replace(tilted, surface=composed(Press(1, 0.1))), size=SIZE).truth.H is None


def test_only_markers_in_the_image_are_visible(small: Scene) -> None:
    drawn = render(replace(small, camera=Camera(60, centre_px=(0, 0))), size=SIZE).truth
    inside = (drawn.marker_xy_px >= -0.5).all(axis=1)
    touched = np.unique(small.layout.cell_corners[small.layout.cell_color != BLACK])
    np.testing.assert_array_equal(
        np.flatnonzero(drawn.visible), np.intersect1d(np.flatnonzero(inside), touched)
    )
    assert not drawn.cell_visible[~inside[small.layout.cell_corners].all(axis=1)].any()


def test_a_missing_cell_is_black_and_its_lonely_markers_are_invisible(small: Scene) -> None:
    colored = np.flatnonzero(small.layout.cell_color != BLACK)
    drawn = render(
        replace(small, damage=Damage(missing_cells=tuple(map(int, colored))), sensor=None), size=SIZE
    )
    assert drawn.image.max() == INKS["black"][0]
    assert not drawn.truth.visible.any() and not drawn.truth.cell_visible[colored].any()
    share = render(replace(small, damage=Damage(missing_share=0.5)), size=SIZE).truth
    assert colored.size - share.cell_visible[colored].sum() == round(0.5 * (colored.size - 1))
    assert share.cell_visible[small.layout.reference_cell]


def test_dirt_and_glare_hide_what_lies_under_them(small: Scene) -> None:
    centre = small.layout.marker_xy_mm[2]
    blob = Damage(blobs=(Blob((float(centre[0]), float(centre[1])), 0.3, (1, 2, 3)),))
    drawn = render(replace(small, damage=blob, sensor=None), size=SIZE)
    x, y = drawn.truth.marker_xy_px[2].round().astype(int)
    np.testing.assert_allclose(drawn.image[y, x], (3, 2, 1), atol=1)
    assert np.flatnonzero(~drawn.truth.visible & render(small, size=SIZE).truth.visible).tolist() == [2]

    scratch = Damage(scratches=(Scratch((-3, 0), (3, 0), 0.2, (200, 200, 200)),))
    drawn = render(replace(small, damage=scratch, sensor=None), size=SIZE)
    row = np.flatnonzero(small.layout.marker_xy_mm[:, 1] == 0)
    assert not drawn.truth.visible[row].any() and drawn.truth.visible.sum() > 5

    xy = drawn.truth.marker_xy_px[4]
    shiny = Damage(glare=(Glare((float(xy[0]), float(xy[1])), 10.0, 400),))
    drawn = render(replace(small, damage=shiny, sensor=None), size=SIZE)
    x, y = xy.round().astype(int)
    assert drawn.image[y, x].min() == 255 and not drawn.truth.visible[4]


def test_bleeding_inks_spread_into_the_black(small: Scene) -> None:
    plain = render(replace(small, sensor=None), size=SIZE).image
    bled = render(replace(small, damage=Damage(bleed_mm=0.15), sensor=None), size=SIZE).image
    dark = [(image.max(axis=2) < 60).mean() for image in (plain, bled)]
    assert dark[1] < 0.9 * dark[0]
    assert bled.max() <= INKS["white"][0]


def test_a_fold_is_refused(small: Scene) -> None:
    for surface in (Press(1.0, 2.0), Press(1.0, -0.7), Shear(0.5, (2.0, 0.0))):
        with pytest.raises(SceneError, match="folds"):
            render(replace(small, surface=composed(surface)), size=SIZE)
    render(
        replace(small, surface=composed(Press(1.0, 0.9), Shear(1.5, (0.5, 0.2)), Twist(0.5, 300.0))),
        size=SIZE,
    )


def test_presses_move_as_far_as_they_say() -> None:
    ring = 2.0 * np.stack([np.cos(np.arange(8)), np.sin(np.arange(8))], axis=-1)
    np.testing.assert_allclose(np.linalg.norm(Press(2.0, 0.3)(ring), axis=1), 2.3)
    np.testing.assert_allclose(Twist(2.0, 90.0, (1.0, 1.0))(np.array([[1.0, 1.0]])), [[1.0, 1.0]])
    np.testing.assert_allclose(Shear(2.0, (0.3, -0.1))(np.zeros((1, 2))), [[0.3, -0.1]])
    both = composed(Shear(1e9, (1.0, 0.0)), Twist(1e9, 90.0))(np.zeros((1, 2)))
    np.testing.assert_allclose(both, [[0.0, 1.0]], atol=1e-6)


def test_light_multiplies_each_channel(small: Scene) -> None:
    paper = replace(
        small, sensor=Sensor(response="linear"), background=Plain((100, 100, 100)), camera=Camera(5)
    )
    warm = render(replace(paper, light=Light(rgb=(1.2, 1.0, 0.5))), size=SIZE).image
    np.testing.assert_array_equal(warm[5, 5], (50, 100, 120))
    slope = render(replace(paper, light=Light(gradient=(0.5, 0.2))), size=SIZE).image[..., 0]
    assert (slope[0, -1], slope[-1, 0]) == (170, 30)
    dim = render(replace(paper, light=Light(vignetting=0.4)), size=SIZE).image[..., 0]
    assert dim[0, 0] == 60
    lit = render(replace(paper, light=colored_leds(3)), size=SIZE).image.astype(int)
    top, lower_left, lower_right = lit[3, 160], lit[230, 10], lit[230, 310]
    assert (top.argmax(), lower_left.argmax(), lower_right.argmax()) == (2, 1, 0)


@pytest.mark.parametrize(
    "background",
    [Gradient(), Paper(), Busy(40), Busy(40, triangles=True), Picture(np.zeros((9, 8, 3), np.uint8))],
)
def test_backgrounds_stay_behind_the_ground(small: Scene, background: Paper) -> None:
    drawn = render(replace(small, background=background, sensor=None), size=SIZE)
    plain = render(replace(small, sensor=None), size=SIZE)
    x, y = drawn.truth.marker_xy_px[drawn.truth.visible].round().astype(int).T
    np.testing.assert_allclose(drawn.image[y, x].astype(int), plain.image[y, x].astype(int), atol=1)
    assert (drawn.image != plain.image).any()


def test_the_sensor_adds_what_it_says(small: Scene) -> None:
    grey = replace(small, background=Plain((128, 128, 128)), camera=Camera(1), optics=None)
    noisy = render(replace(grey, sensor=Sensor(noise=4)), size=SIZE).image[:100]
    assert noisy.std() == pytest.approx(4, rel=0.02) and noisy.mean() == pytest.approx(128, abs=0.1)
    sixteen = render(replace(grey, sensor=Sensor(bits=16)), size=SIZE).image
    assert sixteen.dtype == np.uint16 and sixteen[0, 0, 0] == 128 * 257
    rough = render(replace(small, sensor=Sensor(jpeg_quality=20)), size=SIZE).image.astype(int)
    error = np.abs(rough - render(replace(small, sensor=None), size=SIZE).image).max()
    assert 10 < error < 200


def test_truth_survives_its_file(small: Scene, tmp_path: Path) -> None:
    for surface in (None, composed(Press(1.0, 0.2))):
        truth = render(replace(small, surface=surface), size=SIZE).truth
        read = load_truth(save_truth(truth, tmp_path / "truth.npz"))
        for name in ("marker_xy_px", "visible", "virtual_xy_px", "cell_visible", "mirrored"):
            np.testing.assert_array_equal(getattr(read, name), getattr(truth, name))
        assert (read.H is None) == (truth.H is None)
    assert [path.name for path in tmp_path.iterdir()] == ["truth.npz"]
    with pytest.raises(OutputError, match="cannot write"):
        save_truth(truth, tmp_path / "absent" / "truth.npz")
    (tmp_path / "bad.npz").write_bytes(b"no truth")
    np.savez(tmp_path / "other.npz", mirrored=True)
    for name, message in (
        ("bad.npz", "not a truth file"),
        ("other.npz", "not a truth file"),
        ("none.npz", "cannot be read"),
    ):
        with pytest.raises(SceneError, match=f"{name}.*{message}"):
            load_truth(tmp_path / name)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda s: Optics(0.01), "blur_px is 0.01"),
        (lambda s: Sensor(noise=-1), "noise is -1"),
        (lambda s: Sensor(bits=12), "bits is 12"),
        (lambda s: Sensor(bits=16, jpeg_quality=50), "jpeg_quality"),
        (lambda s: Camera(pitch_px=0), "pitch_px is 0"),
        (lambda s: Camera(tilt_deg=90), "tilt_deg is 90"),
        (lambda s: Press(0, 1), "radius_mm is 0"),
        (lambda s: Light(vignetting=2), "vignetting is 2"),
        (lambda s: Damage(missing_share=1.5), "missing_share is 1.5"),
        (lambda s: Picture(np.zeros((3, 3), np.uint8)), "shape"),
        (lambda s: replace(s, inks={"mauve": (1, 2, 3)}), "mauve"),
        (lambda s: render(s, size=(0, 5)), "size is 0"),
        (lambda s: render(replace(s, damage=Damage(missing_cells=(999,)))), "missing cell 999"),
        (lambda s: render(replace(s, camera=Camera(300, tilt_deg=80, focal_px=200))), "behind the camera"),
    ],
)
def test_bad_values_are_named(small: Scene, make: object, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make(small)  # type: ignore[operator]


def test_the_square_pattern_is_drawn_too() -> None:
    scene = replace(standard_scene(standard_layout("square", 2)), sensor=None, camera=Camera(40))
    drawn = render(scene, size=SIZE)
    corners = drawn.truth.marker_xy_px[scene.layout.cell_corners]
    reference = corners[scene.layout.reference_cell].mean(axis=0).round().astype(int)
    np.testing.assert_allclose(drawn.image[reference[1], reference[0]], np.asarray(INKS["red"])[::-1], atol=1)
    assert drawn.truth.visible.all()
    assert GREEN not in scene.layout.cell_color
