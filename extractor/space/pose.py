"""The poses of the views, estimated from the markers of the rest frame, whose positions in the layout are known.

A plane in perspective has two poses with nearly the same image, mirror images of each other about the line of sight
(Schweighofer and Pinz 2006). Both are refined, and the better one is kept; where the image does not distinguish them,
an error is raised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.errors import PoseError
from extractor.space.camera import Array, View, is_covariance, is_finite
from extractor.space.medium import Medium
from extractor.space.pose_refinement import RefinedPoses, RestMarkers, refine_poses
from extractor.space.rest_check import RestViews, rest_warning

MIN_MARKERS = 6  # of a view, for a pose; chosen: six unknowns, twice as many equations
MAX_CONDITION = 1e4  # of the markers' scatter; collinear markers determine no pose. Chosen
OUTLIER_RATIO = 6.0  # misfit of an outlier relative to the median; chosen
MAX_OUTLIER_ROUNDS = 3  # of dropping such markers; chosen
MIN_CHI2_GAP = 25.0  # between the two poses of a plane; 5 standard deviations. Chosen
MAX_RMS_EDGES = 0.2  # RMS residual at rest, in edges; chosen
SAME_DEG = 0.5  # angle below which two poses are the same; chosen


@dataclass(frozen=True, eq=False)
class Poses:
    """V views with their poses.

    Attributes:
        views: the views.
        cov: (6 V, 6 V) float64, of each view's turn (rad) and shift (mm) along the camera's axes, see
            ``Linearisation``; 0 where the rig gave the pose. Multiplied by the square of a ``misfit`` above 1.
        misfit: RMS of the residuals in standard deviations, over the degrees of freedom; NaN with none estimated.
        rms_px: (V,) float64, RMS residual per axis.
        used: (M,) bool, the markers that were used.
        warning: likely cause of a contradiction between the markers at rest and the views; empty without a
            contradiction.
    """

    views: tuple[View, ...]
    cov: Array
    misfit: float
    rms_px: Array
    used: NDArray[np.bool_]
    warning: str = ""


def estimate_poses(
    views: Sequence[View], xy_mm: Array, xy_px: Array, cov_px2: Array, spread_mm: tuple[float, float, float]
) -> Poses:
    """The poses of the views without poses, from markers at rest on the layout's plane.

    Args:
        views: V views; given poses are kept.
        xy_mm: (M, 2) the markers in the layout.
        xy_px: (V, M, 2) the markers in each view, NaN where not seen.
        cov_px2: (V, M, 2, 2).
        spread_mm: standard deviations in x, y, z of the markers at rest around the layout. With 0, each view is
            placed separately; else all views are placed jointly, and deviations common to all views belong to the
            markers.

    Raises:
        PoseError: too few markers, collinear markers, or two poses that the image does not distinguish.
    """
    flat_mm = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
    for view in views:
        if view.placed and view.medium is not None and not view.is_ahead(flat_mm).all():
            raise PoseError(_no_room_text(view))
    xy_px = np.where(is_covariance(cov_px2)[..., None], xy_px, np.nan)
    placed = [
        v if v.placed else _estimate_planar_pose(v, flat_mm, xy_px[i], cov_px2[i])
        for i, v in enumerate(views)
    ]
    free = np.array([not view.placed for view in views])
    known_cov = np.where(is_finite(xy_px)[..., None, None], cov_px2, np.nan)
    spread_mm2 = np.diag(np.square(spread_mm))
    used = np.asarray(is_finite(known_cov, 2).any(axis=0))
    for _ in range(MAX_OUTLIER_ROUNDS):
        used_px = np.where(used[:, None], xy_px, np.nan)
        rest = RestMarkers(flat_mm, used_px, known_cov, spread_mm2)
        refined = refine_poses(placed, rest, free)
        placed = refined.views
        typical = np.nanmedian(refined.misfit) if used.any() else np.nan
        with np.errstate(invalid="ignore"):
            outlier = refined.misfit > OUTLIER_RATIO * max(typical, 1.0)
        if not outlier.any():
            break
        used &= ~outlier
    _require_small_residuals(views, refined, xy_mm, xy_px)
    rms = np.sqrt([np.nanmean(px**2) if np.isfinite(px).any() else np.nan for px in refined.residual_px])
    freedom = int(np.isfinite(refined.residual_px).sum()) - 6 * int(free.sum())
    misfit = float(np.sqrt(refined.chi2 / freedom)) if free.any() and freedom > 0 else float("nan")
    cov = refined.cov * max(1.0, misfit**2) if free.any() else refined.cov
    _require_one_side(placed)
    return Poses(tuple(placed), cov, misfit, rms, used, rest_warning(RestViews(placed, rest, free)))


def _estimate_planar_pose(view: View, flat_mm: Array, xy_px: Array, cov_px2: Array) -> View:
    """The view with the better of the plane's two poses."""
    normalised = view.normalised(xy_px)
    known = is_finite(xy_px) & is_finite(normalised)
    prefix = f"view {view.name!r}: "
    if known.sum() < MIN_MARKERS:
        raise PoseError(f"{prefix}{int(known.sum())} markers at rest; a pose needs {MIN_MARKERS}")
    scatter = flat_mm[known, :2] - flat_mm[known, :2].mean(axis=0)
    if np.linalg.cond(scatter) > MAX_CONDITION:
        raise PoseError(f"{prefix}the markers at rest lie on a line; a pose needs a plane")
    known_px = np.where(known[:, None], xy_px, np.nan)
    candidates = [
        _behind_medium(view, *pose)
        for pose in _planar_pose_candidates(flat_mm[known], normalised[known], bool(view.mirrored))
    ]
    if not candidates:
        raise PoseError(f"{prefix}the markers at rest fix no pose")
    if view.medium is not None:
        candidates = [pose for pose in candidates if view.at(*pose).is_ahead(flat_mm[known]).all()]
    if not candidates:
        raise PoseError(_no_room_text(view))
    rest = RestMarkers(flat_mm, known_px[None], cov_px2[None], np.zeros((3, 3)))
    refined = [refine_poses([view.at(*pose)], rest, np.array([True])) for pose in candidates]
    refined.sort(key=lambda one: one.chi2)
    if len(refined) == 1:
        return refined[0].views[0]
    best, other = refined[0].views[0], refined[1].views[0]
    turn = best.R_camera_from_layout @ other.R_camera_from_layout.T
    apart_deg = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    freedom = 2 * int(known.sum()) - 6
    gap = (refined[1].chi2 - refined[0].chi2) / max(1.0, refined[0].chi2 / freedom)
    if apart_deg > SAME_DEG and not gap > MIN_CHI2_GAP:
        raise PoseError(
            f"{prefix}two poses, {apart_deg:.1f} degrees apart, explain the markers at rest equally well; "
            "give R_camera_from_layout and t_camera_from_layout_mm, or a view with more perspective"
        )
    return best


