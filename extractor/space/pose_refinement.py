"""Refinement of the poses of all views: Gauss-Newton on the likelihood of all markers, with Levenberg's damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.errors import PoseError
from extractor.space.camera import Array, View, is_finite

ITERATIONS = 30
INITIAL_DAMPING, MAX_DAMPING = 1e-6, 1e8
CONVERGED = 1e-6  # last step, in standard deviations
RIDGE = 1e-12  # added to the diagonal of correlation matrices before inversion
LARGE_RESIDUAL_PX = 1e6  # residual of a marker behind the camera, so that a step there is refused


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


def refine_poses(views: Sequence[View], rest: RestMarkers, free: NDArray[np.bool_]) -> RefinedPoses:
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
        tried = [
            view.turned(part) if part.any() else view
            for view, part in zip(current, step.reshape(-1, 6), strict=True)
        ]
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
