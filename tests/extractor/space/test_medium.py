"""Views through a window and a gel against rays by Snell's law; poses, points and covariances behind it."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from extractor import Medium, PoseError, Reconstructor, Rig, RigError, View, WindowPlane, parse_rig
from tests.support.light_rays import Slab, from_camera, slab_at_rest, to_camera
from tests.support.view_scenes import flat, looking, noisy, pair, pressed, reference, unplaced

LAYOUT = reference()
TRUE = pressed(LAYOUT.xy_mm)
GEL, WINDOW = (4.0, 1.41), (2.5, 1.49)
MEDIUM = Medium(*GEL, *WINDOW)
TILTED = WindowPlane((0.1, -0.2, 0.9), 22.0)


def behind(view: View, medium: Medium = MEDIUM, window: WindowPlane | None = None) -> View:
    return replace(view, medium=medium, window=window)


def view_of(back: bool, mirrored: bool, tilted: bool) -> tuple[View, Slab]:
    """A view through the medium, and its window for the tracer."""
    view = behind(
        looking("one", tilt_deg=25, azimuth_deg=40, roll_deg=20, mirrored=mirrored, back=back),
        window=TILTED if tilted else None,
    )
    if not tilted:
        return view, slab_at_rest(view.R_camera_from_layout, view.t_camera_from_layout_mm, GEL, WINDOW)
    normal = np.array(TILTED.normal) / np.linalg.norm(TILTED.normal)
    return view, Slab(normal, TILTED.distance_mm, *WINDOW, GEL[1])


VIEWS = [view_of(*flags) for flags in ((True, False, False), (False, True, False), (True, True, True))]


def pixels() -> np.ndarray:
    y, x = np.mgrid[60:420:9, 100:540:11].reshape(2, -1)
    return np.column_stack([x, y]).astype(float)


def direction_of(view: View, xy_px: np.ndarray) -> np.ndarray:
    return np.column_stack([view.normalised(xy_px), np.ones(len(xy_px))])


@pytest.mark.parametrize(("view", "slab"), VIEWS)
@pytest.mark.parametrize("height_mm", [-0.9, 0.0, 0.7])
def test_a_point_is_seen_where_the_light_of_its_pixel_comes_from(
    view: View, slab: Slab, height_mm: float
) -> None:
    xy_px = pixels()
    start, direction = from_camera(slab, direction_of(view, xy_px))
    to_layout = view.R_camera_from_layout
    start, direction = (start - view.t_camera_from_layout_mm) @ to_layout, direction @ to_layout
    points = start + direction * ((height_mm - start[:, 2]) / direction[:, 2])[:, None]
    np.testing.assert_allclose(view.project(points), xy_px, atol=1e-9)
    lines = view.rays(xy_px)
    np.testing.assert_allclose(lines.origin_mm, start, atol=1e-10)
    np.testing.assert_allclose(lines.direction, direction, atol=1e-12)


@pytest.mark.parametrize(("view", "slab"), VIEWS)
def test_light_goes_the_same_way_back(view: View, slab: Slab) -> None:
    """From a point along its line of sight, through gel and window by Snell's law, to the camera."""
    line = view.rays(view.project(TRUE)).direction @ view.R_camera_from_layout.T
    camera = TRUE @ view.R_camera_from_layout.T + view.t_camera_from_layout_mm
    start, direction = to_camera(slab, camera, -line)
    missed_mm = np.linalg.norm(np.cross(start, direction), axis=1)
    assert missed_mm.max() < 1e-10


@pytest.mark.parametrize("window", [None, TILTED])
def test_indices_of_one_are_air(window: WindowPlane | None) -> None:
    for view in pair(mirrored=(True, False)):
        clear = behind(view, Medium(4.0, 1.0, 2.0, 1.0), window)
        for made, plain in zip(clear.linearised(TRUE), view.linearised(TRUE), strict=True):
            np.testing.assert_allclose(made, plain, atol=1e-9)


def test_no_thickness_is_air_to_the_last_bit() -> None:
    for view in pair():
        thin = behind(view, Medium(0.0, 1.41, 0.0, 1.49))
        for made, plain in zip(thin.linearised(TRUE), view.linearised(TRUE), strict=True):
            np.testing.assert_array_equal(made, plain)


def test_near_the_normal_depth_shrinks_by_the_index() -> None:
    """The apparent depth of a point straight ahead: each layer looks as thick as its thickness over its index."""
    view = behind(looking("one", tilt_deg=0, distortion=(0.0,) * 5))
    aside = np.array([[1e-3, 0.0, 0.0]])
    apparent = 40 - GEL[0] - WINDOW[0] + GEL[0] / GEL[1] + WINDOW[0] / WINDOW[1]
    seen_px = float(np.linalg.norm(view.project(aside)[0] - view.centre_px))
    assert seen_px == pytest.approx(900 * 1e-3 / apparent, rel=1e-6)
    assert np.isfinite(np.concatenate([part.ravel() for part in view.linearised(np.zeros((1, 3)))])).all()


