"""Poses from the rest frame: found, calibrated, mirrored, jointly, and refused where the image does not determine the
pose.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor import Markers, PoseError, Reconstructor, Rig, Status, View
from tests.support.view_scenes import flat, looking, noisy, pair, pressed, reference, unplaced

LAYOUT = reference()
NEARLY_NONE = 1e-9  # px of noise
Views = tuple[View, ...]


def rest(
    views: Views, seed: int, sigma_px: float = 0.02, xyz_mm: NDArray[np.float64] | None = None
) -> list[Markers]:
    rng, true = np.random.default_rng(seed), flat(LAYOUT) if xyz_mm is None else xyz_mm
    return [noisy(LAYOUT, view, true, rng, sigma_px) for view in views]


def placed(views: Views, seed: int, sigma_px: float = 0.02, **options: Any) -> Reconstructor:
    """A rig without poses, its views placed by their markers at rest."""
    return Reconstructor(LAYOUT, unplaced(views), rest(views, seed, sigma_px), **options)


def without(markers: Markers, gone: NDArray[np.bool_]) -> Markers:
    status = np.where(gone, np.uint8(Status.LOST), markers.status)
    return replace(markers, status=status, xy_px=np.where(gone[:, None], np.nan, markers.xy_px))


def pose_error(found: View, true: View) -> np.ndarray:
    """(6,) turn in rad and shift in mm from the true pose to the found one."""
    turn = found.R_camera_from_layout @ true.R_camera_from_layout.T
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return np.concatenate([vector, found.t_camera_from_layout_mm - true.t_camera_from_layout_mm])


@pytest.mark.parametrize("mirrored", [(False, False), (True, True), (True, False)])
@pytest.mark.parametrize("tilt_deg", [4.0, 15.0, 50.0])
def test_poses_are_found_from_any_direction(tilt_deg: float, mirrored: tuple[bool, bool]) -> None:
    views = pair(tilt_deg, mirrored)
    for found, true in zip(placed(views, 1).poses.views, views, strict=True):
        assert np.abs(pose_error(found, true)).max() < 0.02
        assert found.mirrored == true.mirrored


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("azimuth_deg", [10, 100, 190, 280])
def test_the_right_one_of_the_planes_two_poses(back: bool, azimuth_deg: float) -> None:
    """Weak perspective: the layout is 16 mm wide, 150 mm away; the second pose explains it nearly as well."""
    views = tuple(
        looking(name, tilt_deg=30, azimuth_deg=azimuth_deg + turn, distance_mm=150, focal_px=4000, back=back)
        for name, turn in (("far", 0), ("other", 180))
    )
    for found, true in zip(placed(views, 2).poses.views, views, strict=True):
        assert np.degrees(np.linalg.norm(pose_error(found, true)[:3])) < 0.5


def test_poses_that_cannot_be_told_apart_are_refused() -> None:
    views = (looking("far", tilt_deg=20, distance_mm=20000, focal_px=400000), pair()[1])
    with pytest.raises(PoseError, match=r"view 'far': two poses, \d+\.\d degrees apart, explain the markers"):
        placed(views, 2, sigma_px=0.3)


def test_the_poses_covariance_is_calibrated() -> None:
    views = pair()
    squares, misfits = [], []
    for seed in range(40):
        poses = placed(views, seed).poses
        error = np.concatenate([pose_error(f, t) for f, t in zip(poses.views, views, strict=True)])
        squares.append(error @ np.linalg.solve(poses.cov, error) / 12)
        misfits.append(poses.misfit)
    assert 0.85 < np.sqrt(np.mean(squares)) < 1.15  # 480 numbers: 3 %
    assert 0.97 < np.mean(misfits) < 1.03


def test_a_dome_at_rest_is_a_dome_when_views_are_placed_jointly() -> None:
    """Surfaces are not flat at rest: assuming so turns each view; placed jointly they agree on the dome."""
    views, dome = pair(), flat(LAYOUT)
    dome[:, 2] = 0.3 - 0.004 * (LAYOUT.xy_mm**2).sum(axis=1)
    seen = rest(views, 4, xyz_mm=dome)
    rigid, joint = (
        Reconstructor(LAYOUT, unplaced(views), seen, flatness_mm=flatness).poses
        for flatness in (0.0, (0.001, 0.001, 0.2))
    )
    assert rigid.misfit > 3 and joint.misfit < 1.2
    apart = [np.linalg.norm(p.views[0].position_mm - p.views[1].position_mm) for p in (rigid, joint)]
    true = np.linalg.norm(views[0].position_mm - views[1].position_mm)
    assert abs(apart[1] - true) < 0.1 * abs(apart[0] - true)


def test_markers_that_lie_elsewhere_do_not_turn_the_pose() -> None:
    views = pair()
    left, right = rest(views, 5)
    moved = left.xy_px.copy()
    moved[[3, 40]] += (4.0, -6.0)
    poses = Reconstructor(LAYOUT, unplaced(views), [replace(left, xy_px=moved), right]).poses
    assert not poses.used[[3, 40]].any() and poses.used.sum() == len(LAYOUT.xy_mm) - 2
    assert np.abs(pose_error(poses.views[0], views[0])).max() < 0.005


def test_a_given_pose_is_kept_and_exact() -> None:
    left, right = pair()
    poses = Reconstructor(LAYOUT, Rig((left, *unplaced((right,)).views)), rest((left, right), 6)).poses
    assert poses.views[0] is left and not poses.cov[:6].any() and poses.cov[6:, 6:].diagonal().all()


def test_too_few_markers_or_markers_on_a_line_are_refused() -> None:
    views = pair()
    left, right = rest(views, 7)
    off_line = abs(LAYOUT.xy_mm[:, 1]) > 1e-9
    for gone, said in (
        (np.arange(len(off_line)) >= 5, "5 markers at rest; a pose needs 6"),
        (off_line, "lie on a line"),
    ):
        with pytest.raises(PoseError, match=f"view 'left': .*{said}"):
            Reconstructor(LAYOUT, unplaced(views), [without(left, gone), right])


def test_a_wrong_mirror_puts_a_view_on_the_other_side_and_is_refused() -> None:
    left, right = views = pair(mirrored=(True, False))
    seen = rest(views, 8, NEARLY_NONE)
    rig = unplaced(views)
    assert Reconstructor(LAYOUT, rig, seen).poses.views[0].position_mm[2] < 0
    wrong = View(left.name, left.focal_px, left.centre_px, left.distortion, mirrored=False)
    with pytest.raises(PoseError, match="view 'left' would see the pattern's front, view 'right' its back"):
        Reconstructor(LAYOUT, Rig((wrong, rig.views[1])), seen)
    assert right.position_mm[2] < 0


def test_a_surface_that_was_pressed_at_rest_is_not_taken_for_the_layout() -> None:
    """A deformed layout has a large misfit."""
    views = pair()
    poses = Reconstructor(LAYOUT, unplaced(views), rest(views, 9, xyz_mm=pressed(LAYOUT.xy_mm, 0.3))).poses
    assert poses.misfit > 2
