"""A picture of a calibration: the expected error of every pixel's ray, the points, and the mean residuals by region."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.camera import CameraCalibration, residuals_px
from cmpdesign.calibration.rays import pixel_grid, ray_covariances

WIDTH_PX, FOOT_PX = 960, 60
GRID = (49, 37)
MIN_PX, MAX_PX = 1e-3, 1.0  # of the color scale, logarithmic
REGIONS = (8, 6)
ARROW = 2000.0  # pixels of the picture per px of a mean residual


def ray_picture(found: CameraCalibration) -> NDArray[Any]:
    """(H, W, 3) uint8 BGR."""
    width, height = size = found.adjusted.problem.size_px
    scale = WIDTH_PX / width
    shown = (WIDTH_PX, round(height * scale))
    variance = (
        np.trace(ray_covariances(found.camera, found.cov, pixel_grid(size, *GRID)), axis1=1, axis2=2) / 2
    )
    deviation = np.sqrt(np.nan_to_num(variance, nan=MAX_PX**2)).reshape(GRID[::-1])
    picture = cv2.resize(_colors(deviation), shown, interpolation=cv2.INTER_CUBIC)
    for sighting in found.adjusted.problem.sightings:
        for x, y in np.round(sighting.xy_px * scale).astype(int):
            cv2.circle(picture, (int(x), int(y)), 1, (255, 255, 255), -1)
    _draw_residuals(picture, found, scale)
    return np.vstack([picture, _foot()])


def _colors(deviation_px: NDArray[np.float64]) -> NDArray[Any]:
    place = np.log(deviation_px / MIN_PX) / np.log(MAX_PX / MIN_PX)
    return np.asarray(cv2.applyColorMap((255 * np.clip(place, 0, 1)).astype(np.uint8), cv2.COLORMAP_VIRIDIS))


def region_residuals(found: CameraCalibration) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(6, 8, 2) px mean residuals, and (6, 8) numbers of points, of equal parts of the image."""
    size = np.array(found.adjusted.problem.size_px)
    total, count = np.zeros((*REGIONS[::-1], 2)), np.zeros(REGIONS[::-1])
    for number, sighting in enumerate(found.adjusted.problem.sightings):
        column, row = np.clip((sighting.xy_px / size * REGIONS).astype(int), 0, np.array(REGIONS) - 1).T
        residual = residuals_px(found.adjusted, number)
        known = np.isfinite(residual).all(axis=1)
        np.add.at(total, (row[known], column[known]), residual[known])
        np.add.at(count, (row[known], column[known]), 1)
    return total / np.maximum(count, 1)[..., None], count


def _draw_residuals(picture: NDArray[Any], found: CameraCalibration, scale: float) -> None:
    mean, count = region_residuals(found)
    size = np.array(found.adjusted.problem.size_px) * scale
    for row, column in zip(*np.nonzero(count), strict=True):
        start = (np.array([column, row]) + 0.5) * size / REGIONS
        end = start + mean[row, column] * ARROW
        cv2.arrowedLine(picture, _pixel(start), _pixel(end), (60, 60, 255), 2, cv2.LINE_AA)


def _pixel(xy: NDArray[np.float64]) -> tuple[int, int]:
    return round(float(xy[0])), round(float(xy[1]))


def _foot() -> NDArray[Any]:
    """The scale of the colors and of the arrows."""
    foot = np.full((FOOT_PX, WIDTH_PX, 3), 255, np.uint8)
    values = np.geomspace(MIN_PX, MAX_PX, 400)[None]
    foot[8:26, 20:420] = _colors(np.repeat(values, 18, axis=0))
    for value in (0.001, 0.01, 0.1, 1.0):
        x = 20 + int(400 * np.log(value / MIN_PX) / np.log(MAX_PX / MIN_PX))
        cv2.putText(
            foot,
            f"{value:g}",
            (max(x - 14, 4), 46),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.45,
            (0, 0, 0),
            1,
            cv2.LINE_AA,
        )
    text = "px: deviation of a ray, per axis"
    cv2.putText(foot, text, (440, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    cv2.arrowedLine(foot, (440, 42), (440 + int(0.02 * ARROW), 42), (60, 60, 255), 2, cv2.LINE_AA)
    text = "0.02 px mean residual of a region; white: points"
    cv2.putText(foot, text, (490, 47), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return foot
