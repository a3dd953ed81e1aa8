"""Where the views stand: their poses from the markers of the rest frame, whose places in the layout are known.

A plane seen in perspective has two poses that look nearly alike, mirror images of each other about the line of sight
(Schweighofer and Pinz 2006). Both are refined, the better one is kept, and where the image does not tell them apart
nothing is guessed. Refinement is Gauss-Newton on the likelihood of all views at once, with Levenberg's damping.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.errors import PoseError
from extractor.space.camera import Array, View, is_covariance, is_finite

MIN_MARKERS = 6
MAX_CONDITION = 1e4  # of the markers' scatter; markers on a line fix no pose
ITERATIONS = 30
CONVERGED = 1e-6  # of a standard deviation
OUTLIER_RATIO = 6.0  # times the usual misfit
MAX_OUTLIER_ROUNDS = 3
MIN_CHI2_GAP = 25.0  # by which chi^2 of the second pose must be larger, as 5 standard deviations are
MAX_RMS_EDGES = 0.2  # RMS residual at rest, in edges
RIDGE = 1e-12  # on correlations, so that each has an inverse
SAME_DEG = 0.5  # poses nearer than this are one


@dataclass(frozen=True, eq=False)
class Poses:
    """The views in their places.

    Attributes:
        views: with their poses.
        cov: (6 V, 6 V) float64: of each view's turn (rad) and shift (mm) along the camera's axes, see
            ``View.linearised``; 0 where the rig gave the pose. Multiplied by ``misfit`` squared where that exceeds 1.
        misfit: RMS of the residuals in standard deviations, over the degrees of freedom; NaN with none estimated.
        rms_px: (V,) RMS residual per axis.
        used: (M,) the markers that took part.
    """

    views: tuple[View, ...]
    cov: Array
    misfit: float
    rms_px: Array
    used: NDArray[np.bool_]


def estimate_poses(
    views: Sequence[View], xy_mm: Array, xy_px: Array, cov_px2: Array, spread_mm: tuple[float, float, float]
) -> Poses:
    """The poses of the views that have none, from markers at rest on the layout's plane.

    Args:
        views: those with a pose keep it.
        xy_mm: (M, 2) the markers in the layout.
        xy_px: (V, M, 2) where each view sees them, NaN where not.
        cov_px2: (V, M, 2, 2).
        spread_mm: standard deviations in x, y, z by which the markers at rest may lie off the layout. With 0, each
            view is placed by itself; else all are placed jointly, and what they agree on is the markers' own place.

    Raises:
        PoseError: too few markers, on a line, or two poses that the image does not tell apart.
    """
    flat = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
    xy_px = np.where(is_covariance(cov_px2)[..., None], xy_px, np.nan)
    started = [
        v if v.placed else _estimate_planar_pose(v, flat, xy_px[i], cov_px2[i]) for i, v in enumerate(views)
    ]
    free = np.array([not view.placed for view in views])
    weighted = np.where(is_finite(xy_px)[..., None, None], cov_px2, np.nan)
    used = np.asarray(is_finite(weighted, 2).any(axis=0))
    for _ in range(MAX_OUTLIER_ROUNDS):
        fit = _refine_poses(started, flat, np.where(used[:, None], xy_px, np.nan), weighted, spread_mm, free)
        started = fit.views
        typical = np.nanmedian(fit.misfit) if used.any() else np.nan
        with np.errstate(invalid="ignore"):
            outlier = fit.misfit > OUTLIER_RATIO * max(typical, 1.0)
        if not outlier.any():
            break
        used &= ~outlier
    _require_fit(views, fit, xy_mm, xy_px)
    rms = np.sqrt([np.nanmean(away**2) if np.isfinite(away).any() else np.nan for away in fit.residual_px])
    freedom = int(np.isfinite(fit.residual_px).sum()) - 6 * int(free.sum())
    misfit = float(np.sqrt(fit.chi2 / freedom)) if free.any() and freedom > 0 else float("nan")
    cov = fit.cov * max(1.0, misfit**2) if free.any() else fit.cov
    _require_one_side(started)
    return Poses(tuple(started), cov, misfit, rms, used)


def _estimate_planar_pose(view: View, flat: Array, xy_px: Array, cov_px2: Array) -> View:
    """The better of the plane's two poses in one view."""
    plain = view.normalised(xy_px)
    known = is_finite(xy_px) & is_finite(plain)
    where = f"view {view.name!r}: "
    if known.sum() < MIN_MARKERS:
        raise PoseError(f"{where}{int(known.sum())} markers at rest; a pose needs {MIN_MARKERS}")
    spread = flat[known, :2] - flat[known, :2].mean(axis=0)
    if np.linalg.cond(spread) > MAX_CONDITION:
        raise PoseError(f"{where}the markers at rest lie on a line; a pose needs a plane")
    seen = np.where(known[:, None], xy_px, np.nan)
    poses = _planar_pose_candidates(flat[known], plain[known], bool(view.mirrored))
    if not poses:
        raise PoseError(f"{where}the markers at rest fix no pose")
    fits = [
        _refine_poses([view.at(*pose)], flat, seen[None], cov_px2[None], (0.0, 0.0, 0.0), np.array([True]))
        for pose in poses
    ]
    fits.sort(key=lambda fit: fit.chi2)
    best, other = fits[0].views[0], fits[1].views[0]
    turn = best.R_camera_from_layout @ other.R_camera_from_layout.T
    apart_deg = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    freedom = 2 * int(known.sum()) - 6
    gap = (fits[1].chi2 - fits[0].chi2) / max(1.0, fits[0].chi2 / freedom)
    if apart_deg > SAME_DEG and not gap > MIN_CHI2_GAP:
        raise PoseError(
            f"{where}two poses, {apart_deg:.1f} degrees apart, explain the markers at rest equally well; "
            "give R_camera_from_layout and t_camera_from_layout_mm, or a view with more perspective"
        )
    return best


