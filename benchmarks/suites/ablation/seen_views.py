"""Pictures by what a person could read of them: damaged crops without the white cell, and path-traced pictures."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import count

from benchmarks.suites.calibration.cases import CalibrationCase, KnownPicture, KnownPositions
from benchmarks.suites.photoreal.pictures import NO_PATTERN, PICTURES_FOLDER, TracedPicture, load_pictures
from benchmarks.suites.views.views import DAMAGED, DrawnView, shoot_view


def view_cases(seed: int) -> Iterator[CalibrationCase]:
    """Damaged crops without the white cell; of each the seen cells fit one motion only."""
    for number in count():
        shot = shoot_view(DrawnView(DAMAGED, seed, number))
        if shot.seen.motions == 1:
            picture = shot.picture
            truth = KnownPositions(picture.marker_xy_px, visible=picture.visible)
            yield CalibrationCase(DAMAGED, picture.layout, partial(KnownPicture, picture.image, (truth,)))


def traced_cases(_seed: int) -> Iterator[CalibrationCase]:
    """The path-traced pictures with a pattern, the same for every seed."""
    for picture in load_pictures(PICTURES_FOLDER):
        if picture.family != NO_PATTERN:
            yield CalibrationCase(picture.family, picture.truth.layout(), partial(_traced, picture))


def _traced(picture: TracedPicture) -> KnownPicture:
    """The truth is where the sides of the cells cross; of cells with relief it is at half their height."""
    truth = picture.truth
    places = truth.xy_deep_px if truth.relief_mm else truth.xy_lines_px
    return KnownPicture(picture.image, (KnownPositions(places, visible=truth.visible),))
