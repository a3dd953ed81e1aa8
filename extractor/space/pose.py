"""The poses of the views, estimated from the markers of the rest frame, whose positions in the layout are known.

A plane in perspective has two poses with nearly the same image, mirror images of each other about the line of sight
(Schweighofer and Pinz 2006). Both are refined, and the better one is kept; where the image does not distinguish them,
an error is raised. Refinement is Gauss-Newton on the likelihood of all views at once, with Levenberg's damping.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.errors import PoseError
from extractor.space.camera import Array, View, is_covariance, is_finite
from extractor.space.pose_refinement import RefinedPoses, RestMarkers, refine_poses

MIN_MARKERS = 6  # of a view, for a pose
MAX_CONDITION = 1e4  # of the markers' scatter; collinear markers determine no pose
ITERATIONS = 30
INITIAL_DAMPING, MAX_DAMPING = 1e-6, 1e8
CONVERGED = 1e-6  # last step, in standard deviations
OUTLIER_RATIO = 6.0  # misfit of an outlier relative to the median
MAX_OUTLIER_ROUNDS = 3
MIN_CHI2_GAP = 25.0  # between the two poses of a plane; 5 standard deviations
MAX_RMS_EDGES = 0.2  # RMS residual at rest, in edges
RIDGE = 1e-12  # added to the diagonal of correlation matrices before inversion
SAME_DEG = 0.5  # angle below which two poses are the same
LARGE_RESIDUAL_PX = 1e6  # residual of a marker behind the camera, so that a step there is refused


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
    """

    views: tuple[View, ...]
    cov: Array
    misfit: float
    rms_px: Array
    used: NDArray[np.bool_]


class RestMarkers(NamedTuple):
    """M markers at rest in V views.

    Attributes:
        flat_mm: (M, 3) float64, the markers in the layout's plane.
        xy_px: (V, M, 2) float64, NaN where a view does not show a marker.
        cov_px2: (V, M, 2, 2) float64.
        spread_mm2: (3, 3) float64, covariance of the markers at rest around the layout.
    """

    flat_mm: Array
    xy_px: Array
    cov_px2: Array
    spread_mm2: Array


class LinearSystem(NamedTuple):
    """The residuals of M markers in V views, linearised in the views' poses; 0 where a marker is not seen.

    Attributes:
        residual_px: (M, 2 V) float64, observed minus projected.
        by_pose: (M, 2 V, 6 V) float64, derivatives of the projections.
        weight: (M, 2 V, 2 V) float64, inverse covariances of the residuals.
    """

    residual_px: Array
    by_pose: Array
    weight: Array

    @property
    def chi2(self) -> float:
        """The sum of r^T W r over all markers."""
        return _chi_square(self.residual_px, self.weight)


def estimate_poses(
    views: Sequence[View], xy_mm: Array, xy_px: Array, cov_px2: Array, spread_mm: tuple[float, float, float]
) -> Poses:
    """The poses of the views that have none, from markers at rest on the layout's plane.

    Args:
        views: V views; those with a pose keep it.
        xy_mm: (M, 2) the markers in the layout.
        xy_px: (V, M, 2) the markers in each view, NaN where not seen.
        cov_px2: (V, M, 2, 2).
        spread_mm: standard deviations in x, y, z of the markers at rest around the layout. With 0, each view is
            placed by itself; else all views are placed jointly, and the deviation that they agree on is the markers'.

    Raises:
        PoseError: too few markers, collinear markers, or two poses that the image does not distinguish.
    """
    flat_mm = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
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
        refined = _refine_poses(placed, RestMarkers(flat_mm, used_px, known_cov, spread_mm2), free)
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
    return Poses(tuple(placed), cov, misfit, rms, used)


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
    candidates = _planar_pose_candidates(flat_mm[known], normalised[known], bool(view.mirrored))
    if not candidates:
        raise PoseError(f"{prefix}the markers at rest fix no pose")
    rest = RestMarkers(flat_mm, known_px[None], cov_px2[None], np.zeros((3, 3)))
    refined = [_refine_poses([view.at(*pose)], rest, np.array([True])) for pose in candidates]
    refined.sort(key=lambda one: one.chi2)
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
    center = first @ middle + h[:, 2]
    sight = center / np.linalg.norm(center)
    columns = first[:, :2] - 2 * np.outer(sight, sight @ first[:, :2])
    second = _nearest_rotation(columns[:, 0], columns[:, 1])
    return [(flip @ rotation, flip @ (center - rotation @ middle)) for rotation in (first, second)]


def _nearest_rotation(first: Array, second: Array) -> Array:
    """(3, 3) the rotation whose first two columns are nearest to these vectors (3,)."""
    left, _, right = np.linalg.svd(np.column_stack([first, second, np.cross(first, second)]))
    return np.asarray(left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right)


@dataclass(frozen=True, eq=False)
class RefinedPoses:
    """V refined views of M markers.

    Attributes:
        views: the views.
        cov: (6 V, 6 V) float64 covariance of the poses, 0 where a pose is fixed.
        chi2: sum of r^T W r over all markers.
        misfit: (M,) float64, RMS residual in standard deviations.
        residual_px: (V, M, 2) float64, NaN where not seen.
    """

    views: list[View]
    cov: Array
    chi2: float
    misfit: Array
    residual_px: Array


