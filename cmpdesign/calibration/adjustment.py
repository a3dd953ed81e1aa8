"""Bundle adjustment of one camera over many pictures of a sheet: Levenberg-Marquardt on blocks.

The unknowns are the camera's parameters and the sheet's shape, common to all pictures, and one pose a picture. The
poses are eliminated picture by picture (Schur's complement), so that the system to solve has the size of the common
part. Every picture has its own scale of errors, estimated from its residuals, so that a picture that contradicts weighs
little; points beyond ``HUBER`` deviations weigh less (Huber 1964). The covariance follows from how well the pictures
agree (``agreement``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.agreement import Agreement, agreement
from cmpdesign.calibration.models import CameraModel, parameters
from cmpdesign.calibration.sightings import Sheet, Sighting
from extractor import View
from extractor.space.lens import Lens
from extractor.space.medium import cross_matrix

Array = NDArray[np.float64]

ITERATIONS = 30
INITIAL_DAMPING, MAX_DAMPING = 1e-4, 1e8
CONVERGED = 0.03  # last step, in standard deviations
HUBER = 4.0  # deviations
UNSEEN = 1e3  # deviations of a point that the lens cannot show, so that a step there is refused
SCALE_ROUNDS = 4  # of estimating the pictures' scales
RIDGE = 1e-12  # of a pose's information


class _Points(NamedTuple):
    """The points of V pictures, filled up to the largest number N of a picture.

    Attributes:
        flat_mm: (V, N, 3).
        bending: (V, N, 3, S).
        xy_px: (V, N, 2).
        whitening: (V, N, 2, 2); 0 where filled up.
    """

    flat_mm: Array
    bending: Array
    xy_px: Array
    whitening: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """What is adjusted.

    Attributes:
        sheet: the points.
        sightings: V pictures.
        model: of the camera.
        bent: the sheet's shape is unknown.
        size_px: (width, height) of the pictures.
    """

    sheet: Sheet
    sightings: tuple[Sighting, ...]
    model: CameraModel
    bent: bool
    size_px: tuple[int, int]

    @cached_property
    def counts(self) -> Array:
        """(V,) numbers of each picture, two a point."""
        return np.array([2.0 * len(one.ids) for one in self.sightings])

    @property
    def freedom(self) -> Array:
        """(V,) numbers of each picture less its pose's 6."""
        return np.asarray(np.maximum(self.counts - 6, 1.0))

    @cached_property
    def points(self) -> _Points:
        """The points of all pictures."""
        most, views = int(self.counts.max()) // 2, len(self.sightings)
        ids = np.zeros((views, most), np.intp)
        xy_px, whitening = np.zeros((views, most, 2)), np.zeros((views, most, 2, 2))
        for v, one in enumerate(self.sightings):
            count = len(one.ids)
            ids[v], ids[v, :count] = one.ids[0], one.ids
            xy_px[v, :count], whitening[v, :count] = one.xy_px, one.whitening
        bending = self.sheet.bending[ids] if self.bent else np.zeros((views, most, 3, 0))
        return _Points(self.sheet.flat_mm[ids], bending, xy_px, whitening)


@dataclass(frozen=True, eq=False)
class Guess:
    """Values of all unknowns.

    Attributes:
        views: V cameras with the same parameters, each with its picture's pose.
        shape: (S,) mm, see ``Sheet.bending``; empty for a flat sheet.
    """

    views: tuple[View, ...]
    shape: Array

    @property
    def common(self) -> Array:
        """(G,) the camera's parameters, then the shape."""
        return np.concatenate([parameters(self.views[0]), self.shape])


class Blocks(NamedTuple):
    """The normal equations of V pictures.

    Attributes:
        common: (V, G, G).
        mixed: (V, G, 6).
        pose: (V, 6, 6).
        right: (V, G), and ``right_pose`` (V, 6): the gradients.
    """

    common: Array
    mixed: Array
    pose: Array
    right: Array
    right_pose: Array


