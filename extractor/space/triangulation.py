"""Triangulation: the most likely points in space from their pictures in two or more views, with covariances.

The method is Gauss-Newton on the likelihood of the pixels, each weighted by its own covariance, started at the point
nearest to all rays. With two views one degree of freedom remains: the distance by which the two rays miss each other. A
point whose rays miss by more than its covariances and those of the poses allow is not reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.space.camera import Array, View, is_covariance, is_finite

ITERATIONS = 12
CONVERGED = 1e-5  # last step, in standard deviations
GATE_SIGMAS = 6.0  # misfit above which a point is not reported; chosen
TOLERANCE_PX = 0.1  # error beyond the covariance where gridlines bend more than extraction can follow; chosen
MIN_EIGENVALUE = 1e-13  # of an information matrix with a unit diagonal, for an inverse
INFLATION_SIGMAS = 3.0  # misfit above which a point's covariance is inflated; chosen
MIN_RAY_DIVERGENCE = 1e-14  # half the squared angle between two rays, below which they are parallel
LARGE_RESIDUAL_PX = 1e6  # residual of a point without a picture, so that a step there is refused
MIN_DAMPING = 1e-3  # after a refused step


class PointReason(IntEnum):
    """Why a point has no position in space."""

    NONE = 0  # the point has a position
    UNSEEN = 1  # no view shows the point
    ONE_VIEW = 2  # only one view shows the point, which then lies anywhere on a ray
    NO_RAY = 3  # a pixel where the lens' distortion has no inverse
    PARALLEL = 4  # the rays are too nearly parallel, or the pixels too uncertain, for depth
    DISAGREE = 5  # the rays miss each other by more than their covariances allow
    SURROUNDINGS = 6  # a virtual marker with a lost marker at an end of its edge


@dataclass(frozen=True, eq=False)
class Points:
    """N points in the layout frame, from V views.

    Attributes:
        xyz_mm: (N, 3) float64, NaN where unknown.
        cov_mm2: (N, 3, 3) float64, from the pixels' covariances alone; times the square of a misfit above 3.
        by_pose: (N, 3, 6 V) float64, derivatives by the views' poses.
        misfit: (N,) float64, the RMS residual in its standard deviations; NaN where unknown.
        reason: (N,) uint8, a ``PointReason`` each.
    """

    xyz_mm: Array
    cov_mm2: Array
    by_pose: Array
    misfit: Array
    reason: NDArray[np.uint8]


class Observations(NamedTuple):
    """The pixels of N points in V views.

    Attributes:
        views: V views with poses.
        xy_px: (V, N, 2) float64.
        cov_px2: (V, N, 2, 2) float64.
        seen: (V, N) bool; other pixels are ignored.
    """

    views: Sequence[View]
    xy_px: Array
    cov_px2: Array
    seen: NDArray[np.bool_]

    def of(self, points: NDArray[np.intp]) -> Observations:
        """The observations of these points."""
        return Observations(self.views, self.xy_px[:, points], self.cov_px2[:, points], self.seen[:, points])


class Residuals(NamedTuple):
    """Residuals of N points in V views and their derivatives; 0 where a point is not seen.

    Attributes:
        px: (V, N, 2) float64, observed minus projected.
        by_point: (V, N, 2, 3) float64, derivatives of the projection by the point, px/mm.
        by_pose: (V, N, 2, 6) float64, derivatives of the projection by the view's pose, see ``Linearisation``.
    """

    px: Array
    by_point: Array
    by_pose: Array


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
    """The points in space that V placed views see.

    Args:
        views: V views with poses.
        xy_px: (V, N, 2) float64, NaN where a view does not show a point.
        cov_px2: (V, N, 2, 2) float64.
        cov_pose: (6 V, 6 V) covariance of the poses, which widens the expected residuals; None: the poses are exact.
        max_sigma_mm: standard deviation in the worst direction, above which a point is ``PARALLEL``.
        gate_sigmas: misfit above which a point is ``DISAGREE``,
        tolerance_px: if the norm of its residuals over all views is also above this.
    """
    seen = is_finite(xy_px) & is_covariance(cov_px2)
    reason = np.where(seen.sum(axis=0) == 1, PointReason.ONE_VIEW, PointReason.NONE).astype(np.uint8)
    reason[~seen.any(axis=0)] = PointReason.UNSEEN
    start, has_ray = _intersect_rays(views, xy_px, seen)
    reason[(reason == PointReason.NONE) & (seen & ~has_ray).any(axis=0)] = PointReason.NO_RAY
    reason[(reason == PointReason.NONE) & ~is_finite(start)] = PointReason.PARALLEL
    solvable = np.flatnonzero(reason == PointReason.NONE)
    points = _unknown_points(len(reason), len(views), reason)
    if not len(solvable):
        return points
    observations = Observations(views, xy_px, cov_px2, seen).of(solvable)
    residual_px = _fill_solutions(observations, start[solvable], cov_pose, solvable, points)
    gate = np.where(residual_px > tolerance_px, gate_sigmas, np.inf)
    _update_rejecting_points(points, solvable, max_sigma_mm, gate)
    return points


def deviating_moves(
    views: Sequence[View], deviating: Sequence[Sequence[View]], xyz_mm: Array, cov_px2: Array
) -> Array:
    """(K, N, 3) mm by which points move where their pixels stay and the views are K others; linear in the difference.

    Args:
        views: V views with poses.
        deviating: K times V views with poses.
        xyz_mm: (N, 3) the points by ``views``; NaN stays NaN.
        cov_px2: (V, N, 2, 2) of their pixels; NaN where a view does not show a point.
    """
    seen = is_covariance(cov_px2)
    weight = np.where(
        seen[..., None, None], np.linalg.inv(np.where(seen[..., None, None], cov_px2, np.eye(2))), 0.0
    )
    linearised = [view.linearised(xyz_mm) for view in views]
    by_point = np.nan_to_num(np.stack([one.by_point for one in linearised]))
    design = np.swapaxes(by_point, 2, 3) @ weight
    inverse = np.nan_to_num(_scaled_inverse((design @ by_point).sum(axis=0)), posinf=0.0)
    out = np.zeros((len(deviating), *xyz_mm.shape))
    for k, others in enumerate(deviating):
        shown = np.stack(
            [other.project(xyz_mm) - one.xy_px for other, one in zip(others, linearised, strict=True)]
        )
        pulled = (design @ np.nan_to_num(shown)[..., None]).sum(axis=0)
        out[k] = -(inverse @ pulled)[..., 0]
    out[:, ~is_finite(xyz_mm)] = np.nan
    return out


def _unknown_points(count: int, views: int, reason: NDArray[np.uint8]) -> Points:
    unknown = np.full((count, 3, 6 * views), np.nan)
    return Points(unknown[:, :, 0].copy(), unknown[:, :, :3].copy(), unknown, unknown[:, 0, 0].copy(), reason)


def _intersect_rays(
    views: Sequence[View], xy_px: Array, seen: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """(N, 3) the points nearest to all rays, NaN where these are parallel; (V, N) bool, which pixels have rays.

    Where the rays meet behind a camera or before its window, the point is that of its ray on the layout's plane.
    """
    normal, right = np.zeros((xy_px.shape[1], 3, 3)), np.zeros((xy_px.shape[1], 3))
    has_ray = np.zeros(seen.shape, np.bool_)
    on_plane = np.full((len(views), xy_px.shape[1], 3), np.nan)
    for v, view in enumerate(views):
        origin, ray = view.rays(xy_px[v])
        has_ray[v] = is_finite(ray) & seen[v]
        across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
        across[~has_ray[v]] = 0.0
        normal += across
        right += (across @ np.where(has_ray[v, :, None], origin, 0.0)[:, :, None])[:, :, 0]
        on_plane[v] = np.where(has_ray[v, :, None], origin - ray * (origin[:, 2:] / ray[:, 2:]), np.nan)
    regular = np.linalg.eigvalsh(normal)[:, 0] > MIN_RAY_DIVERGENCE
    xyz = np.full(right.shape, np.nan)
    xyz[regular] = np.linalg.solve(normal[regular], right[regular, :, None])[:, :, 0]
    for v, view in enumerate(views):
        behind = has_ray[v] & regular & ~view.is_ahead(xyz)
        xyz[behind] = on_plane[v, behind]
    return xyz, has_ray


def _fill_solutions(
    observations: Observations,
    start: Array,
    cov_pose: Array | None,
    solvable: NDArray[np.intp],
    points: Points,
) -> Array:
    """Fill ``points`` at the indices ``solvable``; every point takes its own damped Gauss-Newton steps.

    Args:
        observations: of the N solvable points.
        start: (N, 3) mm.

    Returns:
        (N,) the norm of the residuals over all views, px.
    """
    seen = observations.seen
    noise = np.where(seen[..., None, None], observations.cov_px2, np.eye(2))
    weight = np.where(seen[..., None, None], np.linalg.inv(noise), 0.0)
    xyz, damping = start.copy(), np.zeros(len(start))
    now = _residuals(observations, xyz)
    for _ in range(ITERATIONS):
        design = np.swapaxes(now.by_point, 2, 3) @ weight
        normal = (design @ now.by_point).sum(axis=0)
        gradient = (design @ now.px[..., None]).sum(axis=0)[..., 0]
        step = _solve_scaled(normal * (1 + damping[:, None, None] * np.eye(3)), gradient)
        tried = _residuals(observations, xyz + step)
        better = _chi_square(tried.px, weight) <= _chi_square(now.px, weight) * (1 + 1e-12)
        xyz[better] += step[better]
        for old, new in zip(now, tried, strict=True):
            old[:, better] = new[:, better]
        damping = np.where(better, damping / 10, np.maximum(10 * damping, MIN_DAMPING))
        if not (np.einsum("na,na->n", step, gradient) > CONVERGED**2).any():
            break
    design = np.swapaxes(now.by_point, 2, 3) @ weight
    cov = _scaled_inverse((design @ now.by_point).sum(axis=0))
    points.xyz_mm[solvable], points.cov_mm2[solvable] = xyz, cov
    bounded = np.where(np.isfinite(cov), cov, 0.0)  # points with infinite variances are rejected later
    point_by_pose = -bounded @ (design @ now.by_pose)
    by_pose = np.moveaxis(point_by_pose, 0, 2).reshape(len(solvable), 3, -1)
    points.by_pose[solvable] = by_pose
    points.misfit[solvable] = _misfit(now, weight, seen, points.by_pose[solvable], cov_pose)
    return np.asarray(np.sqrt((now.px**2).sum(axis=(0, 2))))


def _residuals(observations: Observations, xyz: Array) -> Residuals:
    """The residuals of points (N, 3) mm."""
    linearised = [view.linearised(xyz) for view in observations.views]
    px = np.stack([seen_px - one.xy_px for seen_px, one in zip(observations.xy_px, linearised, strict=True)])
    by_point = np.stack([one.by_point for one in linearised])
    by_pose = np.stack([one.by_pose for one in linearised])
    invisible = observations.seen & ~is_finite(px)
    px[invisible] = LARGE_RESIDUAL_PX
    by_point[invisible], by_pose[invisible] = 0.0, 0.0
    for values in (px, by_point, by_pose):
        values[~observations.seen] = 0.0
    return Residuals(px, by_point, by_pose)


def _chi_square(residual_px: Array, weight: Array) -> Array:
    """(N,) the sum over all views of r^T W r, for residuals (V, N, 2) and weights (V, N, 2, 2)."""
    return np.asarray((residual_px[:, :, None] @ weight @ residual_px[..., None]).sum(axis=0)[:, 0, 0])


def _solve_scaled(normal: Array, gradient: Array) -> Array:
    """(N, 3) solutions of 3 x 3 systems in their own scale; 0 where singular."""
    inverse = np.nan_to_num(_scaled_inverse(normal), posinf=0, neginf=0)
    return np.asarray((inverse @ gradient[..., None])[..., 0])


def _scaled_inverse(normal: Array) -> Array:
    """(N, 3, 3) inverses of symmetric matrices in their own scale; infinite variances where singular."""
    inverse = np.tile(np.diag(np.full(3, np.inf)), (len(normal), 1, 1))
    diagonal = np.diagonal(normal, axis1=1, axis2=2)
    positive = is_finite(normal, 2) & (diagonal > 0).all(axis=1)
    root = np.sqrt(diagonal[positive])
    scale = root[:, :, None] * root[:, None, :]
    correlation = normal[positive] / scale
    regular = np.linalg.eigvalsh(correlation)[:, 0] > MIN_EIGENVALUE
    inverse[np.flatnonzero(positive)[regular]] = np.linalg.inv(correlation[regular]) / scale[regular]
    return inverse


def _misfit(
    residuals: Residuals,
    weight: Array,
    seen: NDArray[np.bool_],
    point_by_pose: Array,
    cov_pose: Array | None,
) -> Array:
    """(N,) the RMS residual in units of the deviation that follows from pixels and poses.

    Args:
        weight: (V, N, 2, 2), inverse covariances of the pixels.
        point_by_pose: (N, 3, 6 V), derivatives of the points by the poses.
    """
    freedom = 2.0 * seen.sum(axis=0) - 3
    if cov_pose is not None and cov_pose.any():
        by_pose = residuals.by_point @ point_by_pose
        for v in range(len(seen)):
            by_pose[v, :, :, 6 * v : 6 * v + 6] += residuals.by_pose[v]
        pose_cov = by_pose @ cov_pose @ np.swapaxes(by_pose, 2, 3)
        freedom = freedom + np.einsum("vnij,vnji->n", weight, pose_cov)
    return np.asarray(np.sqrt(_chi_square(residuals.px, weight) / freedom))


def _update_rejecting_points(
    points: Points, solved: NDArray[np.intp], max_sigma_mm: float, gate: Array
) -> None:
    """Inflate covariances where the misfit is large, and reject points that are too uncertain or beyond the gate."""
    inflated = solved[points.misfit[solved] > INFLATION_SIGMAS]
    points.cov_mm2[inflated] *= points.misfit[inflated, None, None] ** 2
    cov = points.cov_mm2[solved]
    worst = np.full(len(solved), np.inf)
    finite = is_finite(cov, 2)
    worst[finite] = np.sqrt(np.maximum(np.linalg.eigvalsh(cov[finite])[:, -1], 0))
    for rejected, reason in (
        (~(worst <= max_sigma_mm) | ~np.isfinite(worst), PointReason.PARALLEL),
        (points.misfit[solved] > gate, PointReason.DISAGREE),
    ):
        first = rejected & (points.reason[solved] == PointReason.NONE)
        points.reason[solved[first]] = reason
    lost = points.reason != PointReason.NONE
    points.xyz_mm[lost], points.cov_mm2[lost], points.by_pose[lost] = np.nan, np.nan, np.nan