def _behind_medium(view: View, rotation: Array, shift_mm: Array) -> tuple[Array, Array]:
    """The pose R, t of a pattern that appears at this pose through the view's window and gel, near their normal."""
    if view.medium is None:
        return rotation, shift_mm
    normal = rotation[:, 2] if rotation[:, 2] @ shift_mm > 0 else -rotation[:, 2]
    return rotation, shift_mm + view.medium.apparent_shift_mm * normal


def _no_room_text(view: View) -> str:
    medium = view.medium or Medium()
    return (
        f"view {view.name!r}: a gel of {medium.gel_mm:g} mm and a window of {medium.window_mm:g} mm do not fit between "
        "the camera and the pattern at rest; check [medium], the window's plane, the focal length and the pose"
    )


def _planar_pose_candidates(xyz: Array, normalised: Array, mirrored: bool) -> list[tuple[Array, Array]]:
    """The pose R, t that a homography implies, and its mirror image about the line of sight to the markers' middle.

    Empty where there is no homography.
    """
    flip = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0])
    homography, _ = cv2.findHomography(xyz[:, :2], normalised * flip.diagonal()[:2])
    if homography is None or not np.isfinite(homography).all():
        return []
    h = np.asarray(homography, np.float64)
    if not np.linalg.norm(h[:, :2], axis=0).all():
        return []
    h *= 2 / np.linalg.norm(h[:, :2], axis=0).sum()
    middle = xyz.mean(axis=0)
    if h[2] @ [middle[0], middle[1], 1.0] < 0:
        h = -h
    first = _nearest_rotation(h[:, 0], h[:, 1])
    centre = first @ middle + h[:, 2]
    sight = centre / np.linalg.norm(centre)
    columns = first[:, :2] - 2 * np.outer(sight, sight @ first[:, :2])
    second = _nearest_rotation(columns[:, 0], columns[:, 1])
    return [(flip @ rotation, flip @ (centre - rotation @ middle)) for rotation in (first, second)]


def _nearest_rotation(first: Array, second: Array) -> Array:
    """(3, 3) the rotation whose first two columns are nearest to these vectors (3,)."""
    left, _, right = np.linalg.svd(np.column_stack([first, second, np.cross(first, second)]))
    return np.asarray(left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right)


def _require_small_residuals(
    views: Sequence[View], refined: RefinedPoses, xy_mm: Array, xy_px: Array
) -> None:
    """Check that the residuals at rest are a fraction of an edge; errors of the lens are pixels, not edges."""
    distance_mm = np.linalg.norm(xy_mm[:, None] - xy_mm[None], axis=2)
    nearest = np.where(distance_mm > 0, distance_mm, np.inf).argmin(axis=1)
    for view, residual_px, px in zip(views, refined.residual_px, xy_px, strict=True):
        edge_px = np.linalg.norm(px - px[nearest], axis=1)
        if not np.isfinite(residual_px).any() or not np.isfinite(edge_px).any():
            continue
        rms, limit = np.sqrt(np.nanmean(residual_px**2)), MAX_RMS_EDGES * np.nanmedian(edge_px)
        if rms > limit:
            raise PoseError(
                f"view {view.name!r}: at rest the markers lie {rms:.1f} px off where the layout puts them, more than "
                f"{limit:.1f} px; check the layout, the rig's intrinsics and the rest frame"
            )


def _require_one_side(views: Sequence[View]) -> None:
    """Check that all views see the same side: a wrong ``mirrored`` puts a camera on the other side."""
    front = [view.name for view in views if view.position_mm[2] > 0]
    back = [view.name for view in views if view.position_mm[2] <= 0]
    if front and back:
        raise PoseError(
            f"{_view_list_text(front)} would see the pattern's front, {_view_list_text(back)} its back; "
            "check which views are mirrored"
        )


def _view_list_text(names: Sequence[str]) -> str:
    return ("view " if len(names) == 1 else "views ") + ", ".join(repr(name) for name in names)
