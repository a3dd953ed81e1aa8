"""Whether the markers at rest lie at the places by the poses, and if not, the likely cause.

Every cause is a model with more parameters: another gel, another lens, other poses, markers that have moved. The likely
cause has the smallest final prediction error (Akaike 1969), chi^2 / (N - K) (1 + K / N) with N numbers and K
parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.errors import PoseError
from extractor.space.camera import Array, View, is_finite
from extractor.space.medium import Medium, WindowPlane
from extractor.space.pose_refinement import RefinedPoses, RestMarkers, refine_poses

# RMS residual at rest in its deviations, above which the model of the sensor is doubted; chosen
MAX_MISFIT = 3.0
EXPLAINED = 0.5  # share of the misfit that the likely cause may leave; chosen
USUAL_GEL_INDEX, USUAL_WINDOW_INDEX = 1.41, 1.49  # silicone and acrylic, where the rig has none
GEL_TOLERANCE_MM = 0.01
STEPS = {"window_mm": 0.1, "gel_index": 0.01, "window_index": 0.01}
TILT_STEP = 0.01  # rad
GOLDEN = 0.5 * (5**0.5 - 1)
LENS_STEP_PX, DISTORTION_STEP = 0.5, 1e-3
ANYWHERE_MM2 = np.eye(3)  # covariance of markers that have moved

NO_MEDIUM = "the camera looks through a gel or a window, and the rig has no [medium]"
OTHER_MEDIUM = "the gel or the window is not as in [medium] (thickness, index or tilt)"
OTHER_LENS = "the lens is not as in the rig (focal_px, centre_px, distortion)"
OTHER_POSES = "the rig's poses are not those of this frame; place the views by the rest frame (from_rest)"
MOVED = "the pattern was touched or not flat; take a frame without contact, or state a dome's height (flatness_mm)"
UNKNOWN = "none that is known; check the layout, the rig and the rest frame"


class RestViews(NamedTuple):
    """V views with poses, and the markers at rest.

    Attributes:
        views: the views.
        rest: the markers that were used for the poses.
        free: (V,) bool, the views whose poses were estimated.
    """

    views: Sequence[View]
    rest: RestMarkers
    free: NDArray[np.bool_]


def rest_warning(found: RestViews) -> str:
    """A warning that names the misfit of the markers at rest and its likely cause; empty where they fit."""
    fitted = refine_poses(found.views, found.rest, np.zeros(len(found.views), np.bool_))
    count, poses = 2 * int(is_finite(found.rest.xy_px).sum()), 6 * int(found.free.sum())
    misfit = np.sqrt(_prediction_error(fitted.chi2, count, poses))
    if not misfit > MAX_MISFIT:
        return ""
    errors = dict(_causes(found, fitted.residual_px))
    likely = min(errors, key=lambda cause: errors[cause])
    if errors[likely] > (EXPLAINED * misfit) ** 2:
        likely = UNKNOWN
    return (
        f"the markers at rest lie {np.sqrt(np.nanmean(fitted.residual_px**2)):.2f} px from their places, {misfit:.0f} "
        f"times their deviations; depths have larger errors than stated; likely cause: {likely}"
    )


def _causes(found: RestViews, residual_px: Array) -> Iterator[tuple[str, float]]:
    """Every cause with its prediction error."""
    views, rest, free = found.views, found.rest, found.free
    missing = all(view.medium is None for view in views)
    yield NO_MEDIUM if missing else OTHER_MEDIUM, _medium_error(found)
    lens = [column for v in range(len(views)) for column in _lens_columns(found, v)]
    yield OTHER_LENS, _explained_error(found, residual_px, lens)
    if not free.all():
        yield OTHER_POSES, _explained_error(found._replace(free=~np.zeros_like(free)), residual_px, [])
    moved = refine_poses(views, rest._replace(spread_mm2=ANYWHERE_MM2), free)
    count, markers = 2 * int(is_finite(rest.xy_px).sum()), int(is_finite(rest.xy_px).any(axis=0).sum())
    yield MOVED, _prediction_error(moved.chi2, count, 3 * markers)


def _medium_error(found: RestViews) -> float:
    """The prediction error with the likeliest thickness of the gel, and all else of the medium linearised."""
    views, rest, free = found.views, found.rest, found.free
    room_mm = min(abs(float(view.position_mm[2])) for view in views)

    def refined(gel_mm: float) -> RefinedPoses | None:
        changed = [replace(view, medium=replace(_whole_medium(view), gel_mm=gel_mm)) for view in views]
        try:
            return refine_poses(changed, rest, free)
        except PoseError:  # this gel does not fit
            return None

    def chi2(gel_mm: float) -> float:
        tried = refined(gel_mm)
        return tried.chi2 if tried is not None else float("inf")

    likely = refined(_least_place(chi2, 0.0, 0.5 * room_mm, GEL_TOLERANCE_MM))
    if likely is None:
        return float("inf")
    columns = list(_medium_columns(likely.views, rest.flat_mm))
    return _explained_error(found._replace(views=likely.views), likely.residual_px, columns)


def _least_place(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """The place of the least value of a function with one minimum, by golden sections (Kiefer 1953)."""
    inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_inner, at_outer = function(inner), function(outer)
    while high - low > tolerance:
        if at_inner <= at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - GOLDEN * (high - low)
            at_inner = function(inner)
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + GOLDEN * (high - low)
            at_outer = function(outer)
    return 0.5 * (low + high)


def _whole_medium(view: View) -> Medium:
    """The view's medium with usual indices for missing values."""
    medium = view.medium or Medium()
    return replace(
        medium,
        gel_index=medium.gel_index or USUAL_GEL_INDEX,
        window_index=medium.window_index or USUAL_WINDOW_INDEX,
    )