@pytest.mark.parametrize(("view", "slab"), VIEWS)
def test_derivatives_are_those_of_the_projection(view: View, slab: Slab) -> None:
    xyz = np.concatenate([TRUE, np.zeros((1, 3))])
    _, _, by_point, by_pose = view.linearised(xyz)
    rotation, shift = view.R_camera_from_layout, view.t_camera_from_layout_mm
    step = 1e-5
    for k in range(3):
        moved = step * np.eye(3)[k]
        turns = [cv2.Rodrigues(sign * moved)[0] @ rotation for sign in (1, -1)]
        for found, ends in (
            (by_point[:, :, k], [view.project(xyz + moved), view.project(xyz - moved)]),
            (by_pose[:, :, k], [view.at(turn, shift).project(xyz) for turn in turns]),
            (by_pose[:, :, 3 + k], [view.at(rotation, shift + s * moved).project(xyz) for s in (1, -1)]),
        ):
            np.testing.assert_allclose(found, (ends[0] - ends[1]) / (2 * step), atol=1e-5)


def test_what_lies_in_the_window_or_before_it_is_not_seen() -> None:
    view = behind(looking("one", tilt_deg=0))
    heights = np.array([[0, 0, -3.9], [0, 0, -4.1], [0, 0, -7.0], [0, 0, 5.0]])
    assert np.isfinite(view.project(heights)).all(axis=1).tolist() == [True, False, False, True]
    within = behind(looking("one", tilt_deg=0, distance_mm=6.0))
    assert np.isnan(within.project(flat(LAYOUT))).all()
    assert np.isnan(within.rays(np.array([[320.0, 240.0]])).direction).all()


def test_a_pattern_on_the_window_is_seen() -> None:
    view = behind(looking("one", tilt_deg=20), Medium(0.0, None, 2.0, 1.49))
    assert np.isfinite(view.project(flat(LAYOUT))).all()


def through(window: WindowPlane | None = None) -> tuple[View, View]:
    left, right = (behind(view, window=window) for view in pair(mirrored=(True, False)))
    return left, right


def normalised(error: np.ndarray, cov: np.ndarray) -> float:
    """RMS error per axis in units of its covariance."""
    return float(np.sqrt(np.mean(np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error)) / 3))


@pytest.mark.parametrize("window", [None, WindowPlane((0.25, 0.02, 0.97), 31.0)])
def test_poses_and_points_behind_the_medium_are_calibrated(window: WindowPlane | None) -> None:
    """Poses from a noisy rest frame each time; the window parallel to the pattern, or fixed to each camera."""
    views, rng = through(window), np.random.default_rng(4)
    position, moved = [], []
    for _ in range(12):
        rest, now = ([noisy(LAYOUT, v, xyz, rng) for v in views] for xyz in (flat(LAYOUT), TRUE))
        found = Reconstructor(LAYOUT, unplaced(views), rest, model_px=0.0)
        assert found.poses.misfit < 1.15 and not found.warnings
        shape = found.reconstruct(now)
        position.append(normalised(shape.xyz_mm - TRUE, shape.cov_mm2))
        moved.append(normalised(shape.displacement_mm - (TRUE - flat(LAYOUT)), shape.displacement_cov_mm2))
    assert 0.85 < np.sqrt(np.mean(np.square(position))) < 1.15
    assert 0.85 < np.sqrt(np.mean(np.square(moved))) < 1.15


def test_exact_pictures_give_exact_poses_and_points() -> None:
    views, rng = through(), np.random.default_rng(5)
    rest, now = ([noisy(LAYOUT, v, xyz, rng, 1e-9) for v in views] for xyz in (flat(LAYOUT), TRUE))
    found = Reconstructor(LAYOUT, unplaced(views), rest)
    for made, true in zip(found.poses.views, views, strict=True):
        np.testing.assert_allclose(made.position_mm, true.position_mm, atol=1e-7)
    np.testing.assert_allclose(found.reconstruct(now).xyz_mm, TRUE, atol=1e-7)


def without_medium(views: tuple[View, ...]) -> Rig:
    return Rig(tuple(replace(view, medium=None) for view in unplaced(views).views))


def test_ignoring_the_medium_shortens_depth_and_is_warned_about() -> None:
    views, rng = through(), np.random.default_rng(6)
    rest, now = ([noisy(LAYOUT, v, xyz, rng, 0.005) for v in views] for xyz in (flat(LAYOUT), TRUE))
    blind = Reconstructor(LAYOUT, without_medium(views), rest)
    deepest = TRUE[:, 2].argmin()
    short = 1 - blind.reconstruct(now).displacement_mm[deepest, 2] / TRUE[deepest, 2]
    assert 0.2 < short < 0.35
    assert len(blind.warnings) == 1 and "[medium]" in blind.warnings[0]


