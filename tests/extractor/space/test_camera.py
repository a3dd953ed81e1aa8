"""Pinholes against OpenCV, the exact inverse of the distortion, and the rig file."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from extractor import RigError, View, load_rig, parse_rig
from tests.support.view_scenes import DISTORTION, looking, opencv_px, pair, pressed, reference

RIG = """
[[view]]
name = "left"
focal_px = [900, 905.5]
centre_px = [319.5, 239.5]
distortion = [-0.1, 0.02, 0.0, 0.0, 0.0]
area_px = [0, 0, 320, 480]

[[view]]
name = "right"
focal_px = [900, 905.5]
centre_px = [319.5, 239.5]
area_px = [320, 0, 320, 480]
mirrored = true
"""

coefficient = st.floats(-0.4, 0.4)
small = st.floats(-0.02, 0.02)


def plain_view(**changes: object) -> View:
    values: dict[str, object] = {"name": "one", "focal_px": (900, 900), "centre_px": (320, 240), **changes}
    return View(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("back", [False, True])
def test_projection_is_opencvs(mirrored: bool, back: bool) -> None:
    view = looking("one", tilt_deg=25, azimuth_deg=40, roll_deg=20, mirrored=mirrored, back=back)
    xyz = pressed(reference().xy_mm)
    assert view.mirrored is mirrored and bool(view.position_mm[2] < 0) is back
    np.testing.assert_allclose(view.project(xyz), opencv_px(view, xyz), atol=1e-10)


def test_derivatives_are_those_of_the_projection() -> None:
    view = looking("one", tilt_deg=25, azimuth_deg=40, roll_deg=20, mirrored=True)
    xyz = pressed(reference().xy_mm)
    _, _, by_point, by_pose = view.linearised(xyz)
    step = 1e-5
    for k in range(3):
        moved = step * np.eye(3)[k]
        numeric = (view.project(xyz + moved) - view.project(xyz - moved)) / (2 * step)
        np.testing.assert_allclose(by_point[:, :, k], numeric, atol=1e-5)
        ends = []
        for sign in (1, -1):
            turn = cv2.Rodrigues(sign * moved)[0]
            ends.append(view.at(turn @ view.R_camera_from_layout, view.t_camera_from_layout_mm).project(xyz))
        np.testing.assert_allclose(by_pose[:, :, k], (ends[0] - ends[1]) / (2 * step), atol=1e-4)
        ends = [
            view.at(view.R_camera_from_layout, view.t_camera_from_layout_mm + sign * moved).project(xyz)
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(by_pose[:, :, 3 + k], (ends[0] - ends[1]) / (2 * step), atol=1e-5)


def pictured(plain: np.ndarray, distortion: tuple[float, ...]) -> np.ndarray:
    """(N, 2) px of directions (x, y, 1) by OpenCV, through the plain view's lens."""
    matrix = np.array([[900, 0, 320], [0, 900, 240], [0, 0, 1.0]])
    ahead = np.column_stack([plain, np.ones(len(plain))])
    return cv2.projectPoints(ahead[:, None], np.zeros(3), np.zeros(3), matrix, np.array(distortion))[0][:, 0]


