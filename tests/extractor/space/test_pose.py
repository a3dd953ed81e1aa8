"""Poses from the rest frame: found, calibrated, mirrored, jointly, and refused where the image does not tell them."""

from __future__ import annotations

import numpy as np
import pytest

from extractor import PoseError, View
from extractor.space.pose import estimate_poses
from tests.support.view_scenes import flat, looking, noisy, opencv_px, pair, reference, unplaced

NONE = (0.0, 0.0, 0.0)


def placed(views: tuple[View, ...], rng: np.random.Generator, spread=NONE, sigma_px: float = 0.02):
    layout = reference()
    seen = [noisy(layout, view, flat(layout), rng, sigma_px) for view in views]
    xy, cov = np.stack([m.xy_px for m in seen]), np.stack([m.cov_px2 for m in seen])
    return estimate_poses(unplaced(views).views, layout.xy_mm, xy, cov, spread)


def pose_error(found: View, true: View) -> np.ndarray:
    """(6,) turn in rad and shift in mm from the true pose to the found one."""
    turn = found.R_camera_from_layout @ true.R_camera_from_layout.T
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return np.concatenate([vector, found.t_camera_from_layout_mm - true.t_camera_from_layout_mm])


@pytest.mark.parametrize("mirrored", [(False, False), (True, True), (True, False)])
@pytest.mark.parametrize("tilt_deg", [0.0, 15.0, 50.0])
def test_poses_are_found_from_any_direction(tilt_deg: float, mirrored: tuple[bool, bool]) -> None:
    views = pair(tilt_deg, mirrored)
    for found, true in zip(placed(views, np.random.default_rng(1)).views, views, strict=True):
        assert np.abs(pose_error(found, true)).max() < 0.02
        assert found.mirrored == true.mirrored


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("azimuth_deg", [10, 100, 190, 280])
def test_the_right_one_of_the_planes_two_poses(back: bool, azimuth_deg: float) -> None:
    """Weak perspective: the layout is 16 mm wide, 150 mm away; the second pose explains it nearly as well."""
    view = looking("far", tilt_deg=30, azimuth_deg=azimuth_deg, distance_mm=150, focal_px=4000, back=back)
    found = placed((view,), np.random.default_rng(2)).views[0]
    assert np.degrees(np.linalg.norm(pose_error(found, view)[:3])) < 0.5


def test_poses_that_cannot_be_told_apart_are_refused() -> None:
    view = looking("far", tilt_deg=20, distance_mm=20000, focal_px=400000)
    with pytest.raises(PoseError, match=r"view 'far': two poses, \d+\.\d degrees apart, explain the markers"):
        placed((view,), np.random.default_rng(2), sigma_px=0.3)


def test_the_poses_covariance_is_calibrated() -> None:
    views, rng = pair(), np.random.default_rng(3)
    squares, misfits = [], []
    for _ in range(40):
        poses = placed(views, rng)
        error = np.concatenate([pose_error(f, t) for f, t in zip(poses.views, views, strict=True)])
        squares.append(error @ np.linalg.solve(poses.cov, error) / 12)
        misfits.append(poses.misfit)
    assert 0.85 < np.sqrt(np.mean(squares)) < 1.15  # 480 numbers: 3 %
    assert 0.97 < np.mean(misfits) < 1.03


def test_a_dome_at_rest_is_a_dome_when_views_are_placed_jointly() -> None:
    """Surfaces are not flat at rest: assuming so turns each view; placed jointly they agree on the dome."""
    layout, views, rng = reference(), pair(), np.random.default_rng(4)
    dome = flat(layout)
    dome[:, 2] = 0.3 - 0.004 * (layout.xy_mm**2).sum(axis=1)
    seen = [noisy(layout, view, dome, rng) for view in views]
    xy, cov = np.stack([m.xy_px for m in seen]), np.stack([m.cov_px2 for m in seen])
    rigid, joint = (
        estimate_poses(unplaced(views).views, layout.xy_mm, xy, cov, spread)
        for spread in (NONE, (0.001, 0.001, 0.2))
    )
    assert rigid.misfit > 3 and joint.misfit < 1.2
    apart = [np.linalg.norm(p.views[0].position_mm - p.views[1].position_mm) for p in (rigid, joint)]
    true = np.linalg.norm(views[0].position_mm - views[1].position_mm)
    assert abs(apart[1] - true) < 0.1 * abs(apart[0] - true)


def test_markers_that_lie_elsewhere_do_not_turn_the_pose() -> None:
    layout, views = reference(), pair()
    seen = [noisy(layout, view, flat(layout), np.random.default_rng(5)) for view in views]
    xy, cov = np.stack([m.xy_px for m in seen]), np.stack([m.cov_px2 for m in seen])
    xy[0, [3, 40]] += (4.0, -6.0)
    poses = estimate_poses(unplaced(views).views, layout.xy_mm, xy, cov, NONE)
    assert not poses.used[[3, 40]].any() and poses.used.sum() == len(layout.xy_mm) - 2
    assert np.abs(pose_error(poses.views[0], views[0])).max() < 0.005


def test_a_given_pose_is_kept_and_exact() -> None:
    left, right = pair()
    layout, rng = reference(), np.random.default_rng(6)
    seen = [noisy(layout, view, flat(layout), rng) for view in (left, right)]
    xy, cov = np.stack([m.xy_px for m in seen]), np.stack([m.cov_px2 for m in seen])
    poses = estimate_poses((left, unplaced((right,)).views[0]), layout.xy_mm, xy, cov, NONE)
    assert poses.views[0] is left and not poses.cov[:6].any() and poses.cov[6:, 6:].diagonal().all()


def test_too_few_markers_or_markers_on_a_line_are_refused() -> None:
    layout, (view, _) = reference(), pair()
    xy, cov = opencv_px(view, flat(layout))[None], np.tile(np.eye(2) * 1e-4, (1, len(layout.xy_mm), 1, 1))
    few, line = np.full_like(xy, np.nan), np.full_like(xy, np.nan)
    few[0, :5] = xy[0, :5]
    row = np.flatnonzero(abs(layout.xy_mm[:, 1]) < 1e-9)
    line[0, row] = xy[0, row]
    for seen, said in ((few, "5 markers at rest; a pose needs 6"), (line, "lie on a line")):
        with pytest.raises(PoseError, match=f"view 'left': .*{said}"):
            estimate_poses(unplaced((view,)).views, layout.xy_mm, seen, cov, NONE)


def test_a_wrong_mirror_puts_a_view_on_the_other_side_and_is_refused() -> None:
    left, right = pair(mirrored=(True, False))
    rig = unplaced((left, right)).views
    wrong = View(left.name, left.focal_px, left.centre_px, left.distortion, mirrored=False)
    layout = reference()
    xy = np.stack([opencv_px(view, flat(layout)) for view in (left, right)])
    cov = np.tile(np.eye(2) * 1e-4, (2, len(layout.xy_mm), 1, 1))
    assert estimate_poses(rig, layout.xy_mm, xy, cov, NONE).views[0].position_mm[2] < 0
    with pytest.raises(
        PoseError, match="view 'left' would look at the pattern's front, view 'right' at its back"
    ):
        estimate_poses((wrong, rig[1]), layout.xy_mm, xy, cov, NONE)