def _refine_poses(views: Sequence[View], rest: RestMarkers, free: NDArray[np.bool_]) -> RefinedPoses:
    """The most likely poses of the free views (V,) bool; the markers' own deviations are marginalised."""
    chosen = np.repeat(free, 6)
    current, damping = list(views), INITIAL_DAMPING
    system = _linearise_residuals(current, rest)
    for _ in range(ITERATIONS):
        design = np.swapaxes(system.by_pose, 1, 2) @ system.weight
        normal = (design @ system.by_pose).sum(axis=0)[np.ix_(chosen, chosen)]
        gradient = (design @ system.residual_px[..., None]).sum(axis=0)[chosen, 0]
        if not len(gradient):
            break
        scale = np.diag(normal.diagonal())
        step = np.zeros(len(chosen))
        step[chosen] = _solve_normal_equations(normal + damping * scale, gradient)
        tried = [_perturbed_view(view, step[6 * i : 6 * i + 6]) for i, view in enumerate(current)]
        tried_system = _linearise_residuals(tried, rest)
        if _chi_square(tried_system.residual_px, system.weight) <= system.chi2:
            current, system, damping = tried, tried_system, damping / 10
        else:
            damping *= 10
        if gradient @ step[chosen] < CONVERGED**2 or damping > MAX_DAMPING:
            break
    residual_px, by_pose, weight = system
    normal = (np.swapaxes(by_pose, 1, 2) @ weight @ by_pose).sum(axis=0)
    cov = np.zeros_like(normal)
    if free.any():
        cov[np.ix_(chosen, chosen)] = _solve_normal_equations(
            normal[np.ix_(chosen, chosen)], np.eye(int(chosen.sum()))
        )
    squares = np.einsum("mi,mij,mj->m", residual_px, weight, residual_px)
    seen = is_finite(rest.xy_px).sum(axis=0)
    misfit = np.sqrt(squares / np.where(seen > 0, 2.0 * seen, np.nan))
    by_view = residual_px.reshape(len(rest.flat_mm), -1, 2).swapaxes(0, 1)
    known_px = np.where(np.isfinite(rest.xy_px), by_view, np.nan)
    return RefinedPoses(current, cov, system.chi2, misfit, known_px)


def _solve_normal_equations(normal: Array, right: Array) -> Array:
    """The solution of a normal system, computed with a unit diagonal.

    Raises:
        PoseError: the system is singular, as where all markers lie outside the camera's model.
    """
    squares = normal.diagonal()
    try:
        if not (squares > 0).all():
            raise np.linalg.LinAlgError
        scale = np.sqrt(squares)
        inverse = np.linalg.inv(normal / scale[:, None] / scale)
    except np.linalg.LinAlgError:
        raise PoseError("the markers at rest fix no pose") from None
    return np.asarray(inverse @ (right.T / scale).T / (scale if right.ndim == 1 else scale[:, None]))


def _chi_square(residual_px: Array, weight: Array) -> float:
    """The sum of r^T W r over all markers, for residuals (M, 2 V) and weights (M, 2 V, 2 V)."""
    return float(np.einsum("mi,mij,mj->", residual_px, weight, residual_px))


def _linearise_residuals(views: Sequence[View], rest: RestMarkers) -> LinearSystem:
    """The residuals of the markers at rest in the views, linearised in the poses."""
    markers, count = len(rest.flat_mm), len(views)
    residual_px = np.zeros((markers, count, 2))
    by_pose = np.zeros((markers, count, 2, count, 6))
    by_point = np.zeros((markers, count, 2, 3))
    noise = np.zeros((markers, count, 2, count, 2))
    for v, view in enumerate(views):
        projected = view.linearised(rest.flat_mm)
        seen = is_finite(rest.xy_px[v])
        lost = seen & ~is_finite(projected.xy_px)
        residual_px[seen, v] = (rest.xy_px[v] - projected.xy_px)[seen]
        residual_px[lost, v] = LARGE_RESIDUAL_PX
        seen &= ~lost
        by_pose[seen, v, :, v], by_point[seen, v] = projected.by_pose[seen], projected.by_point[seen]
        noise[:, v, :, v] = np.where(seen[:, None, None], rest.cov_px2[v], np.eye(2))
    points = by_point.reshape(markers, 2 * count, 3)
    deviation_cov = points @ rest.spread_mm2 @ np.swapaxes(points, 1, 2)
    total = noise.reshape(markers, 2 * count, 2 * count) + deviation_cov
    root = np.sqrt(np.diagonal(total, axis1=1, axis2=2))
    scale = root[:, :, None] * root[:, None, :]
    weight = np.linalg.inv(total / scale + RIDGE * np.eye(2 * count)) / scale
    shape = (markers, 2 * count, 6 * count)
    return LinearSystem(residual_px.reshape(markers, -1), by_pose.reshape(shape), np.asarray(weight))


def _perturbed_view(view: View, step: Array) -> View:
    """The view after a small turn (rad) and shift (mm) in ``step`` (6,); its R is orthonormal."""
    if not step.any():
        return view
    turn, _ = cv2.Rodrigues(step[:3])
    left, _, right = np.linalg.svd(np.asarray(turn) @ view.R_camera_from_layout)
    return view.at(left @ right, view.t_camera_from_layout_mm + step[3:])


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
    """Check that all views look at the same side: a wrong ``mirrored`` puts a camera on the other side."""
    front = [view.name for view in views if view.position_mm[2] > 0]
    back = [view.name for view in views if view.position_mm[2] <= 0]
    if front and back:
        raise PoseError(
            f"{_view_list_text(front)} would look at the pattern's front, {_view_list_text(back)} at its back; "
            "check which of them are mirrored"
        )


def _view_list_text(names: Sequence[str]) -> str:
    return ("view " if len(names) == 1 else "views ") + ", ".join(repr(name) for name in names)
