"""Errors of a calibrated camera against truth, and their pooled rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.pooled import rms_of
from benchmarks.frame.table import TEXT
from benchmarks.suites.lenses.cameras import SIZE_PX
from cmpdesign.calibration.camera import CameraCalibration
from cmpdesign.calibration.choice import choose_model
from cmpdesign.calibration.models import MODELS, parameters
from cmpdesign.calibration.rays import pixel_grid, ray_covariances, ray_differences
from extractor import View

Array = NDArray[np.float64]
MAX_RATIO = 1.1  # of a ray error over the best one, for a good choice of the model
COLUMNS = {
    "condition": TEXT, "cameras": "d", "seen px": ".4f", "stated px": ".4f", "z": ".2f", "parameters z": ".2f",
    "image px": ".4f", "model within 1.1": TEXT, "bad found": TEXT, "good left out": "d", "chessboard px": ".4f",
    "ratio": ".1f", "CPU s": ".1f",
}  # fmt: skip


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


def pooled_row(name: str, rows: Sequence[CameraFigures]) -> tuple[object, ...]:
    """One row of the table."""
    pooled = {
        one: rms_of([getattr(row, one) for row in rows])
        for one in ("seen_px", "stated_px", "z", "image_px", "parameters_z", "board_px")
        if np.isfinite([getattr(row, one) for row in rows]).any()
    }
    ratios = [row.model_ratio for row in rows if np.isfinite(row.model_ratio)]
    board_px = pooled.get("board_px", float("nan"))
    both = [row.seen_px for row in rows if np.isfinite(row.board_px)]
    return (
        name,
        len(rows),
        pooled["seen_px"],
        pooled["stated_px"],
        pooled["z"],
        pooled.get("parameters_z", float("nan")),
        pooled["image_px"],
        f"{sum(one <= MAX_RATIO for one in ratios)} of {len(ratios)}",
        f"{sum(row.bad_found for row in rows)} of {sum(row.bad for row in rows)}",
        sum(row.good_refused for row in rows),
        board_px,
        board_px / rms_of(np.array(both)) if both else float("nan"),
        float(np.median([row.cpu_s for row in rows])),
    )
