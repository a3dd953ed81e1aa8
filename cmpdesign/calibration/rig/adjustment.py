"""The likeliest cameras, medium and poses of a rig: Levenberg-Marquardt on the pixels and what is known before.

At rest the markers lie at their places in the layout. In a step a flat plate has pressed the pattern by a known length:
the markers' heights are those of a plane, whose offset and tilt are common to all steps, and their places within the
plane are unknown and eliminated marker by marker (variable projection, Golub and Pereyra 1973, with Kaufman's
Jacobian).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.rig.unknowns import Unknowns, see
from extractor import RigError, View
from extractor.space.camera import is_covariance, is_finite
from extractor.space.triangulation import triangulate

Array = NDArray[np.float64]

ITERATIONS = 40
INITIAL_DAMPING, MAX_DAMPING = 1e-6, 1e8
CONVERGED = 1e-3  # last step, in standard deviations
PLACE_ROUNDS = 3  # of finding the markers' places on a plane; each from the one before
SCALE_ROUNDS = 3
OFFSET_SIGMA_MM, TILT_SIGMA = 10.0, 0.05  # of the plate against the pattern at rest: hardly restricted
OFF_PLANE = 6.0  # median deviations from the plane, from which a marker is not below the plate
LARGE = 1e6  # deviations of a point without a picture, so that a step there is refused


class RigStep(NamedTuple):
    """The markers under a plate.

    Attributes:
        press_mm: the plate's way since any zero that all steps share.
        xy_px: (V, M, 2), NaN where not seen.
        cov_px2: (V, M, 2, 2).
    """

    press_mm: float
    xy_px: Array
    cov_px2: Array


@dataclass(frozen=True, eq=False)
class RigProblem:
    """What is adjusted.

    Attributes:
        unknowns: the unknowns.
        stated: (P, P) what is known about them before, see ``Unknowns.stated``.
        rest_mm: (M, 3) the markers at rest.
        rest: their pixels; ``press_mm`` is 0.
        steps: the steps.
        step_sigma_mm: standard deviation of each step's way.
    """

    unknowns: Unknowns
    stated: Array
    rest_mm: Array
    rest: RigStep
    steps: tuple[RigStep, ...] = ()
    step_sigma_mm: float = 0.005

    @property
    def half_mm(self) -> float:
        """Half the pattern's size."""
        return float(np.abs(self.rest_mm[:, :2]).max())

    @property
    def information(self) -> Array:
        """(P + Q, P + Q) what is known before about the unknowns, and about the plate: offset, tilts, steps."""
        count = self.unknowns.count
        plate = [OFFSET_SIGMA_MM, *[TILT_SIGMA * self.half_mm] * 2, *[self.step_sigma_mm] * len(self.steps)]
        out = np.zeros((count + len(plate), count + len(plate)))
        out[:count, :count] = self.stated
        out[range(count, len(out)), range(count, len(out))] = 1 / np.square(plate)
        return out


@dataclass(frozen=True, eq=False)
class AdjustedRig:
    """The result.

    Attributes:
        views: the likeliest views, with poses.
        cov: (P, P) covariance of the unknowns.
        scale: residuals over their stated deviations.
        rest_px: (V, M, 2) residuals at rest, NaN where not seen.
        on_plate: (M,) bool of each step, the markers that lie on its plane.
    """

    views: tuple[View, ...]
    cov: Array
    scale: float
    rest_px: Array
    on_plate: tuple[NDArray[np.bool_], ...]


class _State(NamedTuple):
    """Views, the plate (Q,), and the sum of all changes of the unknowns (P + Q,)."""

    views: tuple[View, ...]
    plate: Array
    moved: Array


class _Equations(NamedTuple):
    """Normal equations (P + Q, P + Q), their right side, the weighted squares, and their degrees of freedom."""

    normal: Array
    right: Array
    chi2: float
    freedom: int