@pytest.mark.parametrize("cause", ["medium", "lens", "poses", "surface"])
def test_the_likely_cause_of_a_misfit_at_rest_is_named(cause: str) -> None:
    views, rng = through(), np.random.default_rng(7)
    rig, surface = unplaced(views), flat(LAYOUT)
    if cause == "medium":
        thick = replace(MEDIUM, gel_mm=8.0)
        rig = Rig(tuple(replace(view, medium=thick) for view in rig.views))
    elif cause == "lens":
        rig = Rig(tuple(replace(view, distortion=(0.05, 0.0, 0.0, 0.0, 0.0)) for view in rig.views))
    elif cause == "poses":
        rig = Rig(
            tuple(view.at(view.R_camera_from_layout, view.t_camera_from_layout_mm + 0.02) for view in views)
        )
    else:
        surface = pressed(LAYOUT.xy_mm, 0.4)
    rest = [noisy(LAYOUT, view, surface, rng, 0.003) for view in views]
    (warning,) = Reconstructor(LAYOUT, rig, rest).warnings
    named = {"medium": "[medium]", "lens": "focal_px", "poses": "--from-rest", "surface": "flatness_mm"}
    assert [key for key, text in named.items() if text in warning] == [cause]


def test_a_misfit_that_nothing_explains_is_said_to_be_unknown() -> None:
    """Noise of twenty times the stated covariances: no gel, lens, pose or touch explains the picture."""
    views, rng = through(), np.random.default_rng(9)
    rest = [noisy(LAYOUT, view, flat(LAYOUT), rng, 0.06) for view in views]
    sure = [replace(markers, cov_px2=markers.cov_px2 / 400) for markers in rest]
    (warning,) = Reconstructor(LAYOUT, unplaced(views), sure).warnings
    assert re.search(r"\b(19|20|21) times", warning) and "none that is known" in warning
    assert not Reconstructor(LAYOUT, unplaced(views), rest).warnings


def test_a_gel_that_does_not_fit_before_the_camera_is_refused() -> None:
    views, rng = through(), np.random.default_rng(8)
    rest = [noisy(LAYOUT, view, flat(LAYOUT), rng) for view in views]
    thick = replace(MEDIUM, gel_mm=90.0)
    rig = Rig(tuple(replace(view, medium=thick) for view in unplaced(views).views))
    with pytest.raises(
        PoseError, match=r"a gel of 90 mm and a window of 2\.5 mm do not fit between the camera"
    ):
        Reconstructor(LAYOUT, rig, rest)
    placed = Rig(tuple(replace(view, medium=thick) for view in views))
    with pytest.raises(PoseError, match="do not fit between the camera"):
        Reconstructor(LAYOUT, placed, rest)


RIG = """
[[view]]
name = "left"
focal_px = [900, 905.5]
centre_px = [319.5, 239.5]
window_normal = [0.0, 0.6, 0.8]
window_distance_mm = 30

[medium]
gel_mm = 4
gel_index = 1.41
window_mm = 2.0
window_index = 1.49
"""


def test_a_medium_is_read_from_a_rig_file() -> None:
    (view,) = parse_rig(RIG).views
    assert view.medium == Medium(4, 1.41, 2.0, 1.49)
    assert view.window is not None and view.window.distance_mm == 30
    np.testing.assert_allclose(view.window.normal, [0.0, 0.6, 0.8])
    air = parse_rig(RIG.replace("gel_mm = 4", "gel_mm = 0").replace("window_mm = 2.0", "")).views[0]
    assert air.medium is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("gel_index = 1.41", "", "medium.gel_index is missing; expected the gel's index of refraction"),
        ("gel_index = 1.41", "gel_index = 0.9", "medium.gel_index is 0.9; expected a number from 1 to 4"),
        ("gel_mm = 4", "gel_mm = -1", "medium.gel_mm is -1; expected a number from 0 to 1000 mm"),
        ("gel_mm = 4", 'gel_mm = "4"', "medium.gel_mm is '4'; expected a finite number"),
        ("gel_mm = 4", "gel = 4", "medium.'gel' is unknown"),
        ("[medium]", "[[medium]]", "medium is a list of 1; expected a table of gel_mm"),
        ("window_distance_mm = 30", "", "view[0].window_distance_mm is missing; expected both"),
        ("window_distance_mm = 30", "window_distance_mm = 0", "window_distance_mm is 0; expected a number above"),
        ("[0.0, 0.6, 0.8]", "[0.0, 0.6, -0.8]", "window_normal is [0.0, 0.6, -0.8]; expected 3 numbers"),
    ],
)  # fmt: skip
def test_a_medium_that_cannot_be_names_the_field(old: str, new: str, said: str) -> None:
    assert old in RIG
    with pytest.raises(RigError) as error:
        parse_rig(RIG.replace(old, new), "rig.toml")
    assert str(error.value).startswith("rig.toml: ") and said in str(error.value)
