"""The relation of light and values under which the points of a sheet agree best with the calibrated camera.

Markers are read in linear light. A wrong relation moves them by hundredths of a pixel, by their contrast and tilt,
which no camera and no sheet explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

from cmpdesign.calibration.adjustment import Guess, adjust
from cmpdesign.calibration.camera import CameraCalibration, calibrate_points, picture_rms_px
from cmpdesign.calibration.pictures import SheetPictures

Response = Literal["srgb", "linear"] | float

CANDIDATES: tuple[Response, ...] = ("srgb", 1.8, 2.0, 2.2, 2.4, 2.6)
MAX_PICTURES = 6  # about, that are read with each candidate
BETTER = 0.9  # residuals over those of sRGB, from which another relation is taken


def likely_response(
    found: CameraCalibration, read: Callable[[Response, Sequence[str] | None], SheetPictures]
) -> tuple[Response, CameraCalibration]:
    """The relation of the least residuals, and the calibration with it.

    Args:
        found: the calibration with sRGB.
        read: reads pictures with a relation; by their names, or all.
    """
    adjusted = found.adjusted
    few = list(range(0, len(adjusted.guess.views), max(len(adjusted.guess.views) // MAX_PICTURES, 1)))
    names = [adjusted.problem.sightings[v].name for v in few]
    start = Guess(tuple(adjusted.guess.views[v] for v in few), adjusted.guess.shape)
    errors: dict[Response, float] = {}
    for response in CANDIDATES:
        sightings = read(response, names).sightings
        if len(sightings) == len(names):
            tried = adjust(replace(adjusted.problem, sightings=sightings), start)
            errors[response] = sum(picture_rms_px(tried, v) for v in range(len(names)))
    best: Response = min(errors, key=lambda response: errors[response]) if errors else "srgb"
    if best == "srgb" or errors[best] > BETTER * errors.get("srgb", float("inf")):
        return "srgb", found
    whole = read(best, None)
    return best, calibrate_points(whole.sheet, whole.sightings, whole.size_px, [found.model])
