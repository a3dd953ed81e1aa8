"""Points in space from their pictures in two or more views: the most likely place, and how far it may be trusted.

Gauss-Newton on the likelihood of the pixels, each weighted by its own covariance, started where the rays come nearest
to each other. With two views one degree of freedom is left over: how far the two rays miss each other. A point whose
rays miss by more than its covariances and the poses' allow is not one point, and is not reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from extractor.space.camera import Array, View, is_covariance, is_finite

ITERATIONS = 12
CONVERGED = 1e-5  # of a standard deviation
GATE_SIGMAS = 6.0
TOLERANCE_PX = (
    0.1  # gridlines that bend more than extraction can follow err by so much beyond their covariance
)
MIN_EIGENVALUE = (
    1e-13  # smallest eigenvalue of information with a unit diagonal, below which it has no inverse
)
INFLATION_SIGMAS = 3.0  # misfit that chance hardly makes: such a point's covariance grows with it
MIN_RAY_DIVERGENCE = 1e-14  # half the squared angle between two rays, below which they are one


class PointReason(IntEnum):
    """Why a point has no place in space."""

    NONE = 0  # it has one
    UNSEEN = 1  # no view shows it
    ONE_VIEW = 2  # one view alone does: it lies somewhere on a ray
    NO_RAY = 3  # a pixel where the lens' distortion has no inverse
    PARALLEL = 4  # rays too nearly parallel, or pixels too uncertain, to tell its depth
    DISAGREE = 5  # the rays miss each other by more than their covariances allow
    SURROUNDINGS = 6  # a virtual marker, and an end of its edge is lost


@dataclass(frozen=True, eq=False)
class Points:
    """Points in the layout frame, by index.

    Attributes:
        xyz_mm: (N, 3) float64, NaN where there is none.
        cov_mm2: (N, 3, 3) float64, from the pixels' covariances alone; times the square of a misfit above 3.
        by_pose: (N, 3, 6 V) float64: how they move with errors of the views' poses.
        misfit: (N,) float64: the residual left over, in standard deviations of its own; NaN where nothing is.
        reason: (N,) uint8, a ``PointReason`` each.
    """

    xyz_mm: Array
    cov_mm2: Array
    by_pose: Array
    misfit: Array
    reason: NDArray[np.uint8]


def triangulate(
    views: Sequence[View],
    xy_px: Array,
    cov_px2: Array,
    *,
    cov_pose: Array | None = None,
    max_sigma_mm: float = np.inf,
    gate_sigmas: float = GATE_SIGMAS,
    tolerance_px: float = TOLERANCE_PX,
) -> Points:
    """Where points lie that V placed views see.

    Args:
        views: with poses.
        xy_px: (V, N, 2) float64, NaN where a view does not show a point.
        cov_px2: (V, N, 2, 2) float64.
        cov_pose: (6 V, 6 V) of the poses' errors, which widen what residuals may be; None: the poses are exact.
        max_sigma_mm: standard deviation along its worst direction above which a point is ``PARALLEL``.
        gate_sigmas: misfit above which a point is ``DISAGREE``,
        tolerance_px: if its residuals' norm over all views also is above this.
    """
    seen = is_finite(xy_px) & is_covariance(cov_px2)
    reason = np.where(seen.sum(axis=0) == 1, PointReason.ONE_VIEW, PointReason.NONE).astype(np.uint8)
    reason[~seen.any(axis=0)] = PointReason.UNSEEN
    start, ray = _intersect_rays(views, xy_px, seen)
    reason[(reason == PointReason.NONE) & (seen & ~ray).any(axis=0)] = PointReason.NO_RAY
    reason[(reason == PointReason.NONE) & ~is_finite(start)] = PointReason.PARALLEL
    use = np.flatnonzero(reason == PointReason.NONE)
    out = _empty_points(len(reason), len(views), reason)
    if not len(use):
        return out
    miss_px = _fill_solution(
        views, xy_px[:, use], cov_px2[:, use], seen[:, use], start[use], cov_pose, use, out
    )
    gate = np.where(miss_px > tolerance_px, gate_sigmas, np.inf)
    _update_rejecting_points(out, use, max_sigma_mm, gate)
    return out


def _empty_points(count: int, views: int, reason: NDArray[np.uint8]) -> Points:
    unknown = np.full((count, 3, 6 * views), np.nan)
    return Points(unknown[:, :, 0].copy(), unknown[:, :, :3].copy(), unknown, unknown[:, 0, 0].copy(), reason)


def _intersect_rays(
    views: Sequence[View], xy_px: Array, seen: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """(N, 3) the points nearest to all rays, NaN where these are parallel; (V, N) which pixels have rays."""
    normal, right = np.zeros((xy_px.shape[1], 3, 3)), np.zeros((xy_px.shape[1], 3))
    have = np.zeros(seen.shape, np.bool_)
    on_plane = np.full((len(views), xy_px.shape[1], 3), np.nan)
    for v, view in enumerate(views):
        ray, origin = view.rays(xy_px[v]), view.position_mm
        have[v] = is_finite(ray) & seen[v]
        across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
        across[~have[v]] = 0.0
        normal += across
        right += across @ origin
        on_plane[v] = np.where(have[v, :, None], origin - ray * (origin[2] / ray[:, 2:]), np.nan)
    sound = np.linalg.eigvalsh(normal)[:, 0] > MIN_RAY_DIVERGENCE
    out = np.full(right.shape, np.nan)
    out[sound] = np.linalg.solve(normal[sound], right[sound, :, None])[:, :, 0]
    for v, view in enumerate(
        views
    ):  # rays that meet behind a camera: their points on the layout's plane do not
        behind = have[v] & (out @ view.R_camera_from_layout[2] + view.t_camera_from_layout_mm[2] <= 0)
        out[behind] = on_plane[v, behind]
    return out, have


def _fill_solution(
    views: Sequence[View],
    xy_px: Array,
    cov_px2: Array,
    seen: NDArray[np.bool_],
    start: Array,
    cov_pose: Array | None,
    use: NDArray[np.intp],
    out: Points,
) -> Array:
    """Fill ``out`` at ``weight``: all points step together, each by its own damped Gauss-Newton step.

    Returns:
        (N,) the norm of the residuals over all views, px.
    """
    noise = np.where(seen[..., None, None], cov_px2, np.eye(2))
    weight = np.where(seen[..., None, None], np.linalg.inv(noise), 0.0)
    xyz, damping = start.copy(), np.zeros(len(start))
    away, by_point, by_pose = _residuals(views, xyz, xy_px, seen)
    for _ in range(ITERATIONS):
        design = np.swapaxes(by_point, 2, 3) @ weight
        normal = (design @ by_point).sum(axis=0)
        gradient = (design @ away[..., None]).sum(axis=0)[..., 0]
        step = _solve_scaled(normal * (1 + damping[:, None, None] * np.eye(3)), gradient)
        there = _residuals(views, xyz + step, xy_px, seen)
        better = _chi_square(there[0], weight) <= _chi_square(away, weight) * (1 + 1e-12)
        xyz[better] += step[better]
        for old, new in zip((away, by_point, by_pose), there, strict=True):
            old[:, better] = new[:, better]
        damping = np.where(better, damping / 10, np.maximum(10 * damping, 1e-3))
        if not (np.einsum("na,na->n", step, gradient) > CONVERGED**2).any():
            break
    design = np.swapaxes(by_point, 2, 3) @ weight
    out.xyz_mm[use], out.cov_mm2[use] = xyz, _scaled_inverse((design @ by_point).sum(axis=0))
    bounded = np.where(np.isfinite(out.cov_mm2[use]), out.cov_mm2[use], 0.0)  # what is not is refused below
    toward = -bounded @ (design @ by_pose)
    out.by_pose[use] = np.moveaxis(toward, 0, 2).reshape(len(use), 3, -1)
    out.misfit[use] = _misfit(away, by_point, by_pose, weight, seen, out.by_pose[use], cov_pose)
    return np.asarray(np.sqrt((away**2).sum(axis=(0, 2))))


def _residuals(
    views: Sequence[View], xyz: Array, xy_px: Array, seen: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """(V, N, 2) px, and their derivatives by point (V, N, 2, 3) and pose (V, N, 2, 6); 0 where not seen."""
    linearised = [view.linearised(xyz) for view in views]
    away = np.stack([xy_px[v] - part[0] for v, part in enumerate(linearised)])
    by_point, by_pose = (np.stack([part[k] for part in linearised]) for k in (1, 2))
    nowhere = seen & ~is_finite(away)
    away[nowhere] = 1e6  # a step to where there is no picture is refused
    by_point[nowhere], by_pose[nowhere] = 0.0, 0.0
    for values in (away, by_point, by_pose):
        values[~seen] = 0.0
    return away, by_point, by_pose


def _chi_square(away: Array, weight: Array) -> Array:
    return np.asarray((away[:, :, None] @ weight @ away[..., None]).sum(axis=0)[:, 0, 0])


def _solve_scaled(normal: Array, gradient: Array) -> Array:
    """Solutions of 3 x 3 systems in their own scale; 0 where singular."""
    inverse = np.nan_to_num(_scaled_inverse(normal), posinf=0, neginf=0)
    return np.asarray((inverse @ gradient[..., None])[..., 0])


def _scaled_inverse(normal: Array) -> Array:
    """Inverses of 3 x 3 matrices, in their own scale; infinite variances where singular."""
    out = np.tile(np.diag(np.full(3, np.inf)), (len(normal), 1, 1))
    scale = np.diagonal(normal, axis1=1, axis2=2)
    sound = is_finite(normal, 2) & (scale > 0).all(axis=1)
    root = np.sqrt(scale[sound])
    root = root[:, :, None] * root[:, None, :]
    even = normal[sound] / root
    good = np.linalg.eigvalsh(even)[:, 0] > MIN_EIGENVALUE
    out[np.flatnonzero(sound)[good]] = np.linalg.inv(even[good]) / root[good]
    return out


def _misfit(
    away: Array,
    by_point: Array,
    by_pose: Array,
    weight: Array,
    seen: NDArray[np.bool_],
    point_by_pose: Array,
    cov_pose: Array | None,
) -> Array:
    """(N,) RMS of what is left over, in the deviations that pixels and poses allow."""
    freedom = 2.0 * seen.sum(axis=0) - 3
    if cov_pose is not None and cov_pose.any():
        moved = by_point @ point_by_pose
        for v in range(len(seen)):
            moved[v, :, :, 6 * v : 6 * v + 6] += by_pose[v]
        spread = moved @ cov_pose @ np.swapaxes(moved, 2, 3)
        freedom = freedom + np.einsum("vnij,vnji->n", weight, spread)
    return np.asarray(np.sqrt(_chi_square(away, weight) / freedom))


def _update_rejecting_points(out: Points, use: NDArray[np.intp], max_sigma_mm: float, gate: Array) -> None:
    """Widen the covariance of what is doubtful, take back what cannot be believed."""
    doubtful = use[out.misfit[use] > INFLATION_SIGMAS]
    out.cov_mm2[doubtful] *= out.misfit[doubtful, None, None] ** 2
    cov = out.cov_mm2[use]
    worst = np.full(len(use), np.inf)
    sound = is_finite(cov, 2)
    worst[sound] = np.sqrt(np.maximum(np.linalg.eigvalsh(cov[sound])[:, -1], 0))
    for doubt, reason in (
        (~(worst <= max_sigma_mm) | ~np.isfinite(worst), PointReason.PARALLEL),
        (out.misfit[use] > gate, PointReason.DISAGREE),
    ):
        hit = doubt & (out.reason[use] == PointReason.NONE)
        out.reason[use[hit]] = reason
    lost = out.reason != PointReason.NONE
    out.xyz_mm[lost], out.cov_mm2[lost], out.by_pose[lost] = np.nan, np.nan, np.nan