def adjust_rig(problem: RigProblem, start: Sequence[View]) -> AdjustedRig:
    """The likeliest values of all unknowns, from placed views."""
    places = [_start_places(start, one) for one in problem.steps]
    kept = [
        one._replace(xy_px=np.where(is_finite(at)[:, None], one.xy_px, np.nan))
        for one, at in zip(problem.steps, places, strict=True)
    ]
    whole = _Whole(problem, tuple(kept), tuple(places))
    plate = np.zeros(3 + len(kept))
    state = _State(tuple(start), plate, np.zeros(problem.unknowns.count + len(plate)))
    scale = 1.0
    for _ in range(SCALE_ROUNDS):
        state, found = _minimise(whole, state, scale)
        scale = float(np.sqrt(max(1.0, found.chi2 / max(found.freedom, 1))))
    cov = _inverse(found.normal / scale**2 + problem.information)
    count = problem.unknowns.count
    shown = see(problem.unknowns, state.views, problem.rest_mm).xy_px
    on_plate = tuple(is_finite(at) for at in places)
    return AdjustedRig(state.views, cov[:count, :count], scale, problem.rest.xy_px - shown, on_plate)


@dataclass(frozen=True, eq=False)
class _Whole:
    """A problem with its steps' markers below the plate, and first places (M, 2) of these."""

    problem: RigProblem
    steps: tuple[RigStep, ...]
    places: tuple[Array, ...]

    def equations(self, state: _State) -> _Equations:
        problem = self.problem
        size = len(state.moved)
        normal, right = np.zeros((size, size)), np.zeros(size)
        shown = see(problem.unknowns, state.views, problem.rest_mm)
        residual, root = _whitened(problem.rest, shown.xy_px)
        design = _by_marker(root @ shown.by_unknowns)
        parts = [(np.pad(design, ((0, 0), (0, 0), (0, size - design.shape[2]))), residual)]
        count = int((residual != 0).sum()) - 6 * len(state.views)
        for number, (step, at) in enumerate(zip(self.steps, self.places, strict=True)):
            parts.append(self._step_part(state, number, step, at))
            count += int((parts[-1][1] != 0).sum()) - 2 * int(is_finite(at).sum())
        for design, residual in parts:
            flat = design.reshape(-1, size)
            normal += flat.T @ flat
            right += flat.T @ residual.ravel()
        return _Equations(normal, right, float(sum((one**2).sum() for _, one in parts)), count)

    def _step_part(self, state: _State, number: int, step: RigStep, at: Array) -> tuple[Array, Array]:
        """The design (M, 2 V, P + Q) and the residuals (M, 2 V) of a step, without the markers' places."""
        unknowns, half_mm = self.problem.unknowns, self.problem.half_mm
        offset, *tilt = state.plate[:3]
        slope = np.array(tilt) / half_mm
        height = offset + state.plate[3 + number] - step.press_mm
        xy, along = np.nan_to_num(at), np.vstack([np.eye(2), slope])
        for _ in range(PLACE_ROUNDS):
            seen = _pictures(state.views, np.column_stack([xy, height + xy @ slope]))
            residual, root = _whitened(step, seen.xy_px)
            solved = np.linalg.pinv(_by_marker(root @ seen.by_point) @ along)
            xy = xy + (solved @ residual[..., None])[..., 0]
        xyz = np.column_stack([xy, height + xy @ slope])
        whole = see(unknowns, state.views, xyz)
        residual, root = _whitened(step, whole.xy_px)
        design, by_point = _by_marker(root @ whole.by_unknowns), _by_marker(root @ whole.by_point)
        by_place = by_point @ along
        rest = np.eye(residual.shape[1]) - by_place @ np.linalg.pinv(by_place)
        by_plate = np.zeros((*residual.shape, len(state.plate)))
        by_height = by_point[..., 2]
        by_plate[..., 0] = by_plate[..., 3 + number] = by_height
        by_plate[..., 1:3] = by_height[..., None] * (xy / half_mm)[:, None]
        return rest @ np.concatenate([design, by_plate], axis=2), (rest @ residual[..., None])[..., 0]