class _Prior(NamedTuple):
    """Usual values (G,) of the common unknowns, and their information (G,)."""

    values: Array
    information: Array


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The result.

    Attributes:
        problem: what was adjusted.
        guess: the likeliest values.
        cov: (G, G) covariance of the camera's parameters, then of the shape.
        scales: (V,) deviations of each picture's points over the stated ones; of unknown deviations px.
        base: the scale of a usual picture.
        reduced: (V, G, G) each picture's information about the common unknowns, in these scales.
        gradients: (V, G) each picture's part of the gradient.
        chi2: (V,) weighted squares, in these scales.
        prior: (G,) information of the usual values.
        agreement: of each picture with all others, in these scales.
    """

    problem: Problem
    guess: Guess
    cov: Array
    scales: Array
    base: float
    reduced: Array
    gradients: Array
    chi2: Array
    prior: Array
    agreement: Agreement

    @property
    def camera(self) -> View:
        """The camera, without a pose."""
        return self.problem.model.view(parameters(self.guess.views[0]))

    @property
    def lens_cov(self) -> Array:
        """(4 + K, 4 + K) covariance of the camera's parameters."""
        count = 4 + self.problem.model.coefficients
        return self.cov[:count, :count]


def adjust(problem: Problem, start: Guess) -> Adjusted:
    """The likeliest values of all unknowns, and their covariance."""
    if problem.bent and not len(start.shape):
        start = replace(start, shape=np.zeros(problem.sheet.bending.shape[2]))
    prior = _prior(problem, start)
    guess, scales, base = start, np.ones(len(problem.sightings)), 1.0
    for _ in range(SCALE_ROUNDS):
        before = scales
        scales, base = _scales(problem, residuals(problem, guess), scales)
        if np.allclose(scales, before, rtol=0.05):
            break
        guess = _minimise(problem, guess, scales, prior)
    return _finish(problem, guess, scales, base, prior)


def _prior(problem: Problem, start: Guess) -> _Prior:
    focal_px = float(np.mean(start.views[0].focal_px))
    spreads = problem.model.spreads(focal_px, problem.size_px)
    values = np.zeros(len(spreads))
    values[:4] = [focal_px, focal_px, *((side - 1) / 2 for side in problem.size_px)]
    if problem.bent:
        spreads = np.concatenate([spreads, problem.sheet.bending_spreads_mm])
        values = np.concatenate([values, np.zeros(len(start.shape))])
    return _Prior(values, np.asarray(1 / spreads**2))


def _minimise(problem: Problem, current: Guess, scales: Array, prior: _Prior) -> Guess:
    """Levenberg-Marquardt from this guess, with these scales of the pictures."""
    damping, cost = INITIAL_DAMPING, _cost(problem, current, scales, prior)
    blocks = linearise(problem, current, scales)
    for _ in range(ITERATIONS):
        common, poses, gain = _step(blocks, prior, current.common, damping)
        tried = _moved(problem, current, common, poses)
        tried_cost = np.inf if tried is None else _cost(problem, tried, scales, prior)
        if tried is not None and tried_cost <= cost:
            current, cost, damping = tried, tried_cost, damping / 10
            if gain < CONVERGED**2 * len(common):
                break
            blocks = linearise(problem, current, scales)
            continue
        damping = max(damping * 10, INITIAL_DAMPING)
        if damping > MAX_DAMPING or gain < CONVERGED**2 * len(common):
            break
    return current


def _cost(problem: Problem, guess: Guess, scales: Array, prior: _Prior) -> float:
    offset = guess.common - prior.values
    return float(
        _squares(residuals(problem, guess) / scales[:, None, None]).sum() + prior.information @ offset**2
    )


def _squares(residual: Array) -> Array:
    """(V,) Huber's cost of residuals (V, N, 2) in deviations."""
    distance = np.linalg.norm(residual, axis=2)
    far = 2 * HUBER * distance - HUBER**2
    return np.asarray(np.where(distance <= HUBER, distance**2, far).sum(axis=1))


