"""Images that are broken along a row: torn frames, lost rows, rolling shutter. Markers beside a break are uncertain."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.scene import Camera, Optics, Plain, Press, Scene, Sensor, Twist, composed, render
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Extractor, Markers, Status, parse_layout
from tests.support.layouts import small_layout, small_text

LAYERS, SIZE = 7, (440, 360)
TORN_ROW = 170


class Taken(NamedTuple):
    """An image, and the places of its markers, one set for each moment at which a part of it was taken."""

    image: NDArray[np.uint8]
    places_px: tuple[NDArray[np.float64], ...]


@cache
def reader() -> Extractor:
    return Extractor(parse_layout(small_text("honeycomb", LAYERS)))


@cache
def shot(dx: float = 0.0, dy: float = 0.0, turn_deg: float = 11.0, push: float = 0.6) -> Taken:
    centre = ((SIZE[0] - 1) / 2 + dx, (SIZE[1] - 1) / 2 + dy)
    scene = Scene(
        layout=small_layout("honeycomb", LAYERS),
        camera=Camera(pitch_px=22.0, rotation_deg=turn_deg, centre_px=centre),
        background=Plain(BLACK_RGB),
        optics=Optics(1.0),
        sensor=Sensor(noise=2.0),
        inks=INKS,
        surface=composed(Press(4.0, push), Twist(5.0, 6.0)),
        seed=3,
    )
    rendered = render(scene, size=SIZE)
    return Taken(rendered.image, (rendered.truth.marker_xy_px,))


def torn(dx: float, dy: float) -> Taken:
    above, below = shot(), shot(dx, dy)
    image = above.image.copy()
    image[TORN_ROW:] = below.image[TORN_ROW:]
    return Taken(image, above.places_px + below.places_px)


def without_rows(count: int) -> Taken:
    whole = shot()
    image = whole.image.copy()
    image[TORN_ROW : SIZE[1] - count] = whole.image[TORN_ROW + count :]
    (places,) = whole.places_px
    return Taken(image, (places, places - (0, count)))


def wobbling(amplitude_px: float, period_px: float, turn_deg: float = 11.0) -> Taken:
    whole = shot(turn_deg=turn_deg)
    rows = np.arange(SIZE[1], dtype=np.float32)
    shift = (amplitude_px * np.sin(2 * np.pi * rows / period_px)).astype(np.float32)
    columns = np.arange(SIZE[0], dtype=np.float32)[None] - shift[:, None]
    there = np.repeat(rows[:, None], SIZE[0], axis=1)
    image = cv2.remap(whole.image, columns, there, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    places = whole.places_px[0].copy()
    places[:, 0] += amplitude_px * np.sin(2 * np.pi * places[:, 1] / period_px)
    return Taken(np.asarray(image, np.uint8), (places,))


def distances(markers: Markers, taken: Taken) -> NDArray[np.float64]:
    """(N,) squared distances of the reported markers from the truth, in stated deviations."""
    reported = np.isfinite(markers.xy_px[:, 0])
    inverse = np.linalg.inv(markers.cov_px2[reported])
    off = [(markers.xy_px - places)[reported] for places in taken.places_px]
    return np.min([np.einsum("mi,mij,mj->m", each, inverse, each) for each in off], axis=0)


@pytest.mark.parametrize(
    ("taken", "fault"),
    [
        (lambda: torn(7.0, 3.0), "torn"),
        (lambda: torn(-4.0, -7.0), "torn"),
        (lambda: torn(6.1, -7.0), "torn"),  # all markers beside the tear are uncertain
        (lambda: torn(-15.0, 3.0), "torn"),  # the upper part is not numbered
        (lambda: without_rows(2), "torn"),
        (lambda: without_rows(5), "torn"),
        (lambda: wobbling(3.0, 90.0), "rolling shutter"),
        (lambda: wobbling(2.0, 70.0), "rolling shutter"),
        (lambda: wobbling(6.0, 50.0, 0.0), "rolling shutter"),  # half of the markers contradict the others
        (lambda: wobbling(6.0, 90.0, 0.0), "rolling shutter"),  # columns jump, too
    ],
)
def test_a_break_is_found_and_covered(taken: object, fault: str) -> None:
    assert callable(taken)
    picture: Taken = taken()
    markers = reader().extract(picture.image)
    assert markers.quality is not None and markers.quality.row_fault == fault
    assert any(
        ("torn along a row" if fault == "torn" else "rolling shutter") in h for h in markers.quality.hints
    )
    squares = distances(markers, picture)
    assert len(squares) > 40 and (squares > 60).mean() < 0.04


@pytest.mark.parametrize("amplitude_px", [3.0, 6.0])
@pytest.mark.parametrize("turn_deg", [0.0, 11.0])
def test_no_marker_is_repaired_into_a_wobble(amplitude_px: float, turn_deg: float) -> None:
    """With a period of two to three edges, the rows that remain lie on a smooth map, and the dropped ones do not.

    Without the dropped ones in their covariance, up to 26 markers are repaired, 7 px off with a stated 0.3 px.
    """
    picture = wobbling(amplitude_px, 50.0, turn_deg)
    markers = reader().extract(picture.image)
    repaired = markers.status[np.isfinite(markers.xy_px[:, 0])] > Status.MEASURED
    assert distances(markers, picture)[repaired].max(initial=0.0) < 25.0


@pytest.mark.parametrize("turn_deg", [0.0, 11.0, 30.0, 47.0])
@pytest.mark.parametrize("push", [0.0, 1.0])
def test_a_surface_is_no_break(turn_deg: float, push: float) -> None:
    markers = reader().extract(shot(turn_deg=turn_deg, push=push).image)
    assert markers.quality is not None
    assert (markers.quality.row_fault, markers.quality.row_jump_px) == ("", 0.0)
    assert (markers.status == 1).all()
