"""Scene files: composed scenes, refused values, sequences, and absent parts, which take no time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cmpdesign.design.templates import scene_templates
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import (
    Camera,
    Damage,
    Dent,
    Gradient,
    Optics,
    Picture,
    Pinhole,
    Plain,
    Scene,
    SceneError,
    SceneFile,
    Sensor,
    Twist,
    composed,
    load_scene,
    load_truth,
    load_truths,
    render,
    save_truth,
    save_truths,
    standard_layout,
)
from cmpdesign.scene.files.key_frames import document_at_time, flatten_table, interpolate_key_frames
from tests.support.scene_texts import MOVING, SIZE, scene_writer

ROOT = Path(__file__).parents[3]
BALL = """
[contact]
size_mm = [8, 8]
grid = 32
friction = 0.5
elastomer = { thickness_mm = 2, young_mpa = 0.2 }
indenter = { kind = "ball", radius_mm = 3 }
motion = { press_mm = 0.1 }
"""


@pytest.fixture(scope="module")
def layout() -> Layout:
    return standard_layout(layers=2)


@pytest.fixture
def written(tmp_path: Path, layout: Layout) -> Callable[..., SceneFile]:
    return scene_writer(tmp_path, layout)


def test_a_file_says_what_python_says(written, layout: Layout, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    file = written(
        """
        size_px = [96, 80]
        seed = 4
        [camera]
        pitch_px = 16
        tilt_deg = 20
        [surface.twist]
        radius_mm = 2
        angle_deg = 9
        [surface.dent]
        radius_mm = 1
        depth_mm = 0.3
        [background]
        kind = "gradient"
        angle_deg = 70
        [optics]
        blur_px = 0.8
        [sensor]
        noise = 2
        response = 2.2
        [damage]
        missing_cells = [3]
        [inks]
        red = "#ff0000"
        white = [200, 210, 220]
        """
    )
    same = Scene(
        layout,
        Camera(16, tilt_deg=20),
        composed(Twist(2, 9), Dent(1, 0.3)),
        background=Gradient(angle_deg=70),
        optics=Optics(0.8),
        sensor=Sensor(noise=2, response=2.2),
        damage=Damage(missing_cells=(3,)),
        inks={"red": (255, 0, 0), "white": (200, 210, 220)},
        seed=4,
    )
    drawn = render(file.scene(), size=file.size_px)
    assert drawn.image.tobytes() == render(same, size=SIZE).image.tobytes()
    assert (file.frames, file.fps, file.bits) == (1, None, 8)


def test_views_are_placed_by_pose_or_by_what_they_see(written, layout: Layout) -> None:  # type: ignore[no-untyped-def]
    looking = (
        written("[[view]]\ndistance_mm = 9\nfield_of_view_deg = 40\nback = true\nmirrored = true")
        .scene()
        .camera
    )
    assert isinstance(looking, Pinhole)
    expected = Pinhole.looking((640, 480), distance_mm=9, field_of_view_deg=40, back=True, mirror=True)
    np.testing.assert_array_equal(looking.R_camera_from_layout, expected.R_camera_from_layout)
    r, t = looking.R_camera_from_layout.tolist(), looking.t_camera_from_layout_mm.tolist()
    focal, centre = list(looking.focal_px), list(looking.centre_px)
    pose = f"t_camera_from_layout_mm = {t}\nR_camera_from_layout = {r}\n"
    view = f"[[view]]\nfocal_px = {focal}\ncentre_px = {centre}\n{pose}"
    posed = written(view + "mirrored = true").scene().camera
    assert isinstance(posed, Pinhole)
    np.testing.assert_array_equal(posed.t_camera_from_layout_mm, looking.t_camera_from_layout_mm)
    two = written(view + "area_px = [0, 0, 9, 9]\n" + view + "area_px = [9, 0, 9, 9]").scene().camera
    assert isinstance(two, tuple) and [v.area_px for v in two] == [(0, 0, 9, 9), (9, 0, 9, 9)]
    with pytest.raises(SceneError, match=r"\[\[view\]\] 0: mirrored is false, but the determinant"):
        written(view + "mirrored = false")


def test_a_picture_lies_beside_the_file(written, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    cv2.imwrite(str(tmp_path / "desk.png"), np.full((20, 30, 3), 77, np.uint8))
    background = written('[background]\nkind = "picture"\npath = "desk.png"').scene().background
    assert isinstance(background, Picture) and background.image.shape == (20, 30, 3)
    assert written("").scene().background == Plain()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[camra]\nx = 1", r"scene.toml: camra is unknown \(did you mean camera\?\)"),
        ("[camera]\npitch = 3", r"\[camera\] pitch is unknown \(did you mean pitch_px\?\)"),
        ("[camera]\npitch_px = -3", r"\[camera\] pitch_px is -3; it must be above 0 px"),
        ('[camera]\npitch_px = "3"', r'\[camera\] pitch_px is "3"; it must be a valid number in px'),
        ("[camera]\npitch_px = nan", r"\[camera\] pitch_px is NaN; it must be a finite number"),
        ("[camera]\ncentre_px = [1, 2, 3]", r"\[camera\] centre_px has 3 values; it takes 2"),
        ("[[light.leds]]\nangle_deg = 3\nrgb = [1, 0]", r"\[light\] leds.0.rgb has too few values"),
        (
            "[[light.leds]]\nangl_deg = 3\nrgb = [1, 0, 0]",
            r"leds.0.angl_deg is unknown \(did you mean angle_deg",
        ),
        ("[light]\nvignetting = 3", r"\[light\] vignetting is 3; it must lie between 0 and 1"),
        ("light = 3", "light is 3; it must be a table"),
        ("size_px = [1, 2]", r"size_px is \[1, 2\]; each side must lie between 10 and 9999 px"),
        ("seed = -1", "seed is -1"),
        ("[sensor]\nbits = 8.0", r"\[sensor\] bits is 8.0; it must be a valid integer"),
        ("[sensor]\nbits = 12", r"\[sensor\] bits is 12; it must be 8 or 16"),
        (
            '[sensor]\nresponse = "rec709"',
            r"response is \"rec709\"; it must be 'srgb' or 'linear' or a valid number or a list$",
        ),
        ("[sensor]\nresponse = 9", r"\[sensor\] response is the exponent 9; it must lie between 0.2 and 5"),
        ("[sensor]\nresponse = [0, 9]", r"\[sensor\] response is a table of shape \(2,\); give 256 values"),
        (
            f"[sensor]\nresponse = {[0.5] * 256}",
            r"does not rise from value 0 \(0.5\) to the next \(0.5\); each value must",
        ),
        ("[sensor]\ngamma = 2.2", r"\[sensor\] gamma is unknown; there are noise, response, bits"),
        ('[background]\nkind = "papr"', r"kind is 'papr' \(did you mean paper\?\)"),
        ('[background]\nkind = "paper"\ngrain = true', r"\[background\] grain is true"),
        (
            '[background]\nkind = "picture"\npath = "none.png"',
            r"\[background\] path: .*none.png: cannot be read",
        ),
        ('[inks]\nred = "red"', r'\[inks\] red is "red"; write "#c8322d"'),
        ("[inks]\nmauve = [1, 2, 3]", r"\[inks\] mauve is unknown"),
        ("[camera]\n[[view]]\ndistance_mm = 3\nfield_of_view_deg = 9", "leave one out"),
        ("view = []", "view is empty"),
        ("[[view]]\nfocal_px = [1, 1]", r"\[\[view\]\] 0: centre_px is missing \(or give distance_mm"),
        ("[[view]]\nfocal_px = [1, 1]\ntilt_deg = 4", "focal_px and tilt_deg place the camera twice"),
        ("[[view]]\ndistnce_mm = 30", r"distnce_mm is unknown \(did you mean distance_mm\?\)"),
        ("[[view]]\ndistance_mm = -3\nfield_of_view_deg = 9", r"\[\[view\]\] 0: distance_mm is -3"),
        ("[contact]", "contact.elastomer is missing"),
        (BALL.replace("radius_mm = 3", "radus_mm = 3"), r"radus_mm is unknown \(did you mean radius_mm\?\)"),
        (
            BALL + "[sequence]\nframes = 2\n[sequence.values]\ncontact.motion.press_mm = [[0, 1], [1, -1]]",
            "press_mm",
        ),
        ("[sequence]\nframes = 0", r"\[sequence\] frames is 0"),
        ("[sequence]\nframes = 2", r"\[sequence\] values is missing"),
        (
            "[sequence]\nframes = 2\n[sequence.values]\nlight.rgb = [[0, 1]]",
            "there is no light; give its starting",
        ),
        (
            "[camera]\n[sequence]\nframes = 2\n[sequence.values]\ncamra.tilt_deg = [[0, 1]]",
            "did you mean camera",
        ),
        (
            "[camera]\n[sequence]\nframes = 2\n[sequence.values]\ncamera.tilt = [[0, 1]]",
            "did you mean tilt_deg",
        ),
        (
            "[camera]\n[sequence]\nframes = 2\n[sequence.values]\ncamera.tilt_deg = [[0, 1], [0, 2]]",
            "in increasing order",
        ),
        (
            "[camera]\n[sequence]\nframes = 2\n[sequence.values]\ncamera.tilt_deg = [[0, 1], [1, [2]]]",
            "shapes",
        ),
        (
            "[camera]\n[sequence]\nframes = 2\n[sequence.values]\ncamera.tilt_deg = [[0, 1], [1, 99]]",
            "tilt_deg is 99",
        ),
        (
            "seed = 1\n[sequence]\nframes = 2\n[sequence.values]\nseed.x = [[0, 1]]",
            "seed is a value, no table",
        ),
        ("x", "is no valid TOML"),
    ],
)
def test_what_is_wrong_is_named(written, text: str, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SceneError, match=message) as caught:
        written(text)
    assert str(caught.value).count("scene.toml") == 1


def test_files_that_are_none(layout: Layout, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    for name, message in (("a.toml", "no UTF-8"), ("b.toml", "cannot be read")):
        with pytest.raises(SceneError, match=message):
            load_scene(tmp_path / name, layout)


def test_values_go_straight_between_their_keys() -> None:
    keys = ((1.0, 2.0), (3.0, 4.0), (4.0, 0.0))
    assert [interpolate_key_frames(keys, t) for t in (0, 1, 2, 3, 3.5, 4, 9)] == [2, 2, 3, 4, 2, 0, 0]
    assert interpolate_key_frames(((0.0, (0.0, 4.0)), (2.0, (1.0, 0.0))), 1.0) == [0.5, 2.0]
    document = {"a": {"b": [{"c": 1}, {"c": 2}]}}
    assert document_at_time(document, {"a.b.1.c": keys}, 2.0) == {"a": {"b": [{"c": 1}, {"c": 3.0}]}}
    assert document["a"]["b"][1]["c"] == 2
    assert flatten_table({"a": {"b": 1, "c": {"d": 2}}, "e.f": 3}) == {"a.b": 1, "a.c.d": 2, "e.f": 3}
    with pytest.raises(SceneError, match="there is no 2 in a"):
        document_at_time({"a": [[1, 2], [3, 4]]}, {"a.2.0": keys}, 0)
    with pytest.raises(SceneError, match="there is no 5, it has 0 to 1"):
        document_at_time({"a": [1, 2]}, {"a.5": keys}, 0)


def test_a_sequence_moves_and_only_its_noise_is_new(written) -> None:  # type: ignore[no-untyped-def]
    file = written(MOVING)
    assert (file.frames, file.fps) == (5, 4.0) and [file.time_s(i) for i in (0, 4)] == [0.0, 1.0]
    scenes = list(file.scenes())
    dents = [scene.surface.deformations[0] for scene in scenes]
    assert [dent.depth_mm for dent in dents] == [0, 0, 0.5, 1, 1]
    assert [dent.centre_mm for dent in dents] == [(0, 0), (0.25, 0.5), (0.5, 1), (0.75, 1.5), (1, 2)]
    drawn = [render(scene, size=file.size_px) for scene in scenes]
    assert (drawn[0].image != drawn[1].image).any()  # nothing moved yet: the noise alone
    first, second = (frame.truth for frame in drawn[:2])
    np.testing.assert_array_equal(first.cell_visible, second.cell_visible)
    np.testing.assert_array_equal(first.marker_xy_px, second.marker_xy_px)
    again = render(next(file.scenes()), size=file.size_px)
    assert again.image.tobytes() == drawn[0].image.tobytes()


def test_a_truth_of_many_frames_survives_its_file(written, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    file = written(MOVING)
    truths = [render(scene, size=file.size_px).truth for scene in file.scenes()]
    read, time_s = load_truths(save_truths(truths, [0, 1, 2, 3, 4], tmp_path / "t.npz"))
    np.testing.assert_array_equal(time_s, np.arange(5))
    for a, b in zip(truths, read, strict=True):
        np.testing.assert_array_equal(a.marker_xyz_mm, b.marker_xyz_mm)
        np.testing.assert_array_equal(a.visible, b.visible)
        assert b.mirrored is False and b.H is None
    with pytest.raises(SceneError, match="load_truths"):
        load_truth(tmp_path / "t.npz")
    with pytest.raises(SceneError, match="no sequence"):
        load_truths(save_truth(truths[0], tmp_path / "one.npz"))


def test_a_contact_is_pressed_into_the_surface(written, layout: Layout) -> None:  # type: ignore[no-untyped-def]
    from cmpdesign.contact import Ball, Elastomer, Motion, solve

    contact = solve(Elastomer(2, 0.2), Ball(3.0), Motion(0.1), friction=0.5, size_mm=(8, 8), grid=32)
    surface = written(BALL).scene().surface
    assert surface is not None
    np.testing.assert_allclose(
        surface(layout.marker_xy_mm), contact.surface()(layout.marker_xy_mm), atol=1e-9
    )
    assert surface(np.zeros((1, 2)))[0, 2] == pytest.approx(-0.1, rel=0.05)
    deep = written(BALL.replace("press_mm = 0.1", "press_mm = 0.5")).scene()
    assert deep.warnings and render(deep, size=SIZE).warnings == deep.warnings


# type: ignore[no-untyped-def]
def test_a_pattern_below_the_touched_surface_moves_as_the_layer_does_there(written, layout: Layout) -> None:
    from cmpdesign.contact import Ball, Elastomer, Motion, solve

    deep = Elastomer(2, 0.2, marker_depth_mm=0.5)
    contact = solve(deep, Ball(3.0), Motion(0.1), friction=0.5, size_mm=(8, 8), grid=32)
    text = BALL.replace("young_mpa = 0.2", "young_mpa = 0.2, marker_depth_mm = 0.5")
    assert text != BALL
    surface = written(text).scene().surface
    assert surface is not None
    moved = surface(layout.marker_xy_mm)
    np.testing.assert_allclose(moved, contact.marker_layer()(layout.marker_xy_mm), atol=1e-9)
    assert -0.07 < surface(np.zeros((1, 2)))[0, 2] < -0.02


def test_a_moving_contact_remembers_its_way(written, layout: Layout) -> None:  # type: ignore[no-untyped-def]
    """Pressed, dragged to the side and back: friction leaves a part of the drag behind."""
    way = (
        BALL + "\n[sequence]\nframes = 4\nfps = 1\n[sequence.values]\ncontact.motion.press_mm = [[0, 0.1]]\n"
    )
    drag = "contact.motion.shear_mm = [[0, [0, 0]], [1, [0.3, 0]], [2, [0, 0]], [3, [0, 0]]]"
    places = [scene.surface(np.zeros((1, 2)))[0] for scene in written(way + drag).scenes()]
    assert places[1][0] > 0.05
    assert places[2][0] < -0.005 and abs(places[3][0] - places[2][0]) < 1e-3
    # What changes besides the motion starts every frame from rest.
    other = way + "contact.indenter.radius_mm = [[0, 3], [1, 2]]"
    depth = [scene.surface(np.array([[0.5, 0.0]]))[0, 2] for scene in written(other).scenes()]
    assert depth[0] < depth[1] == depth[2]
    away = way + "contact.indenter.centre_mm = [[0, [0, 0]], [1, [50, 0]]]"
    with pytest.raises(
        SceneError, match=r"scene.toml: \[contact\] the object at \(50, 0\) mm covers no cell"
    ):
        list(written(away).scenes())


# type: ignore[no-untyped-def]
def test_an_unmoved_contact_is_solved_once(written, monkeypatch: pytest.MonkeyPatch) -> None:
    from cmpdesign.contact.table import ContactSetup

    calls: list[int] = []
    solve = ContactSetup.solve
    monkeypatch.setattr(ContactSetup, "solve", lambda setup: (calls.append(1), solve(setup))[1])
    turning = (
        "[camera]\n" + BALL + "[sequence]\nframes = 4\n[sequence.values]\ncamera.tilt_deg = [[0, 0], [1, 30]]"
    )
    scenes = list(written(turning).scenes())
    assert len(calls) == 1 and len({scene.camera.tilt_deg for scene in scenes}) == 4


ABSENT = """
import sys
sys.path.insert(0, {root!r})
from pathlib import Path
from cmpdesign.scene import load_scene, standard_layout, render
layout = standard_layout(layers=2)
before = set(sys.modules)
file = load_scene(Path({path!r}), layout)
render(file.scene(), size=file.size_px)
print(*sorted(set(sys.modules) - before))
"""


def test_what_is_absent_is_not_even_imported(tmp_path: Path) -> None:
    """A flat sheet under one camera: no contact, no folds in depth, no blur, no video, no extractor."""
    path = tmp_path / "flat.toml"
    code = ABSENT.format(root=str(ROOT), path=str(path))

    def loaded(text: str) -> set[str]:
        path.write_text(text, encoding="utf-8")
        result = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
        )
        assert result.returncode == 0, result.stderr
        return set(result.stdout.split())

    contact = {"cmpdesign.contact", "cmpdesign.scene.files.contacts", "scipy.ndimage", "shapely"}
    optional = contact | {
        "scipy.special",
        "cv2",
        "extractor",
        "cmpdesign.files.video_writer",
    }
    flat = loaded("size_px = [96, 80]\n[camera]\npitch_px = 16")
    assert flat & optional == set()
    assert contact <= loaded("size_px = [96, 80]\n" + BALL)


def test_parts_that_do_nothing_change_no_byte(written: Callable[..., SceneFile]) -> None:
    plain = "size_px = [96, 80]\n[camera]\npitch_px = 16\n"

    def image(text: str) -> bytes:
        return render(written(plain + text).scene(), size=SIZE).image.tobytes()

    idle = "[light]\nvignetting = 0\n[damage]\nbleed_mm = 0\nmissing_share = 0\n[sensor]\nnoise = 0\nresponse = 'srgb'"
    assert image("") == image(idle)
    light, bleed, missing = (
        "[light]\nvignetting = 0.1",
        "[damage]\nbleed_mm = 0.05",
        "[damage]\nmissing_share = 0.1",
    )
    for part in (light, bleed, missing, "[sensor]\nresponse = 'linear'", "[sensor]\nresponse = 2.2"):
        assert image("") != image(part)


@pytest.mark.parametrize("name", scene_templates())
def test_every_template_draws(name: str) -> None:
    layout = standard_layout(layers=3)
    file = load_scene(scene_templates()[name], layout)
    scene = next(file.scenes())
    drawn = render(scene, size=file.size_px)
    assert drawn.truth.visible.all(axis=-1).all() and drawn.image.std() > 5


def test_the_binocular_is_one_camera_before_two_mirrors() -> None:
    """The template's numbers follow from the camera and the mirrors of its comment."""
    file = load_scene(scene_templates()["tac3d-binocular"], standard_layout(layers=1))
    views = file.scene().camera
    assert isinstance(views, tuple) and len({(v.focal_px, v.centre_px, v.distortion) for v in views}) == 1
    down = np.diag([1.0, -1.0, -1.0])
    camera = Pinhole(
        (900, 900), (639.5, 359.5), R_camera_from_layout=down, t_camera_from_layout_mm=[0, 0, -14.0]
    )
    for view, side in zip(views, (1, -1), strict=True):
        turn = np.radians(15.03)
        seen = camera.reflected((0, 0, -40), (side * np.sin(turn), 0, np.cos(turn)))
        np.testing.assert_allclose(view.R_camera_from_layout, seen.R_camera_from_layout, atol=1e-8)
        np.testing.assert_allclose(view.t_camera_from_layout_mm, seen.t_camera_from_layout_mm, atol=1e-7)
        assert not view.mirrored and np.linalg.det(view.R_camera_from_layout) < 0