def _step(blocks: Blocks, prior: _Prior, values: Array, damping: float) -> tuple[Array, Array, float]:
    """The step of the common unknowns (G,) and of the poses (V, 6), and the expected decrease of the cost."""
    diagonal = np.diagonal(blocks.pose, axis1=1, axis2=2)
    inverse = np.linalg.inv(blocks.pose + ((damping + RIDGE) * diagonal + RIDGE)[:, :, None] * np.eye(6))
    carried = blocks.mixed @ inverse
    common = blocks.common.sum(axis=0)
    system = common + np.diag(damping * common.diagonal() + prior.information)
    system -= (carried @ np.swapaxes(blocks.mixed, 1, 2)).sum(axis=0)
    right = blocks.right.sum(axis=0) - (carried @ blocks.right_pose[:, :, None])[:, :, 0].sum(axis=0)
    right -= prior.information * (values - prior.values)
    root = np.sqrt(system.diagonal())
    step = np.linalg.solve(system / root / root[:, None], right / root) / root
    left = blocks.right_pose - np.einsum("vgp,g->vp", blocks.mixed, step)
    gain = float(right @ step) + float(
        np.einsum("vp,vpq,vq->", blocks.right_pose, inverse, blocks.right_pose)
    )
    return step, np.einsum("vpq,vq->vp", inverse, left), gain


def _moved(problem: Problem, guess: Guess, common: Array, poses: Array) -> Guess | None:
    """The values after a step; None where no camera has them."""
    values = parameters(guess.views[0])
    changed = values + common[: len(values)]
    if not np.isfinite(changed).all() or changed[:2].min() <= 0.05 * values[:2].min():
        return None
    camera = problem.model.view(changed)
    turns = _rotations(poses[:, :3]) @ np.stack([view.R_camera_from_layout for view in guess.views])
    left, _, right = np.linalg.svd(turns)
    shifts = np.stack([view.t_camera_from_layout_mm for view in guess.views]) + poses[:, 3:]
    views = [camera.at(turn, shift) for turn, shift in zip(left @ right, shifts, strict=True)]
    return Guess(tuple(views), guess.shape + common[len(values) :])


def _rotations(turns: Array) -> Array:
    """(V, 3, 3) of turns (V, 3) in rad, by Rodrigues' formula."""
    angle = np.linalg.norm(turns, axis=1)[:, None, None]
    cross = cross_matrix(turns)
    small = np.maximum(angle, 1e-12)
    return np.asarray(
        np.eye(3) + np.sin(angle) / small * cross + (1 - np.cos(angle)) / small**2 * cross @ cross
    )


class _Seen(NamedTuple):
    """Points (V, N) along the cameras' axes, their directions (V N, 2), and the lens."""

    rotated: Array
    camera: Array
    directions: Array
    lens: Lens


def _see(problem: Problem, guess: Guess) -> _Seen:
    points, view = problem.points, guess.views[0]
    xyz_mm = points.flat_mm + points.bending @ guess.shape if problem.bent else points.flat_mm
    rotated = xyz_mm @ np.stack([one.R_camera_from_layout.T for one in guess.views])
    camera = rotated + np.stack([one.t_camera_from_layout_mm for one in guess.views])[:, None]
    directions = (camera[..., :2] / np.where(camera[..., 2:] > 0, camera[..., 2:], np.nan)).reshape(-1, 2)
    lens = Lens(view.lens, view.distortion)
    directions[np.hypot(*directions.T) >= lens.fold_radius] = np.nan
    return _Seen(rotated, camera, directions, lens)


def residuals(problem: Problem, guess: Guess) -> Array:
    """(V, N, 2) residuals in stated deviations, or in px; 0 where a picture has no point."""
    seen, view = _see(problem, guess), guess.views[0]
    return _whitened_residuals(problem, view, seen.lens.distort(seen.directions).xy)


