"""Pictures that contradict the others, their likely causes, and the further view that would help most."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.adjustment import Adjusted, Guess, Problem, covariance, linearise, residuals
from cmpdesign.calibration.rays import pixel_grid, ray_covariances
from cmpdesign.calibration.sightings import Sighting
from extractor import View

Array = NDArray[np.float64]

CONTRADICTS = 3.0  # difference of a picture from all others over its scatter, over a usual picture's; chosen
EXPLAINED = 0.5  # share of a picture's squares that its cause leaves at most; chosen
ANOTHER_LENS = "another focal length or focus than in the other pictures"
BENT = "the sheet is bent otherwise than in the other pictures"
MOVED = "the sheet or the camera moved while the picture was taken, or points lie wrong"
TILT_DEG = 30.0
PLACES = {
    "in the middle": (0.5, 0.5),
    "in the upper left corner": (0.25, 0.25),
    "in the upper right corner": (0.75, 0.25),
    "in the lower left corner": (0.25, 0.75),
    "in the lower right corner": (0.75, 0.75),
}


class Advice(NamedTuple):
    """A view to add.

    Attributes:
        text: what to do.
        ray_px: the RMS deviation of the rays with this view.
    """

    text: str
    ray_px: float


def contradicting(adjusted: Adjusted) -> NDArray[np.bool_]:
    """(V,) bool, the pictures that disagree with all others much more than usual."""
    return np.asarray(adjusted.agreement.contradiction > CONTRADICTS)


def likely_cause(adjusted: Adjusted, number: int) -> str:
    """Why a picture contradicts: the change that explains most of its residuals."""
    problem = adjusted.problem
    view = adjusted.guess.views[number]
    shape = adjusted.guess.shape if problem.bent else np.zeros(problem.sheet.bending.shape[2])
    one = Problem(problem.sheet, (problem.sightings[number],), problem.model, True, problem.size_px)
    guess = Guess((view,), shape)
    # one scale for all points, so that large residuals are not weighed down
    scale = np.array([max(np.abs(residuals(one, guess)).max(), 1.0)])
    blocks = linearise(one, guess, scale)
    lens = 4 + problem.model.coefficients
    normal = np.block([[blocks.common[0], blocks.mixed[0]], [blocks.mixed[0].T, blocks.pose[0]]])
    right = np.concatenate([blocks.right[0], blocks.right_pose[0]])
    squares = float((residuals(one, guess) ** 2).sum()) / scale[0] ** 2
    focal = np.zeros((len(right), 1))
    focal[:2, 0] = view.focal_px
    unit = np.eye(len(right))
    left = {
        cause: squares - _explained(normal, right, np.hstack([columns, unit[:, -6:]]))
        for cause, columns in ((ANOTHER_LENS, focal), (BENT, unit[:, lens + 4 : len(right) - 6 : 3]))
    }
    if left[ANOTHER_LENS] < EXPLAINED * squares and left[ANOTHER_LENS] < 2 * left[BENT]:
        return ANOTHER_LENS
    return BENT if left[BENT] < EXPLAINED * squares else MOVED


def _explained(normal: Array, right: Array, columns: Array) -> float:
    """The squares that steps along columns (G + 6, K) explain."""
    part, wanted = columns.T @ normal @ columns, columns.T @ right
    return float(wanted @ np.linalg.lstsq(part, wanted, rcond=1e-12)[0])


def ray_rms_px(camera: View, cov: Array, size_px: tuple[int, int]) -> float:
    """RMS deviation of the rays over the image, px per axis."""
    variance = np.trace(ray_covariances(camera, cov, pixel_grid(size_px)), axis1=1, axis2=2) / 2
    return float(np.sqrt(np.nanmean(variance)))


def best_further_view(adjusted: Adjusted) -> Advice:
    """The view, of tilted ones in the middle and in the corners, after which the rays are known best."""
    information = adjusted.reduced.sum(axis=0)
    lens = len(adjusted.lens_cov)
    found = []
    for text, view in _tilted_views(adjusted):
        known = information + _information(adjusted, view)
        cov = covariance(known, adjusted.prior, adjusted.agreement.difference)[:lens, :lens]
        found.append(Advice(text, ray_rms_px(adjusted.camera, cov, adjusted.problem.size_px)))
    return min(found, key=lambda advice: advice.ray_px)


def _tilted_views(adjusted: Adjusted) -> Iterator[tuple[str, View]]:
    camera, size = adjusted.camera, np.array(adjusted.problem.size_px)
    distance_mm = float(np.median([np.linalg.norm(_middle_mm(adjusted, v)) for v in adjusted.guess.views]))
    side = np.sign(np.linalg.det(adjusted.guess.views[0].R_camera_from_layout[:2, :2]))
    facing = np.diag([1.0, side, side])
    middle = adjusted.problem.sheet.flat_mm.mean(axis=0)
    for axis, turn in (("x", (1.0, 0, 0)), ("y", (0, 1.0, 0))):
        for sign in (1, -1):
            tilt = np.asarray(cv2.Rodrigues(np.radians(sign * TILT_DEG) * np.array(turn))[0]) @ facing
            for place, share in PLACES.items():
                direction = camera.normalised((np.array(share) * size)[None])[0]
                if not np.isfinite(direction).all():
                    continue
                ahead = np.array([*direction, 1.0])
                shift = ahead / np.linalg.norm(ahead) * distance_mm - tilt @ middle
                text = f"tilt the sheet by {sign * TILT_DEG:.0f} degrees about the picture's {axis}, {place}"
                yield text, camera.at(tilt, shift)


def _middle_mm(adjusted: Adjusted, view: View) -> Array:
    """(3,) the sheet's middle in a picture's camera frame."""
    middle = adjusted.problem.sheet.flat_mm.mean(axis=0)
    return np.asarray(view.R_camera_from_layout @ middle + view.t_camera_from_layout_mm)


def _information(adjusted: Adjusted, view: View) -> Array:
    """(G, G) what a picture in this pose would say about the common unknowns."""
    problem, shape = adjusted.problem, adjusted.guess.shape
    sheet, size = problem.sheet, np.array(problem.size_px)
    place = sheet.flat_mm + sheet.bending @ shape if problem.bent else sheet.flat_mm
    xy_px = view.project(place)
    with np.errstate(invalid="ignore"):
        ids = np.flatnonzero(((xy_px >= 0) & (xy_px <= size - 1)).all(axis=1))
    if not len(ids):
        return np.zeros_like(adjusted.cov)
    first = problem.sightings[0].cov_px2
    cov = None if first is None else np.tile(np.median(first, axis=0), (len(ids), 1, 1))
    one = replace(problem, sightings=(Sighting("further", ids, xy_px[ids], cov),))
    blocks = linearise(one, Guess((view,), shape), np.array([adjusted.base]))
    carried = blocks.mixed[0] @ np.linalg.pinv(blocks.pose[0], hermitian=True)
    return np.asarray(blocks.common[0] - carried @ blocks.mixed[0].T)
