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

from extractor._native import space as native
from extractor.space.camera import Array, View, is_covariance, is_finite

GATE_SIGMAS = 6.0  # misfit above which a point is not reported; chosen
TOLERANCE_PX = 0.1  # error beyond the covariance where gridlines bend more than extraction can follow; chosen


class Gate(NamedTuple):
    """What is not reported, see ``triangulate``."""

    max_sigma_mm: float
    sigmas: float
    tolerance_px: float


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
        cov_mm2: (N, 3, 3) float64, from the pixels' covariances alone, times ``inflation``.
        by_pose: (N, 3, 6 V) float64, derivatives by the views' poses.
        misfit: (N,) float64, the RMS residual in its standard deviations; NaN where unknown.
        inflation: (N,) float64, the square of a misfit above 3, else 1.
        reason: (N,) uint8, a ``PointReason`` each.
    """

    xyz_mm: Array
    cov_mm2: Array
    by_pose: Array
    misfit: Array
    inflation: Array
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
    """The points in space that V placed views see.

    Args:
        views: V views with poses.
        xy_px: (V, N, 2) float64, NaN where a view does not show a point.
        cov_px2: (V, N, 2, 2) float64.
        cov_pose: (6 V, 6 V) covariance of the poses, which widens the expected residuals; None: the poses are exact.
        max_sigma_mm: standard deviation in the worst direction, above which a point is ``PARALLEL``.
        gate_sigmas: misfit above which a point is ``DISAGREE``,
        tolerance_px: if the norm of its residuals over all views is also above this.

    Raises:
        ValueError: more than 8 views.
    """
    cov_pose = np.zeros((6 * len(views), 6 * len(views))) if cov_pose is None else cov_pose
    return native.triangulate(
        tuple(view.native for view in views),
        np.ascontiguousarray(xy_px),
        np.ascontiguousarray(cov_px2),
        np.ascontiguousarray(cov_pose),
        Gate(max_sigma_mm, gate_sigmas, tolerance_px),
    )


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
    if not deviating:
        return np.zeros((0, *xyz_mm.shape))
    seen = is_covariance(cov_px2)
    weight = np.where(
        seen[..., None, None], np.linalg.inv(np.where(seen[..., None, None], cov_px2, np.eye(2))), 0.0
    )
    linearised = [view.linearised(xyz_mm) for view in views]
    by_point = np.nan_to_num(np.stack([one.by_point for one in linearised]))
    design = np.swapaxes(by_point, 2, 3) @ weight
    inverse = np.nan_to_num(native.inverses((design @ by_point).sum(axis=0)), posinf=0.0)
    out = np.zeros((len(deviating), *xyz_mm.shape))
    for k, others in enumerate(deviating):
        shown = np.stack(
            [other.project(xyz_mm) - one.xy_px for other, one in zip(others, linearised, strict=True)]
        )
        pulled = (design @ np.nan_to_num(shown)[..., None]).sum(axis=0)
        out[k] = -(inverse @ pulled)[..., 0]
    out[:, ~is_finite(xyz_mm)] = np.nan
    return out
