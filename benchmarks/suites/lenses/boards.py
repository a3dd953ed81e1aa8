"""OpenCV's calibrations: from given points, and from pictures of a chessboard by the same cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.pooled import rms_of
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
WINDOWS_PX = (5, 8)  # half sides for cv2.cornerSubPix
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
    places = [sheet.flat_mm[one.ids][None] for one in sightings]
    pixels = [one.xy_px[None] for one in sightings]
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
    """The RMS ray error over pixels by OpenCV, from pictures of a chessboard; NaN where no model fits.

    Model and window of ``cv2.cornerSubPix`` are the best ones by the truth, and no picture contradicts: all favours
    OpenCV.
    """
    layout, taken = board_layout(area_mm2), replace(conditions, bad=())
    white = Plain(INKS["white"])
    pictures = take_pictures(camera, layout, count, taken, np.random.default_rng(seed), white)
    sheet, errors = _board_sheet(layout), []
    for sightings in _corners(pictures):
        for solve in (*(partial(by_opencv, n) for n in PERSPECTIVE), by_opencv_fisheye):
            try:
                error = ray_differences(true, solve(sheet, sightings), pixels)
            except cv2.error:  # no such lens fits
                continue
            if np.isfinite(error).all():
                errors.append(rms_of(error))
    return min(errors, default=float("nan"))


def _board_sheet(layout: Layout) -> Sheet:
    low, high = layout.marker_xy_mm.min(axis=0), layout.marker_xy_mm.max(axis=0)
    places = np.linspace(low, high, INNER + 2)[1:-1]
    return Sheet(np.stack(np.meshgrid(places[:, 0], places[:, 1]), axis=-1).reshape(-1, 2))


def _corners(pictures: Sequence[NDArray[Any]]) -> list[list[Sighting]]:
    """The corners of the pictures that show the whole board: of the detector, and refined with each window."""
    found: list[list[Sighting]] = [[] for _ in range(1 + len(WINDOWS_PX))]
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-4)
    for number, picture in enumerate(pictures):
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        seen, corners = cv2.findChessboardCornersSB(grey, (INNER, INNER), None, cv2.CALIB_CB_EXHAUSTIVE)
        if not seen:
            continue
        ways = [corners]
        for window in WINDOWS_PX:
            refined = corners.astype(np.float32).copy()
            ways.append(cv2.cornerSubPix(grey, refined, (window, window), (-1, -1), stop))
        for way, sightings in zip(ways, found, strict=True):
            xy_px = way.reshape(-1, 2).astype(np.float64)
            sightings.append(Sighting(str(number), np.arange(len(xy_px)), xy_px))
    return found