def _planar_pose_candidates(xyz: Array, plain: Array, mirrored: bool) -> list[tuple[Array, Array]]:
    """The pose that a homography implies, and its mirror image about the line of sight to the markers' middle.

    None where there is no homography.
    """
    flip = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0])
    homography, _ = cv2.findHomography(xyz[:, :2], plain * flip.diagonal()[:2])
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
    left, _, right = np.linalg.svd(np.column_stack([first, second, np.cross(first, second)]))
    return np.asarray(left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right)


@dataclass(frozen=True, eq=False)
class _PoseFit:
    """Refined views, their covariance, chi^2, (M,) misfit in standard deviations and (V, M, 2) residuals."""

    views: list[View]
    cov: Array
    chi2: float
    misfit: Array
    residual_px: Array


def _refine_poses(
    views: Sequence[View],
    flat: Array,
    xy_px: Array,
    cov_px2: Array,
    spread_mm: tuple[float, float, float],
    free: NDArray[np.bool_],
) -> _PoseFit:
    """The most likely poses of the free views; the markers' own places off the layout are summed out."""
    spread = np.diag(np.square(spread_mm))
    chosen = np.repeat(free, 6)
    now, damping = list(views), 1e-6
    system = _linearise_residuals(now, flat, xy_px, cov_px2, spread)
    for _ in range(ITERATIONS):
        away, by_pose, weight = system
        design = np.swapaxes(by_pose, 1, 2) @ weight
        normal = (design @ by_pose).sum(axis=0)[np.ix_(chosen, chosen)]
        gradient = (design @ away[..., None]).sum(axis=0)[chosen, 0]
        if not len(gradient):
            break
        scale = np.diag(normal.diagonal())
        step = np.zeros(len(chosen))
        step[chosen] = _solve_normal_equations(normal + damping * scale, gradient)
        tried = [_perturbed_view(view, step[6 * i : 6 * i + 6]) for i, view in enumerate(now)]
        system_there = _linearise_residuals(tried, flat, xy_px, cov_px2, spread)
        if _chi_square(system_there[0], weight) <= _chi_square(away, weight):
            now, system, damping = tried, system_there, damping / 10
        else:
            damping *= 10
        if gradient @ step[chosen] < CONVERGED**2 or damping > 1e8:
            break
    away, by_pose, weight = system
    normal = (np.swapaxes(by_pose, 1, 2) @ weight @ by_pose).sum(axis=0)
    cov = np.zeros_like(normal)
    if free.any():
        cov[np.ix_(chosen, chosen)] = _solve_normal_equations(
            normal[np.ix_(chosen, chosen)], np.eye(int(chosen.sum()))
        )
    squares = np.einsum("mi,mij,mj->m", away, weight, away)
    seen = is_finite(xy_px).sum(axis=0)
    misfit = np.sqrt(squares / np.where(seen > 0, 2.0 * seen, np.nan))
    residual = np.where(np.isfinite(xy_px), away.reshape(len(flat), -1, 2).swapaxes(0, 1), np.nan)
    return _PoseFit(now, cov, _chi_square(away, weight), misfit, residual)


