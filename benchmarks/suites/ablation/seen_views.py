"""Pictures by what a person could read of them: damaged crops without the white cell, and path-traced pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import count

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.calibration.cases import CalibrationCase
from benchmarks.suites.photoreal.pictures import NO_PATTERN, PICTURES_FOLDER, TracedPicture, load_pictures
from benchmarks.suites.views.views import DAMAGED, DrawnView, shoot_view


@dataclass(frozen=True, eq=False)
class VisibleMarkers:
    """The true positions of the markers; virtual ones are not known.

    Attributes:
        marker_xy_px: (M, 2) float64.
        visible: (M,) bool.
    """

    marker_xy_px: NDArray[np.float64]
    visible: NDArray[np.bool_]

    @property
    def virtual_xy_px(self) -> NDArray[np.float64]:
        return np.empty((0, 0, 2))


@dataclass(frozen=True, eq=False)
class SeenPicture:
    """A picture with the markers of its one pattern."""

    image: NDArray[np.uint8]
    truths: tuple[VisibleMarkers, ...]


def view_cases(seed: int) -> Iterator[CalibrationCase]:
    """Damaged crops without the white cell; of each the seen cells fit one motion only."""
    for number in count():
        shot = shoot_view(DrawnView(DAMAGED, seed, number))
        if shot.motions == 1:
            picture = shot.picture
            seen = SeenPicture(picture.image, (VisibleMarkers(picture.marker_xy_px, picture.visible),))
            yield CalibrationCase(DAMAGED, picture.layout, partial(_as_it_is, seen))


def traced_cases(_seed: int) -> Iterator[CalibrationCase]:
    """The path-traced pictures with a pattern, the same for every seed."""
    for picture in load_pictures(PICTURES_FOLDER):
        if picture.family != NO_PATTERN:
            yield CalibrationCase(picture.family, picture.truth.layout(), partial(_traced, picture))


def _as_it_is(picture: SeenPicture) -> SeenPicture:
    return picture


def _traced(picture: TracedPicture) -> SeenPicture:
    """The truth is where the sides of the cells cross; of cells with relief it is at half their height."""
    truth = picture.truth
    places = truth.xy_deep_px if truth.relief_mm else truth.xy_lines_px
    return SeenPicture(picture.image, (VisibleMarkers(places, truth.visible),))
