"""The side in an image: an unexpected side is refused with a reason, and never numbered wrongly."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor import Extractor, FrameStatus, Reason, Reference, Tracker, parse_layout
from tests.support.layouts import small_text
from tests.support.pictures import picture

SIDES = ("front", "back")
MAX_ERROR_PX = 0.3


@cache
def layout(mirrored: bool = False) -> Reference:
    plain = parse_layout(small_text("honeycomb", 4))
    return replace(plain, parameters={**plain.parameters, "mirrored": mirrored})


@cache
def by(mirrored: bool = False, **options: Any) -> Extractor:
    return Extractor(layout(mirrored), **options)


def swapped(image: NDArray[Any]) -> NDArray[Any]:
    """Red and blue exchanged."""
    return image[:, :, [2, 1, 0, *range(3, image.shape[2])]]


@pytest.mark.parametrize("shows", SIDES)
@pytest.mark.parametrize("side", ["designed", "front", "back", "either"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_only_the_stated_side_is_read(mirrored: bool, side: str, shows: str) -> None:
    shot = picture(mirrored=shows == "back")
    markers = by(mirrored, side=side).extract(shot.image)
    stated = {"designed": SIDES[mirrored], "either": shows}.get(side, side)
    if stated == shows:
        assert markers.reason is None and markers.mirrored is (shows == "back")
        assert np.abs(markers.xy_px - shot.truth.marker_xy_px).max() < MAX_ERROR_PX
    else:
        assert not markers.found and np.isnan(markers.xy_px).all() and markers.mirrored is None
        assert markers.reason is Reason.MIRRORED and "mirrored camera" in markers.reason.text


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
@pytest.mark.parametrize("rotation_deg", [17, 100, 250])
def test_an_rgb_image_is_refused_and_named(pattern: str, rotation_deg: float) -> None:
    shot = picture(pattern, rotation_deg=rotation_deg)
    markers = Extractor(parse_layout(small_text(pattern, 4))).extract(swapped(shot.image))
    assert not markers.found and markers.reason is Reason.SWAPPED_CHANNELS
    assert any("BGR" in sentence for sentence in markers.advice)


def test_rgb_is_read_as_bgr_is() -> None:
    image = picture().image
    deep, alpha = image.astype(np.uint16) * 257, np.full((*image.shape[:2], 1), 9, np.uint8)
    for one in (image, deep, deep.astype(">u2"), np.concatenate([image, alpha], axis=2), image[::2, ::2]):
        read, other = by().extract(one), by(channels="rgb").extract(swapped(one))
        assert other.xy_px.tobytes() == read.xy_px.tobytes() and other.found


def test_a_tracker_follows_the_stated_side_and_channels() -> None:
    image = picture().image
    frame = Tracker(layout()).track(swapped(image))
    assert frame.status is FrameStatus.LOST and frame.reason == "swapped_channels"
    tracker = Tracker(layout(), channels="rgb")
    usual = Tracker(layout())
    for _ in range(2):
        frame, other = tracker.track(swapped(image)), usual.track(image)
        assert frame.status is FrameStatus.TRACKED and frame.start is other.start
        assert frame.markers.xy_px.tobytes() == other.markers.xy_px.tobytes()
    back = picture(mirrored=True).image
    assert Tracker(layout()).track(back).status is FrameStatus.LOST
    assert Tracker(layout(), side="back").track(back).status is FrameStatus.TRACKED


def test_copies_keep_side_and_channels() -> None:
    shot = picture(mirrored=True)
    copy = pickle.loads(pickle.dumps(by(side="back", channels="rgb")))
    assert copy.extract(swapped(shot.image)).mirrored is True
    assert not copy.extract(swapped(picture().image)).found


@pytest.mark.parametrize("options", [{"side": "left"}, {"channels": "gbr"}])
def test_unknown_options_are_refused(options: dict[str, Any]) -> None:
    (name, value) = next(iter(options.items()))
    with pytest.raises(ValueError, match=f"{name} is '{value}'; give one of"):
        Extractor(layout(), **options)