def _solve_normal_equations(normal: Array, right: Array) -> Array:
    """Solution of a normal system in its own scale.

    Raises:
        PoseError: it has none, as where all markers are off the image's model.
    """
    squares = normal.diagonal()
    try:
        if not (squares > 0).all():
            raise np.linalg.LinAlgError
        scale = np.sqrt(squares)
        even = np.linalg.inv(normal / scale[:, None] / scale)
    except np.linalg.LinAlgError:
        raise PoseError("the markers at rest fix no pose") from None
    return np.asarray(even @ (right.T / scale).T / (scale if right.ndim == 1 else scale[:, None]))


def _chi_square(away: Array, weight: Array) -> float:
    return float(np.einsum("mi,mij,mj->", away, weight, away))


def _linearise_residuals(
    views: Sequence[View], flat: Array, xy_px: Array, cov_px2: Array, spread: Array
) -> tuple[Array, Array, Array]:
    """Residuals (M, 2 V), their derivatives (M, 2 V, 6 V) and weights (M, 2 V, 2 V); 0 where nothing is seen."""
    markers, count = len(flat), len(views)
    away = np.zeros((markers, count, 2))
    by_pose = np.zeros((markers, count, 2, count, 6))
    by_point = np.zeros((markers, count, 2, 3))
    noise = np.zeros((markers, count, 2, count, 2))
    for v, view in enumerate(views):
        there, point, pose = view.linearised(flat)
        seen = is_finite(xy_px[v])
        lost = seen & ~is_finite(there)
        away[seen, v] = (xy_px[v] - there)[seen]
        away[lost, v] = 1e6  # behind the camera: a step that goes there is refused
        seen &= ~lost
        by_pose[seen, v, :, v], by_point[seen, v] = pose[seen], point[seen]
        noise[:, v, :, v] = np.where(seen[:, None, None], cov_px2[v], np.eye(2))
    points = by_point.reshape(markers, 2 * count, 3)
    total = noise.reshape(markers, 2 * count, 2 * count) + points @ spread @ np.swapaxes(points, 1, 2)
    shape = (markers, 2 * count, 6 * count)
    root = np.sqrt(np.diagonal(total, axis1=1, axis2=2))
    root = root[:, :, None] * root[:, None, :]
    weight = np.linalg.inv(total / root + RIDGE * np.eye(2 * count)) / root
    return away.reshape(markers, -1), by_pose.reshape(shape), np.asarray(weight)


def _perturbed_view(view: View, step: Array) -> View:
    """The view after a small turn and shift; exactly orthonormal again."""
    if not step.any():
        return view
    turn, _ = cv2.Rodrigues(step[:3])
    left, _, right = np.linalg.svd(np.asarray(turn) @ view.R_camera_from_layout)
    return view.at(left @ right, view.t_camera_from_layout_mm + step[3:])


def _require_fit(views: Sequence[View], fit: _PoseFit, xy_mm: Array, xy_px: Array) -> None:
    """The markers at rest lie near where the layout puts them; a lens is a matter of pixels, not of edges."""
    step_mm = np.linalg.norm(xy_mm[:, None] - xy_mm[None], axis=2)
    nearest = np.where(step_mm > 0, step_mm, np.inf).argmin(axis=1)
    for view, away, px in zip(views, fit.residual_px, xy_px, strict=True):
        edge_px = np.linalg.norm(px - px[nearest], axis=1)
        if not np.isfinite(away).any() or not np.isfinite(edge_px).any():
            continue
        rms, limit = np.sqrt(np.nanmean(away**2)), MAX_RMS_EDGES * np.nanmedian(edge_px)
        if rms > limit:
            raise PoseError(
                f"view {view.name!r}: at rest the markers lie {rms:.1f} px off where the layout puts them, more than "
                f"{limit:.1f} px; check the layout, the rig's intrinsics and the rest frame"
            )


def _require_one_side(views: Sequence[View]) -> None:
    """All views look at the same side: a wrong ``mirrored`` puts a camera on the other one."""
    front = [view.name for view in views if view.position_mm[2] > 0]
    back = [view.name for view in views if view.position_mm[2] <= 0]
    if front and back:
        raise PoseError(
            f"{_view_list_text(front)} would look at the pattern's front, {_view_list_text(back)} at its back; "
            "check which of them are mirrored"
        )


def _view_list_text(names: Sequence[str]) -> str:
    return ("view " if len(names) == 1 else "views ") + ", ".join(repr(name) for name in names)