def _medium_columns(views: Sequence[View], flat_mm: Array) -> Iterator[Array]:
    """(V, M, 2) px by which the markers move with each parameter of the medium, which is common to all views."""
    for field, step in STEPS.items():
        changed = []
        for view in views:
            medium = _whole_medium(view)
            changed.append(replace(view, medium=replace(medium, **{field: getattr(medium, field) + step})))
        yield _moved_px(views, changed, flat_mm)
    for axis in (0, 1):
        yield _moved_px(views, [_tilted(view, axis) for view in views], flat_mm)


def _tilted(view: View, axis: int) -> View:
    """The view with its window tilted towards an axis of the layout; its gel is as thick at the layout's origin."""
    if view.medium is None or view.window is not None:
        return view
    rotation, shift_mm = view.R_camera_from_layout, view.t_camera_from_layout_mm
    normal = rotation[:, 2] * np.sign(rotation[:, 2] @ shift_mm) + TILT_STEP * rotation[:, axis]
    normal /= np.linalg.norm(normal)
    distance_mm = float(normal @ shift_mm) - view.medium.gel_mm - view.medium.window_mm
    x, y, z = (float(v) for v in normal)
    return replace(view, window=WindowPlane((x, y, z), distance_mm))


def _lens_columns(found: RestViews, number: int) -> Iterator[Array]:
    """(V, M, 2) px by which the markers move with each parameter of one view's lens: f, c, k1, k2."""
    views, view = found.views, found.views[number]
    (fx, fy), (cx, cy), (k1, k2, *rest) = view.focal_px, view.centre_px, view.distortion
    for lens in (
        replace(view, focal_px=(fx + LENS_STEP_PX, fy)),
        replace(view, focal_px=(fx, fy + LENS_STEP_PX)),
        replace(view, centre_px=(cx + LENS_STEP_PX, cy)),
        replace(view, centre_px=(cx, cy + LENS_STEP_PX)),
        replace(view, distortion=(k1 + DISTORTION_STEP, k2, *rest)),
        replace(view, distortion=(k1, k2 + DISTORTION_STEP, *rest)),
    ):
        yield _moved_px(views, [*views[:number], lens, *views[number + 1 :]], found.rest.flat_mm)


def _moved_px(views: Sequence[View], changed: Sequence[View], flat_mm: Array) -> Array:
    """(V, M, 2) px by which the markers at rest move from views to changed views."""
    pairs = zip(views, changed, strict=True)
    return np.stack([new.project(flat_mm) - old.project(flat_mm) for old, new in pairs])


def _explained_error(found: RestViews, residual_px: Array, columns: Sequence[Array]) -> float:
    """The prediction error of residuals after a fit of the free poses and of parameters with these columns (V, M,
    2).
    """
    views, rest, free = found.views, found.rest, found.free
    for v in np.flatnonzero(free).tolist():
        by_pose = np.zeros((6, len(views), len(rest.flat_mm), 2))
        by_pose[:, v] = np.moveaxis(views[v].linearised(rest.flat_mm).by_pose, 2, 0)
        columns = [*columns, *by_pose]
    seen = is_finite(residual_px) & np.isfinite(columns).all(axis=(0, 3))
    root = np.linalg.cholesky(rest.cov_px2[seen])
    right = np.linalg.solve(root, residual_px[seen][..., None])[..., 0].ravel()
    design = np.linalg.solve(root, np.stack([column[seen] for column in columns], axis=2)).reshape(
        len(right), -1
    )
    scale = np.linalg.norm(design, axis=0)
    design = design[:, scale > 0] / scale[scale > 0]
    solution, _, rank, _ = np.linalg.lstsq(design, right, rcond=1e-9)
    return _prediction_error(float(np.sum((right - design @ solution) ** 2)), len(right), int(rank))


def _prediction_error(chi2: float, count: int, parameters: int) -> float:
    return chi2 / (count - parameters) * (1 + parameters / count) if count > parameters else float("inf")