@settings(max_examples=150, deadline=None)
@given(
    distortion=st.tuples(coefficient, coefficient, small, small, coefficient),
    place=st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)),
)
def test_the_inverse_of_the_distortion_is_one_or_says_no(
    distortion: tuple[float, ...], place: tuple[float, float]
) -> None:
    view = plain_view(distortion=distortion)
    plain = np.array([place])
    back = view.normalised(pictured(plain, distortion))
    if np.isfinite(back).all():
        np.testing.assert_allclose(pictured(back, distortion), pictured(plain, distortion), atol=1e-5)
        assert np.hypot(*back[0]) < view.fold_radius
    step = 1e-6 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    right, left, down, up = pictured(plain + step, distortion)
    by_plain = np.column_stack([right - left, down - up])
    gentle = np.hypot(*place) < 0.8 * view.fold_radius and np.linalg.det(by_plain) > 0
    if gentle and np.linalg.cond(by_plain) < 20 and max(map(abs, distortion[2:4])) < 0.005:
        np.testing.assert_allclose(back, plain, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(k1=st.floats(-0.35, 0.5), radius=st.floats(0, 0.9), angle=st.floats(0, 6.3))
def test_points_inside_the_model_come_back_to_the_last_digits(k1: float, radius: float, angle: float) -> None:
    view = plain_view(distortion=(k1, 0.0, 0.001, -0.001, 0.0))
    radius = min(radius, 0.9 * view.fold_radius)
    plain = radius * np.array([[np.cos(angle), np.sin(angle)]])
    np.testing.assert_allclose(view.normalised(pictured(plain, view.distortion)), plain, atol=1e-11)


def test_where_the_model_turns_back_there_is_no_ray_and_no_picture() -> None:
    view = looking("one", tilt_deg=0, distortion=(-0.4, 0, 0, 0, 0))
    fold = view.fold_radius
    assert fold == pytest.approx(np.sqrt(1 / 1.2))
    largest = fold * (1 - 0.4 * fold**2)
    beyond = np.array([[largest * 1.001, 0.0], [largest * 0.999, 0.0]]) * view.focal_px + view.centre_px
    assert np.isfinite(view.normalised(beyond)).all(axis=1).tolist() == [False, True]
    depth = view.t_camera_from_layout_mm[2]
    aside = np.array([[1.01 * fold * depth, 0, 0], [0.99 * fold * depth, 0, 0], [0, 0, -2 * depth]])
    assert np.isfinite(view.project(aside)).all(axis=1).tolist() == [False, True, False]


def test_a_mild_lens_never_fails() -> None:
    y, x = np.mgrid[0:480:16, 0:640:16].reshape(2, -1)
    view = plain_view(distortion=DISTORTION)
    xy_px = np.column_stack([x, y]).astype(float)
    np.testing.assert_allclose(pictured(view.normalised(xy_px), DISTORTION), xy_px, atol=1e-9)


def test_rays_lead_to_their_points() -> None:
    for view in pair(mirrored=(True, False)):
        xyz = pressed(reference().xy_mm)
        away = xyz - view.position_mm
        origin_mm, direction = view.rays(view.project(xyz))
        np.testing.assert_allclose(direction, away / np.linalg.norm(away, axis=1)[:, None], atol=1e-11)
        np.testing.assert_array_equal(origin_mm, np.tile(view.position_mm, (len(xyz), 1)))


def test_a_rig_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    rig = load_rig(tmp_path / "rig.toml")
    left, right = rig.views
    assert rig.names == ("left", "right") and not left.placed
    assert left.focal_px == (900.0, 905.5) and left.distortion[:2] == (-0.1, 0.02)
    assert right.distortion == (0.0,) * 5 and right.area_px == (320, 0, 320, 480)
    assert (left.mirrored, right.mirrored) == (False, True)


def test_a_pose_in_the_file_tells_whether_it_is_mirrored() -> None:
    text = RIG.replace(
        "mirrored = true",
        "R_camera_from_layout = [[-1, 0, 0], [0, -1, 0], [0, 0, -1]]\nt_camera_from_layout_mm = [0, 0, 40]",
    )
    view = parse_rig(text).views[1]
    assert view.placed and view.mirrored and view.position_mm.tolist() == [0, 0, 40]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("focal_px = [900, 905.5]", "", "view[0].focal_px is missing"),
        (
            "centre_px = [319.5, 239.5]",
            "centre_px = [319.5]",
            "view[0].centre_px is a list of 1; expected 2 numbers",
        ),
        ("[319.5, 239.5]", '[319.5, "x"]', "view[0].centre_px[1] is 'x'; expected a finite number"),
        ("[319.5, 239.5]", "[319.5, nan]", "view[0].centre_px[1] is nan; expected a finite number"),
        (
            "-0.1, 0.02, 0.0, 0.0, 0.0",
            "-0.1",
            "view[0].distortion is a list of 1; expected 5, 8 or 12 numbers",
        ),
        ("[0, 0, 320, 480]", "[0, 0.5, 320, 480]", "view[0].area_px[1] is 0.5; expected a whole number"),
        ("[0, 0, 320, 480]", "[0, 0, 320, 0]", "view 'left': area_px is (0, 0, 320, 0)"),
        (
            "[900, 905.5]",
            "[-900, 905.5]",
            "view 'left': focal_px is (-900.0, 905.5); expected two numbers above 0",
        ),
        ("mirrored = true", 'mirrored = "yes"', "view[1].mirrored is 'yes'; expected true or false"),
        ("mirrored = true", "mirorred = true", "view[1].'mirorred' is unknown"),
        ('"right"', '"left"', "the view's name 'left' is given 2 times"),
        (
            "mirrored = true",
            "t_camera_from_layout_mm = [0, 0, 1]",
            "view 'right': R_camera_from_layout and t_",
        ),
        (
            "mirrored = true",
            "R_camera_from_layout = [[1, 0, 0], [0, 1, 0]]",
            "R_camera_from_layout is a list of 2",
        ),
        (
            "mirrored = true",
            "R_camera_from_layout = [[1, 0, 0], [0, 1, 0], [0, 0, 2]]\nt_camera_from_layout_mm = [0, 0, 1]",
            "view 'right': R_camera_from_layout is not a 3 x 3 rotation or reflection",
        ),
        (
            "mirrored = true",
            "mirrored = true\nR_camera_from_layout = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n"
            "t_camera_from_layout_mm = [0, 0, 1]",
            "view 'right': mirrored is true, but det R is +1",
        ),
        ("[[view]]", "[[camera]]", "view is missing; expected at least one [[view]] table"),
        ("[[view]]", "[[view]", "not TOML"),
    ],
)
def test_a_rig_file_that_cannot_be_believed_names_the_field(old: str, new: str, said: str) -> None:
    assert old in RIG
    with pytest.raises(RigError) as error:
        parse_rig(RIG.replace(old, new), "rig.toml")
    assert str(error.value).startswith("rig.toml: ") and said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_rig_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(RigError, match="cannot be read: No such file"):
        load_rig(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(RigError, match="not UTF-8"):
        load_rig(tmp_path / "bad.toml")
