"""Cameras calibrated by ``calibrate_camera`` from rendered pictures of a sheet, against truth; and from real corners.

Random cameras of 40 to 120 degrees (1280x960), 20 pictures each, the whole reader and the search for the response
included. "Seen" is the part of the image within the convex hull of all points; errors of rays are RMS per axis after a
common turn, pooled over cameras; z is the RMS of errors over their covariances. "CPU" is the median of one call. With
``--corners``, corners of a chessboard, as tests/support/calibration are fitted beside ``cv2.calibrateCamera``.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import cmpdesign
from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.lenses.cameras import SIZE_PX, random_camera
from benchmarks.suites.lenses.pictures import BAD_KINDS, Conditions, take_pictures, to_view
from benchmarks.suites.scenes import standard_layout
from cmpdesign.calibration.camera import CameraCalibration, calibrate_points
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


@dataclass(frozen=True)
class CameraFigures:
    """One camera: errors px per axis, over the image and over the part with points; pictures that are left out."""

    condition: str
    field_deg: float
    model: str
    image_px: float
    seen_px: float
    stated_px: float
    z: float
    bad_found: int
    bad: int
    good_refused: int
    cpu_s: float


def calibrate_one(condition: str, seed: int, number: int) -> CameraFigures:
    """One random camera, its pictures, its calibration, and the errors."""
    rng = np.random.default_rng([seed, number])
    camera, taken = random_camera(rng), CONDITIONS[condition]
    bad: dict[int, str] = {}
    if "bad" in condition:
        places = rng.choice(PICTURES, BAD, replace=False)
        bad = {int(place): str(rng.choice(BAD_KINDS)) for place in places}
        taken = Conditions(taken.bend_mm, tuple(bad.items()), taken.jpeg_quality, taken.response)
    layout = standard_layout(layers=10)
    pictures = take_pictures(camera, layout, PICTURES, taken, rng)
    begin = time.process_time()
    found = cmpdesign.calibrate_camera(layout, pictures).found
    cpu_s = time.process_time() - begin
    view = to_view(camera.pinhole)
    refused = {number for number, one in enumerate(found.pictures) if not one.used}
    every, seen = pixel_grid(SIZE_PX), _seen(found)
    error, cov = ray_differences(found.camera, view, seen), ray_covariances(found.camera, found.cov, seen)
    d2 = np.einsum("ni,nij,nj->n", error, np.linalg.pinv(cov, hermitian=True), error)
    return CameraFigures(
        condition,
        camera.field_deg,
        found.model.name,
        _rms(ray_differences(found.camera, view, every)),
        _rms(error),
        float(np.sqrt(np.nanmean(np.trace(cov, axis1=1, axis2=2)) / 2)),
        float(np.sqrt(np.nanmean(d2) / 2)),
        len(refused & set(bad)),
        len(bad),
        len(refused - set(bad)),
        cpu_s,
    )


def _seen(found: CameraCalibration) -> Array:
    points = np.concatenate([one.xy_px for one in found.adjusted.problem.sightings])
    hull = cv2.convexHull(points.astype(np.float32))
    grid = pixel_grid(SIZE_PX, 48, 36)
    return grid[[cv2.pointPolygonTest(hull, (float(x), float(y)), False) > 0 for x, y in grid]]


def _rms(error: Array) -> float:
    return float(np.sqrt(np.nanmean(error**2)))


def pooled_row(name: str, rows: Sequence[CameraFigures]) -> tuple[object, ...]:
    """One row of the table: pooled over cameras up to 100 degrees, or beyond."""
    pooled = [
        float(np.sqrt(np.mean(np.square([getattr(row, one) for row in rows]))))
        for one in ("seen_px", "stated_px", "z", "image_px")
    ]
    bad = f"{sum(row.bad_found for row in rows)} of {sum(row.bad for row in rows)}"
    refused, cpu_s = sum(row.good_refused for row in rows), float(np.median([row.cpu_s for row in rows]))
    return (name, len(rows), *pooled, bad, refused, cpu_s)


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


def by_opencv(flags: int, count: int, sheet: Sheet, sightings: Sequence[Sighting]) -> Fitted:
    """The camera of cv2.calibrateCamera."""
    places = [sheet.flat_mm[one.ids].astype(np.float32) for one in sightings]
    pixels = [one.xy_px.astype(np.float32)[:, None] for one in sightings]
    _, k, lens, _, _ = cv2.calibrateCamera(places, pixels, SIZE_PX, None, None, flags=flags)  # type: ignore[call-overload]
    return Fitted(
        View("opencv", (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]), tuple(lens.ravel()[:count])), sheet.flat_mm
    )


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
    rational = cv2.CALIB_RATIONAL_MODEL
    solvers: dict[str, Callable[[Sheet, Sequence[Sighting]], Fitted]] = {
        "cv2.calibrateCamera,  5 coefficients": partial(by_opencv, 0, 5),
        "cv2.calibrateCamera,  8 coefficients": partial(by_opencv, rational, 8),
        "cv2.calibrateCamera, 12 coefficients": partial(by_opencv, rational | cv2.CALIB_THIN_PRISM_MODEL, 12),
        "this solver": by_this,
    }
    lines = [
        f"{len(sightings)} views: RMS of whole residuals, px; RMS and median of views left out of {FOLDS} fits; views "
        "that the lens cannot show"
    ]
    for name, solve in solvers.items():
        whole = solve(sheet, sightings)
        inside = _rms(np.array([placed_px(whole, one) for one in sightings]))
        left = np.zeros(len(sightings))
        for fold in range(FOLDS):
            part = solve(sheet, [one for i, one in enumerate(sightings) if i % FOLDS != fold])
            left[fold::FOLDS] = [placed_px(part, one) for one in sightings[fold::FOLDS]]
        lines.append(
            f"  {name:36s} {inside:.3f}   {_rms(left):.3f}   {np.nanmedian(left):.3f}   {np.isnan(left).sum()}"
        )
    found = calibrate_points(sheet, sightings, SIZE_PX)
    refused = [f"{one.name} ({one.cause})" for one in found.pictures if not one.used]
    worst = sorted(found.pictures, key=lambda one: -one.scale)[:3]
    lines.append("  largest: " + ", ".join(f"{one.name} {one.rms_px * 2**0.5:.2f} px" for one in worst))
    lines.append(
        f"  this solver: {found.model.name}, bent by {found.bend_mm:.3f} squares, {found.rms_px * 2**0.5:.3f} px"
    )
    return "\n".join([*lines, f"  left out: {', '.join(refused) or 'no view'}"])


def measure(cameras: int = 8, seed: int = 0, condition: str = "", corners: str = "") -> Shown:
    """Errors of rays of random cameras under each condition, and residuals of real corners.

    Args:
        cameras: random cameras for each condition.
        condition: one condition; all by default.
        corners: file of real corners, as tests/support/calibration/wide.json; no cameras then.
    """
    if corners:
        yield corners_text(Path(corners))
        return Found()
    rows, kept = [], []
    for name in (condition,) if condition else CONDITIONS:
        found = [calibrate_one(name, seed, number) for number in range(cameras)]
        kept += found
        narrow = [row for row in found if row.field_deg <= WIDE_DEG]
        wide = [row for row in found if row.field_deg > WIDE_DEG]
        rows += [
            pooled_row(f"{name}, {field}", some)
            for field, some in (("to 100 degrees", narrow), ("beyond", wide))
            if some
        ]
    columns = {
        "condition": TEXT,
        "cameras": "d",
        "seen px": ".4f",
        "stated px": ".4f",
        "z": ".2f",
        "image px": ".4f",
    }
    yield Table("rays", columns | {"bad found": TEXT, "good left out": "d", "CPU s": ".1f"}, rows)
    return Found({"cameras": [asdict(row) for row in kept]})


main = Experiment("lenses", measure)

if __name__ == "__main__":
    raise SystemExit(main())
