"""First values for an adjustment: a scan over fields of view, and poses from homographies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.adjustment import Guess
from cmpdesign.calibration.models import MODELS, CameraModel, parameters
from cmpdesign.calibration.sightings import Sheet, Sighting
from cmpdesign.errors import CmpDesignError
from extractor import View
from extractor.space.lens import Lens

Array = NDArray[np.float64]

FIELDS_DEG = (14, 20, 28, 38, 50, 64, 80, 98, 118)  # across the width, for the scan
WIDE_DEG = 60  # field from which an equidistant lens is tried, too
MAX_POINTS, MAX_VIEWS = 40, 10  # for the scan


def first_guess(sheet: Sheet, sightings: Sequence[Sighting], size_px: tuple[int, int]) -> Guess:
    """The camera without distortion, or with an equidistant lens, that explains the pictures best.

    Raises:
        CmpDesignError: no camera explains them.
    """
    some = [sightings[i] for i in _subset(len(sightings), MAX_VIEWS)]
    best, least = None, np.inf
    for camera in _cameras(size_px):
        placed = [_place(camera, sheet, one) for one in some]
        if any(view is None for view in placed):
            continue
        errors = [
            _error_px(view, sheet, one) for view, one in zip(placed, some, strict=True) if view is not None
        ]
        cost = float(np.median(errors))
        if cost < least:
            best, least = camera, cost
    if best is None:
        raise CmpDesignError("no camera explains the pictures; check that LAYOUT is the sheet's")
    views = []
    for one in sightings:
        view = _place(best, sheet, one)
        if view is None:
            raise CmpDesignError(f"{one.name}: the points fix no pose; leave the picture out")
        views.append(view)
    return Guess(tuple(views), np.zeros(0))


def _cameras(size_px: tuple[int, int]) -> Iterator[View]:
    """Cameras without distortion, and with equidistant lenses, over the usual fields of view."""
    middle = [(side - 1) / 2 for side in size_px]
    for field_deg in FIELDS_DEG:
        half = np.radians(field_deg / 2)
        focal_px = size_px[0] / 2 / np.tan(half)
        yield MODELS[1].view(np.array([focal_px, focal_px, *middle, 0, 0, 0, 0, 0]))
        if field_deg >= WIDE_DEG:
            focal_px = size_px[0] / 2 / half
            yield MODELS[0].view(np.array([focal_px, focal_px, *middle, 0, 0, 0, 0]))


def _subset(count: int, most: int = MAX_POINTS) -> NDArray[np.intp]:
    """At most this many of the numbers below ``count``, evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def _place(camera: View, sheet: Sheet, sighting: Sighting) -> View | None:
    """The camera with the pose that a homography of the undistorted points implies; None without one."""
    few = _subset(len(sighting.ids))
    xy_mm, directions = sheet.xy_mm[sighting.ids[few]], camera.normalised(sighting.xy_px[few])
    known = np.isfinite(directions).all(axis=1)
    if known.sum() < 6:
        return None
    h, _ = cv2.findHomography(xy_mm[known], directions[known])
    if h is None or not np.isfinite(h).all():
        return None
    h = np.asarray(h, np.float64) * 2 / np.linalg.norm(h[:, :2], axis=0).sum()
    middle = np.array([*xy_mm[known].mean(axis=0), 1.0])
    if h[2] @ middle < 0:
        h = -h
    left, _, right = np.linalg.svd(np.column_stack([h[:, :2], np.cross(h[:, 0], h[:, 1])]))
    rotation = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    shift = h @ middle - rotation[:, :2] @ middle[:2]
    return camera.at(rotation, shift)


def _error_px(view: View, sheet: Sheet, sighting: Sighting) -> float:
    few = _subset(len(sighting.ids))
    error = view.project(sheet.flat_mm[sighting.ids[few]]) - sighting.xy_px[few]
    return float(np.sqrt(np.nan_to_num(np.mean(error**2), nan=1e12)))


def with_model(guess: Guess, model: CameraModel, size_px: tuple[int, int]) -> Guess:
    """The same views with the nearest lens of another model, within the image."""
    old = guess.views[0]
    if (old.lens, len(old.distortion)) == (model.kind, model.coefficients):
        return guess
    values = np.zeros(4 + model.coefficients)
    values[:4] = parameters(old)[:4]
    if old.lens == model.kind:
        values[4 : 4 + min(len(old.distortion), model.coefficients)] = old.distortion[: model.coefficients]
    else:
        values[4:] = _nearest_coefficients(old, model, size_px)
    camera = model.view(values)
    views = [camera.at(v.R_camera_from_layout, v.t_camera_from_layout_mm) for v in guess.views]
    return Guess(tuple(views), guess.shape)


def _nearest_coefficients(view: View, model: CameraModel, size_px: tuple[int, int]) -> Array:
    """(K,) radial coefficients whose lens shows directions nearly where this view's lens does."""
    reach = np.hypot(*size_px) / 2 / view.focal_px[0]
    places = np.linspace(0.02, 0.95, 40)[:, None] * reach * [[1.0, 0.0]]
    directions = Lens(view.lens, view.distortion).undistort(places)
    known = np.isfinite(directions[:, 0])
    r, wanted = directions[known, 0], places[known, 0]
    lens = Lens(model.kind, (0.0,) * model.coefficients)
    along = np.column_stack([r, 0 * r])
    if model.kind == "perspective" and model.coefficients >= 8:
        # N - (r' / r) D = 0 is linear
        share = wanted / r
        design = np.column_stack([r**2, r**4, r**6, -share * r**2, -share * r**4, -share * r**6])
        solved = np.linalg.lstsq(design, share - 1, rcond=1e-10)[0]
        out = np.zeros(model.coefficients)
        out[[0, 1, 4, 5, 6, 7]] = solved
        return out
    columns = lens.by_coefficients(along)[:, 0]
    return np.asarray(np.linalg.lstsq(columns, wanted - lens.distort(along).xy[:, 0], rcond=1e-10)[0])
