"""OpenCV's calibrations: from given points, and from pictures of a chessboard by the same cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.lenses.cameras import SIZE_PX, TrueCamera
from benchmarks.suites.lenses.pictures import Conditions, take_pictures
from benchmarks.suites.scenes import BOARD_LAYERS, checkerboard_layout
from cmpdesign.calibration.rays import ray_differences
from cmpdesign.calibration.sightings import Sheet, Sighting
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Plain
from cmpdesign.scene.standard import INKS
from extractor import View

Array = NDArray[np.float64]
INNER = 2 * BOARD_LAYERS  # corners in a row
SB_FLAGS = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
RATIONAL = cv2.CALIB_RATIONAL_MODEL
# Number of coefficients -> flags of cv2.calibrateCamera.
PERSPECTIVE = {5: 0, 8: RATIONAL, 12: RATIONAL | cv2.CALIB_THIN_PRISM_MODEL}


def by_opencv(count: int, sheet: Sheet, sightings: Sequence[Sighting]) -> View:
    """The camera of cv2.calibrateCamera, with 5, 8 or 12 coefficients."""
    places = [sheet.flat_mm[one.ids].astype(np.float32) for one in sightings]
    pixels = [one.xy_px.astype(np.float32)[:, None] for one in sightings]
    _, k, lens, _, _ = cv2.calibrateCamera(  # type: ignore[call-overload]
        places, pixels, SIZE_PX, None, None, flags=PERSPECTIVE[count]
    )
    return View("opencv", (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]), tuple(lens.ravel()[:count]))


def by_opencv_fisheye(sheet: Sheet, sightings: Sequence[Sighting]) -> View:
    """The camera of cv2.fisheye.calibrate."""
    places = [sheet.flat_mm[one.ids][:, None] for one in sightings]
    pixels = [one.xy_px[:, None] for one in sightings]
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    _, k, lens, _, _ = cv2.fisheye.calibrate(places, pixels, SIZE_PX, np.eye(3), np.zeros(4), flags=flags)
    return View("opencv", (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]), tuple(lens.ravel()), lens="fisheye")


@cache
def board_layout(area_mm2: float) -> Layout:
    """A black-and-white chessboard of 21 x 21 squares around the origin, without a border, of this area."""
    layout = checkerboard_layout(True)
    low, high = layout.marker_xy_mm.min(axis=0), layout.marker_xy_mm.max(axis=0)
    scale = float(np.sqrt(area_mm2 / np.prod(high - low)))
    middle = (low + high) / 2
    return replace(
        layout,
        marker_xy_mm=(layout.marker_xy_mm - middle) * scale,
        outline_mm=(layout.outline_mm - middle) * scale,
    )


def board_error_px(
    camera: TrueCamera,
    area_mm2: float,
    count: int,
    conditions: Conditions,
    pixels: Array,
    true: View,
    seed: Any,
) -> float:
    """The RMS ray error over pixels by OpenCV's best model, from pictures of a chessboard; NaN where no model fits.

    The best model is chosen by the truth, and no picture contradicts: both favour OpenCV.
    """
    layout, taken = board_layout(area_mm2), replace(conditions, bad=())
    white = Plain(INKS["white"])
    pictures = take_pictures(camera, layout, count, taken, np.random.default_rng(seed), white)
    sheet, sightings = _corners(layout, pictures)
    errors = []
    for solve in (*(_solver(n) for n in PERSPECTIVE), by_opencv_fisheye):
        try:
            found = solve(sheet, sightings)
        except cv2.error:  # no such lens fits
            continue
        error = ray_differences(true, found, pixels)
        if np.isfinite(error).all():
            errors.append(float(np.sqrt(np.mean(error**2))))
    return min(errors, default=float("nan"))


def _solver(count: int) -> Any:
    return lambda sheet, sightings: by_opencv(count, sheet, sightings)


def _corners(layout: Layout, pictures: Sequence[NDArray[Any]]) -> tuple[Sheet, list[Sighting]]:
    low, high = layout.marker_xy_mm.min(axis=0), layout.marker_xy_mm.max(axis=0)
    places = np.linspace(low, high, INNER + 2)[1:-1]
    sheet = Sheet(np.stack(np.meshgrid(places[:, 0], places[:, 1]), axis=-1).reshape(-1, 2))
    found = []
    for number, picture in enumerate(pictures):
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        seen, corners = cv2.findChessboardCornersSB(grey, (INNER, INNER), None, SB_FLAGS)
        if seen:
            xy_px = corners.reshape(-1, 2).astype(np.float64)
            found.append(Sighting(str(number), np.arange(len(xy_px)), xy_px))
    return sheet, found