def _whitened_residuals(problem: Problem, view: View, places: Array) -> Array:
    points = problem.points
    shown = (places * view.focal_px + view.centre_px).reshape(points.xy_px.shape)
    filled = points.whitening[..., 0, 0] == 0
    residual = (points.whitening @ (points.xy_px - shown)[..., None])[..., 0]
    residual[~np.isfinite(residual).all(axis=-1)] = UNSEEN
    residual[filled] = 0.0
    return np.asarray(residual)


def linearise(problem: Problem, guess: Guess, scales: Array) -> Blocks:
    """The normal equations; ``scales`` (V,) are the deviations of the points over the stated ones."""
    seen, view, points = _see(problem, guess), guess.views[0], problem.points
    distorted, shape = seen.lens.distort(seen.directions), points.xy_px.shape[:2]
    residual = _whitened_residuals(problem, view, distorted.xy) / scales[:, None, None]
    distance = np.linalg.norm(residual, axis=2)
    weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(distance, RIDGE)))
    weight[distance * scales[:, None] >= UNSEEN] = 0.0
    depth = seen.camera[..., 2].reshape(-1)
    by_camera = np.zeros((len(depth), 2, 3))
    by_camera[:, 0, 0] = by_camera[:, 1, 1] = 1 / depth
    by_camera[:, :, 2] = -seen.directions / depth[:, None]
    by_camera = np.array(view.focal_px)[:, None] * (distorted.by_direction @ by_camera)
    columns = [view.by_lens(seen.directions)]
    if problem.bent:
        turns = np.repeat([one.R_camera_from_layout for one in guess.views], shape[1], axis=0)
        columns.append(by_camera @ turns @ points.bending.reshape(len(depth), 3, -1))
    columns += [by_camera @ -cross_matrix(seen.rotated.reshape(-1, 3)), by_camera]
    root = points.whitening * (weight / scales[:, None])[..., None, None]
    design = root.reshape(-1, 2, 2) @ np.concatenate(columns, axis=2)
    design[~np.isfinite(design).all(axis=(1, 2))] = 0.0
    design = design.reshape(shape[0], 2 * shape[1], -1)
    right = np.swapaxes(design, 1, 2) @ (residual * weight[..., None]).reshape(shape[0], -1, 1)
    normal = np.swapaxes(design, 1, 2) @ design
    return Blocks(
        normal[:, :-6, :-6], normal[:, :-6, -6:], normal[:, -6:, -6:], right[:, :-6, 0], right[:, -6:, 0]
    )


def _scales(problem: Problem, residual: Array, scales: Array) -> tuple[Array, float]:
    """(V,) the pictures' scales by their residuals, none below a usual picture's, and that one."""
    freedom = problem.freedom
    found = np.sqrt((residual**2).sum(axis=(1, 2)) / freedom)
    for _ in range(10):  # to the scales at which Huber's cost is as expected
        found = found * np.sqrt(np.maximum(_squares(residual / found[:, None, None]) / freedom, 0.01))
    base = float(np.median(found))
    return np.maximum(found, base), base


def _finish(problem: Problem, guess: Guess, scales: Array, base: float, prior: _Prior) -> Adjusted:
    blocks = linearise(problem, guess, scales)
    carried = blocks.mixed @ np.linalg.pinv(blocks.pose, hermitian=True)
    reduced = blocks.common - carried @ np.swapaxes(blocks.mixed, 1, 2)
    gradients = blocks.right - (carried @ blocks.right_pose[:, :, None])[:, :, 0]
    chi2 = _squares(residuals(problem, guess) / scales[:, None, None])
    agreed = agreement(reduced, gradients, chi2, problem.freedom, prior.information)
    cov = covariance(reduced.sum(axis=0), prior.information, agreed.difference)
    return Adjusted(problem, guess, cov, scales, base, reduced, gradients, chi2, prior.information, agreed)


def covariance(information: Array, prior: Array, difference: Array) -> Array:
    """(G, G) covariance of the common unknowns from the pictures' information (G, G), by their differences (V,)."""
    total = information / np.mean(difference**2) + np.diag(prior)
    root = np.sqrt(total.diagonal())
    return np.asarray(np.linalg.inv(total / root / root[:, None]) / root / root[:, None])
