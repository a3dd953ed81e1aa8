"""Errors of a calibrated camera against truth, and their pooled rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.pooled import Columns, Figure, percentile, rms_of, total
from benchmarks.frame.table import TEXT
from benchmarks.suites.lenses.cameras import SIZE_PX
from cmpdesign.calibration.camera import CameraCalibration
from cmpdesign.calibration.choice import choose_model
from cmpdesign.calibration.models import MODELS, parameters
from cmpdesign.calibration.rays import pixel_grid, ray_covariances, ray_differences
from extractor import View

Array = NDArray[np.float64]
MAX_RATIO = 1.1  # of a ray error over the best one, for a good choice of the model


@dataclass(frozen=True)
class CameraFigures:
    """One camera: errors px per axis, over the image and over the part with points; NaN where unknown.

    Attributes:
        z: of rays; ``parameters_z`` where the model can be the true one.
        model_ratio: ray error over that of the best model on the same pictures.
        bad_found: pictures that contradict and are left out, of ``bad``.
        board_px: ray error of OpenCV's calibration with a chessboard, by its best model.
    """

    condition: str
    field_deg: float
    model: str
    image_px: float
    seen_px: float
    stated_px: float
    z: float
    parameters_z: float
    model_ratio: float
    bad_found: int
    bad: int
    good_refused: int
    board_px: float
    cpu_s: float


def seen_pixels(points_px: Sequence[Array]) -> Array:
    """(N, 2) px of a grid within the convex hull of all points."""
    hull = cv2.convexHull(np.concatenate(points_px).astype(np.float32))
    grid = pixel_grid(SIZE_PX, 48, 36)
    return grid[[cv2.pointPolygonTest(hull, (float(x), float(y)), False) > 0 for x, y in grid]]


def rays_z(found: CameraCalibration, true: View, pixels: Array) -> float:
    """The RMS of the rays' errors over their covariances."""
    error, cov = (
        ray_differences(found.camera, true, pixels),
        ray_covariances(found.camera, found.cov, pixels),
    )
    d2 = np.einsum("ni,nij,nj->n", error, np.linalg.pinv(cov, hermitian=True), error)
    return float(np.sqrt(np.nanmean(d2) / 2))


def parameters_z(found: CameraCalibration, true: View) -> float:
    """The RMS of the parameters' errors over their covariance; NaN for a model that cannot be the true one."""
    wanted, values = parameters(true), parameters(found.camera)
    if found.model.kind != true.lens or len(wanted) > len(values):
        return float("nan")
    error = values - np.append(wanted, np.zeros(len(values) - len(wanted)))
    root = np.sqrt(found.cov.diagonal())
    error, cov = error / root, found.cov / root / root[:, None]
    return float(np.sqrt(error @ np.linalg.solve(cov, error) / len(error)))


def model_ratio(found: CameraCalibration, true: View, pixels: Array) -> float:
    """The ray error over the least one of all models, each on the pictures that are used."""
    problem, errors = found.adjusted.problem, [rms_of(ray_differences(found.camera, true, pixels))]
    for model in MODELS:
        if model != problem.model:
            one = choose_model(problem, found.adjusted.guess, [model]).camera
            error = ray_differences(true, one, pixels)
            errors += [rms_of(error)] if np.isfinite(error).all() else []
    return errors[0] / min(errors)


def _pooled(name: str) -> tuple[str, Figure]:
    """The RMS of an attribute over the cameras of which it is known."""
    return ".2f" if name.endswith("z") else ".4f", lambda rows: rms_of([getattr(row, name) for row in rows])


def _good_models(rows: Sequence[CameraFigures]) -> str:
    ratios = [row.model_ratio for row in rows if np.isfinite(row.model_ratio)]
    return f"{sum(one <= MAX_RATIO for one in ratios)} of {len(ratios)}"


def _board_ratio(rows: Sequence[CameraFigures]) -> float:
    both = [row for row in rows if np.isfinite(row.board_px)]
    return rms_of([row.board_px for row in both]) / rms_of([row.seen_px for row in both])


COLUMNS: Columns = {
    "cameras": ("d", len),
    "seen px": _pooled("seen_px"),
    "stated px": _pooled("stated_px"),
    "z": _pooled("z"),
    "parameters z": _pooled("parameters_z"),
    "image px": _pooled("image_px"),
    "model within 1.1": (TEXT, _good_models),
    "bad found": (TEXT, lambda rows: f"{total('bad_found')(rows)} of {total('bad')(rows)}"),
    "good left out": ("d", total("good_refused")),
    "chessboard px": _pooled("board_px"),
    "ratio": (".1f", _board_ratio),
    "CPU s": (".1f", percentile("cpu_s", 50)),
}