def _minimise(whole: _Whole, state: _State, scale: float) -> tuple[_State, _Equations]:
    problem, damping = whole.problem, INITIAL_DAMPING
    known = problem.information
    now = whole.equations(state)
    for _ in range(ITERATIONS):
        normal = now.normal / scale**2 + known
        right = now.right / scale**2 - known @ state.moved
        step = _inverse(normal + damping * np.diag(normal.diagonal())) @ right
        tried = _moved(problem.unknowns, state, step)
        tried_now = None if tried is None else whole.equations(tried)
        if (
            tried is not None
            and tried_now is not None
            and _cost(tried_now, tried, known, scale) <= _cost(now, state, known, scale)
        ):
            state, now, damping = tried, tried_now, damping / 10
        else:
            damping *= 10
        if right @ step < CONVERGED**2 or damping > MAX_DAMPING:
            break
    return state, now


def _moved(unknowns: Unknowns, state: _State, step: Array) -> _State | None:
    """The values after a step; None where no rig has them."""
    count = unknowns.count
    try:
        views = unknowns.deviation(step[:count]).applied(state.views)
    except RigError:
        return None
    return _State(views, state.plate + step[count:], state.moved + step)


def _cost(found: _Equations, state: _State, known: Array, scale: float) -> float:
    return found.chi2 / scale**2 + float(state.moved @ known @ state.moved)


class _Pictures(NamedTuple):
    """Pictures (V, M, 2) of points and derivatives (V, M, 2, 3)."""

    xy_px: Array
    by_point: Array


def _pictures(views: tuple[View, ...], xyz_mm: Array) -> _Pictures:
    linear = [view.linearised(xyz_mm) for view in views]
    return _Pictures(np.stack([one.xy_px for one in linear]), np.stack([one.by_point for one in linear]))


def _whitened(step: RigStep, shown_px: Array) -> tuple[Array, Array]:
    """The residuals (M, 2 V) in deviations, and the whitening matrices (V, M, 2, 2); 0 where not seen."""
    seen = is_finite(step.xy_px) & is_covariance(step.cov_px2)
    cov = np.where(seen[..., None, None], step.cov_px2, np.eye(2))
    root = np.where(seen[..., None, None], np.linalg.inv(np.linalg.cholesky(cov)), 0.0)
    residual = (root @ np.where(seen[..., None], step.xy_px - shown_px, 0.0)[..., None])[..., 0]
    residual[~np.isfinite(residual)] = LARGE
    return np.moveaxis(residual, 0, 1).reshape(len(cov[0]), -1), root


def _by_marker(values: Array) -> Array:
    """(M, 2 V, K) of derivatives (V, M, 2, K); 0 where a point has no picture."""
    return np.moveaxis(np.nan_to_num(values), 0, 1).reshape(values.shape[1], -1, values.shape[3])


def _start_places(views: Sequence[View], step: RigStep) -> Array:
    """(M, 2) mm, the markers' places below the plate by the first views; NaN for markers that are not below it."""
    found = triangulate(views, step.xy_px, step.cov_px2).xyz_mm
    known = is_finite(found)
    for _ in range(PLACE_ROUNDS):
        columns = np.column_stack([np.ones(len(found)), found[:, :2]])
        plane = np.linalg.lstsq(columns[known], found[known, 2], rcond=None)[0]
        off = np.abs(found[:, 2] - columns @ plane)
        with np.errstate(invalid="ignore"):
            known = off <= OFF_PLANE * np.median(off[known])
    return np.where(known[:, None], found[:, :2], np.nan)


def _inverse(matrix: Array) -> Array:
    root = np.sqrt(matrix.diagonal())
    return np.asarray(np.linalg.inv(matrix / root / root[:, None]) / root / root[:, None])
