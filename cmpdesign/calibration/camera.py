"""The calibration of one camera from points in pictures of a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.adjustment import Adjusted, Guess, Problem
from cmpdesign.calibration.choice import choose_model
from cmpdesign.calibration.models import MODELS, CameraModel
from cmpdesign.calibration.sightings import Sheet, Sighting
from cmpdesign.calibration.start import first_guess
from cmpdesign.calibration.verdicts import Advice, best_further_view, contradicting, likely_cause, ray_rms_px
from cmpdesign.errors import CmpDesignError
from extractor import View

Array = NDArray[np.float64]

MIN_PICTURES = 3
MIN_POINTS = 12  # of a picture; twice as many numbers as a pose and a focal length need, three times
MAX_REFUSED = 0.4  # share of the pictures that may contradict the others
REFUSING_ROUNDS = 3
MAX_FOCAL_DEVIATION = 0.01  # of the focal length, above which it counts as not determined
HELD = 0.5  # deviation of a parameter over that of usual cameras, from which it counts as not determined


@dataclass(frozen=True)
class PictureVerdict:
    """One picture.

    Attributes:
        picture: its name.
        points: their number.
        rms_px: RMS residual, px per axis.
        scale: residuals over the stated deviations; without those, px.
        cause: why the picture contradicts the others and is left out; empty: it is used.
    """

    picture: str
    points: int
    rms_px: float
    scale: float
    cause: str = ""

    @property
    def used(self) -> bool:
        """Whether the picture counts."""
        return not self.cause


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A calibrated camera.

    Attributes:
        adjusted: the adjustment of the pictures that are used.
        pictures: the verdicts on all pictures, in their order.
        ray_px: RMS deviation of the rays over the image, px per axis.
        held: the parameters that the pictures do not determine, which are held at usual values.
        advice: the view to add that would help most.
    """

    adjusted: Adjusted
    pictures: tuple[PictureVerdict, ...]
    ray_px: float
    held: tuple[str, ...]
    advice: Advice

    @property
    def camera(self) -> View:
        """The camera, without a pose."""
        return self.adjusted.camera

    @property
    def cov(self) -> Array:
        """(4 + K, 4 + K) covariance of its parameters, in the order of ``model.names``."""
        return self.adjusted.lens_cov

    @property
    def model(self) -> CameraModel:
        """The chosen model."""
        return self.adjusted.problem.model

    @property
    def rms_px(self) -> float:
        """RMS residual of the pictures that are used, px per axis."""
        used = [one for one in self.pictures if one.used]
        points = np.array([one.points for one in used])
        return float(np.sqrt(np.average(np.square([one.rms_px for one in used]), weights=points)))

    @property
    def bend_mm(self) -> float:
        """Height of the sheet's shape; 0 where a flat sheet explains the pictures."""
        if not self.adjusted.problem.bent:
            return 0.0
        height = self.adjusted.problem.sheet.bending[:, 2] @ self.adjusted.guess.shape
        return float(np.ptp(height))


def calibrate_points(
    sheet: Sheet,
    sightings: Sequence[Sighting],
    size_px: tuple[int, int],
    models: Sequence[CameraModel] = MODELS,
) -> CameraCalibration:
    """The camera that took pictures of a sheet.

    Args:
        sheet: the points.
        sightings: one for each picture; deviations of all points or of none.
        size_px: (width, height) of the pictures.
        models: the models to choose from, from the fewest parameters.

    Raises:
        CmpDesignError: too few pictures or points, contradicting pictures, or a focal length that is not determined.
    """
    _require_points(sightings)
    problem = Problem(sheet, tuple(sightings), models[0], False, size_px)
    whole = adjusted = choose_model(problem, first_guess(sheet, sightings, size_px), models)
    used = np.arange(len(sightings))
    for _ in range(REFUSING_ROUNDS):
        bad = contradicting(adjusted)
        if not bad.any():
            break
        used = used[~bad]
        if len(used) < max(MIN_PICTURES, (1 - MAX_REFUSED) * len(sightings)):
            raise CmpDesignError(
                f"{len(sightings) - len(used)} of {len(sightings)} pictures contradict the others; at most "
                f"{MAX_REFUSED:.0%} may, and {MIN_PICTURES} must remain; keep sheet, lens and focus as they are, and "
                "take the pictures again"
            )
        kept = replace(problem, sightings=tuple(sightings[int(i)] for i in used))
        views = tuple(view for view, out in zip(adjusted.guess.views, bad, strict=True) if not out)
        adjusted = choose_model(kept, Guess(views, adjusted.guess.shape), models)
    advice = best_further_view(adjusted)
    _require_focal_length(adjusted, advice)
    ray_px = ray_rms_px(adjusted.camera, adjusted.lens_cov, size_px)
    return CameraCalibration(adjusted, _verdicts(whole, adjusted, used), ray_px, _held(adjusted), advice)


def _require_points(sightings: Sequence[Sighting]) -> None:
    if len(sightings) < MIN_PICTURES:
        raise CmpDesignError(
            f"{len(sightings)} pictures show the sheet; a calibration needs {MIN_PICTURES}, better 15, "
            "with the sheet tilted differently in each"
        )
    for one in sightings:
        if len(one.ids) < MIN_POINTS:
            raise CmpDesignError(
                f"{one.name}: {len(one.ids)} points; a calibration needs {MIN_POINTS} in each picture; leave it out"
            )


def _require_focal_length(adjusted: Adjusted, advice: Advice) -> None:
    share = float(np.sqrt(adjusted.lens_cov[0, 0]) / adjusted.camera.focal_px[0])
    if share > MAX_FOCAL_DEVIATION:
        raise CmpDesignError(
            f"the pictures determine the focal length to {share:.1%} only, limit {MAX_FOCAL_DEVIATION:.0%}: the sheet "
            f"has nearly the same tilt in all of them; add a view: {advice.text}"
        )


def _held(adjusted: Adjusted) -> tuple[str, ...]:
    names = adjusted.problem.model.names
    deviations = np.sqrt(adjusted.lens_cov.diagonal() * adjusted.prior[: len(names)])
    return tuple(name for name, one in zip(names, deviations, strict=True) if one > HELD)


def _verdicts(whole: Adjusted, adjusted: Adjusted, used: NDArray[np.intp]) -> tuple[PictureVerdict, ...]:
    """The pictures in their order; those left out by the adjustment of all."""
    out = []
    for i, sighting in enumerate(whole.problem.sightings):
        place = np.flatnonzero(used == i)
        source, number = (adjusted, int(place[0])) if len(place) else (whole, i)
        rms_px = picture_rms_px(source, number)
        cause = "" if len(place) else likely_cause(whole, i)
        out.append(
            PictureVerdict(sighting.name, len(sighting.ids), rms_px, float(source.scales[number]), cause)
        )
    return tuple(out)


def residuals_px(adjusted: Adjusted, number: int) -> Array:
    """(N, 2) residuals of one picture, px."""
    sighting, view = adjusted.problem.sightings[number], adjusted.guess.views[number]
    sheet, shape = adjusted.problem.sheet, adjusted.guess.shape
    xyz_mm = sheet.flat_mm + sheet.bending @ shape if adjusted.problem.bent else sheet.flat_mm
    return np.asarray(sighting.xy_px - view.project(xyz_mm[sighting.ids]))


def picture_rms_px(adjusted: Adjusted, number: int) -> float:
    """RMS residual of one picture, px per axis."""
    return float(np.sqrt(np.nanmean(residuals_px(adjusted, number) ** 2)))
