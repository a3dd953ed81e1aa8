"""Cameras calibrated by ``calibrate_camera`` from rendered pictures of a sheet, against truth; and from real corners.

Random cameras of 40 to 120 degrees (1280x960), 20 pictures each, the whole reader and the search for the response
included. "Seen" is the part of the image within the convex hull of all points; errors of rays are RMS per axis after a
common turn, pooled over cameras; z is the RMS of errors over their covariances. "Model within 1.1": the ray error is at
most 1.1 times that of the best model on the same pictures. "CPU" is the median of one call. With ``--chessboards``,
OpenCV's ray error from as many pictures of a chessboard by the same cameras, with its best model, and the ratio; mrcal
is not compared, as it cannot be installed from PyPI. With ``--corners``, corners of a real chessboard, as those in
tests/support/calibration, are fitted beside ``cv2.calibrateCamera``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import cmpdesign
from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.pooled import pooled_table, rms_of
from benchmarks.frame.timing import timed
from benchmarks.suites.lenses.boards import board_error_px, by_opencv
from benchmarks.suites.lenses.cameras import SIZE_PX, random_camera
from benchmarks.suites.lenses.pictures import BAD_KINDS, Conditions, take_pictures, to_view
from benchmarks.suites.lenses.scoring import (
    COLUMNS,
    CameraFigures,
    model_ratio,
    parameters_z,
    rays_z,
    seen_pixels,
)
from benchmarks.suites.scenes import standard_layout
from cmpdesign.calibration.camera import calibrate_points
from cmpdesign.calibration.rays import pixel_grid, ray_covariances, ray_differences
from cmpdesign.calibration.sightings import Sheet, Sighting
from extractor import View

Array = NDArray[np.float64]
PICTURES, BAD, WIDE_DEG, FOLDS = 20, 2, 100.0, 5
CONDITIONS = {
    "flat": Conditions(jpeg_quality=None),
    "bent by 0.5 mm": Conditions(bend_mm=0.5, jpeg_quality=None),
    "tone curve 2.2": Conditions(response=2.2, jpeg_quality=None),
    "JPEG 90": Conditions(),
    "all, 2 of 20 bad": Conditions(bend_mm=0.5, response=2.2),
}


def calibrate_one(condition: str, seed: int, number: int, chessboards: bool) -> CameraFigures:
    """One random camera, its pictures, its calibration, and the errors."""
    rng = np.random.default_rng([seed, number])
    camera, taken = random_camera(rng), CONDITIONS[condition]
    bad: dict[int, str] = {}
    if "bad" in condition:
        places = rng.choice(PICTURES, BAD, replace=False)
        bad = {int(place): str(rng.choice(BAD_KINDS)) for place in places}
        taken = replace(taken, bad=tuple(bad.items()))
    layout = standard_layout(layers=10)
    pictures = take_pictures(camera, layout, PICTURES, taken, rng)
    calibrated = timed(lambda: cmpdesign.calibrate_camera(layout, pictures).found)
    found = calibrated.result
    true = to_view(camera.pinhole)
    refused = {number for number, one in enumerate(found.pictures) if not one.used}
    seen = seen_pixels([one.xy_px for one in found.adjusted.problem.sightings])
    cov = ray_covariances(found.camera, found.cov, seen)
    board_px = float("nan")
    if chessboards:
        area_mm2 = cv2.contourArea(cv2.convexHull(layout.marker_xy_mm.astype(np.float32)))
        board_px = board_error_px(camera, area_mm2, PICTURES, taken, seen, true, [seed, number, 1])
    return CameraFigures(
        condition=condition,
        field_deg=camera.field_deg,
        model=found.model.name,
        image_px=rms_of(ray_differences(found.camera, true, pixel_grid(SIZE_PX))),
        seen_px=rms_of(ray_differences(found.camera, true, seen)),
        stated_px=float(np.sqrt(np.nanmean(np.trace(cov, axis1=1, axis2=2)) / 2)),
        z=rays_z(found, true, seen),
        parameters_z=parameters_z(found, true),
        model_ratio=model_ratio(found, true, seen),
        bad_found=len(refused & set(bad)),
        bad=len(bad),
        good_refused=len(refused - set(bad)),
        board_px=board_px,
        cpu_s=calibrated.cpu_ms / 1e3,
    )


@dataclass(frozen=True, eq=False)
class Fitted:
    """A camera, and the points (M, 3) mm of the sheet as it found them."""

    view: View
    xyz_mm: Array


def read_corners(path: Path) -> tuple[Sheet, list[Sighting]]:
    """The points of a chessboard, row by row, in squares; the pictures have the size of ``SIZE_PX``."""
    document = json.loads(path.read_text(encoding="utf-8"))
    board = document["board"]
    places = [(column, row) for row in range(board["rows"]) for column in range(board["columns"])]
    ids = np.arange(len(places))
    found = [Sighting(view["picture"], ids, np.array(view["xy_px"])) for view in document["views"]]
    return Sheet(np.array(places, float)), found


def by_cv2(count: int, sheet: Sheet, sightings: Sequence[Sighting]) -> Fitted:
    """The camera of cv2.calibrateCamera, of a flat board."""
    return Fitted(by_opencv(count, sheet, sightings), sheet.flat_mm)


def by_this(sheet: Sheet, sightings: Sequence[Sighting]) -> Fitted:
    """The camera of this solver, and the shape of the sheet."""
    found = calibrate_points(sheet, sightings, SIZE_PX).adjusted
    return Fitted(
        found.camera, sheet.flat_mm + (sheet.bending @ found.guess.shape if found.problem.bent else 0.0)
    )


def placed_px(fitted: Fitted, one: Sighting) -> float:
    """RMS of whole residuals of one view, px, after the pose that fits best."""
    xyz_mm, rays = fitted.xyz_mm[one.ids], fitted.view.normalised(one.xy_px)
    _, turn, shift = cv2.solvePnP(xyz_mm, rays, np.eye(3), None, flags=cv2.SOLVEPNP_ITERATIVE)
    shown = fitted.view.at(np.asarray(cv2.Rodrigues(turn)[0]), shift.ravel()).project(xyz_mm)
    return float(np.sqrt(np.mean(((shown - one.xy_px) ** 2).sum(axis=1))))


def corners_text(path: Path) -> str:
    """Residuals of all views of real corners, and of views left out; the largest; views that contradict."""
    sheet, sightings = read_corners(path)
    solvers: dict[str, Callable[[Sheet, Sequence[Sighting]], Fitted]] = {
        "cv2.calibrateCamera,  5 coefficients": partial(by_cv2, 5),
        "cv2.calibrateCamera,  8 coefficients": partial(by_cv2, 8),
        "cv2.calibrateCamera, 12 coefficients": partial(by_cv2, 12),
        "this solver": by_this,
    }
    lines = [
        f"{len(sightings)} views: RMS of whole residuals, px; RMS and median of views left out of {FOLDS} fits; views "
        "that the lens cannot show"
    ]
    for name, solve in solvers.items():
        whole = solve(sheet, sightings)
        inside = rms_of(np.array([placed_px(whole, one) for one in sightings]))
        left = np.zeros(len(sightings))
        for fold in range(FOLDS):
            part = solve(sheet, [one for i, one in enumerate(sightings) if i % FOLDS != fold])
            left[fold::FOLDS] = [placed_px(part, one) for one in sightings[fold::FOLDS]]
        lines.append(
            f"  {name:36s} {inside:.3f}   {rms_of(left):.3f}   {np.nanmedian(left):.3f}   {np.isnan(left).sum()}"
        )
    found = calibrate_points(sheet, sightings, SIZE_PX)
    refused = [f"{one.picture} ({one.cause})" for one in found.pictures if not one.used]
    worst = sorted(found.pictures, key=lambda one: -one.scale)[:3]
    lines.append("  largest: " + ", ".join(f"{one.picture} {one.rms_px * 2**0.5:.2f} px" for one in worst))
    lines.append(
        f"  this solver: {found.model.name}, bent by {found.bend_mm:.3f} squares, {found.rms_px * 2**0.5:.3f} px"
    )
    return "\n".join([*lines, f"  left out: {', '.join(refused) or 'no view'}"])


def measure(
    cameras: int = 8, seed: int = 0, condition: str = "", chessboards: bool = False, corners: str = ""
) -> Shown:
    """Errors of rays of random cameras under each condition, and residuals of real corners.

    Args:
        cameras: random cameras for each condition.
        condition: one condition; all by default.
        chessboards: also calibrate every camera by OpenCV, from as many pictures of a chessboard of the same area.
        corners: file of real corners, as tests/support/calibration/wide.json; no cameras then.
    """
    if corners:
        yield corners_text(Path(corners))
        return Found()
    groups: dict[str, list[CameraFigures]] = {}
    for name in (condition,) if condition else CONDITIONS:
        found = [calibrate_one(name, seed, number, chessboards) for number in range(cameras)]
        groups[f"{name}, to 100 degrees"] = [row for row in found if row.field_deg <= WIDE_DEG]
        groups[f"{name}, beyond"] = [row for row in found if row.field_deg > WIDE_DEG]
    yield pooled_table("rays", "condition", COLUMNS, groups)
    return Found({"cameras": [asdict(row) for rows in groups.values() for row in rows]})


main = Experiment("lenses", measure)
main.run_as(__name__)
