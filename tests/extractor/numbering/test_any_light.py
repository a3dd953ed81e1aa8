"""Ids and side in any light: the reader asks neither for the color of the light nor for hues."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.scene import Truth
from extractor import Extractor, Reason, Status, parse_layout
from tests.support.layouts import small_text
from tests.support.pictures import picture, srgb_light, srgb_values

Image = NDArray[np.uint8]
READER = Extractor(parse_layout(small_text("honeycomb", 4)))


def lit(image: Image, gains: NDArray[np.float64], black: int = 0, paleness: float = 0.0) -> Image:
    """The image with paler inks, over a lifted black, each channel multiplied by a gain, B, G, R."""
    pale = image * (1 - paleness) + paleness * image.max(axis=2, keepdims=True)
    return np.clip(np.rint(black + pale * (255 - black) / 255 * gains), 0, 255).astype(np.uint8)


def assert_ids_are_right(image: Image, truth: Truth, least: float) -> None:
    markers = READER.extract(image)
    found = markers.status == Status.MEASURED
    assert found.mean() >= least
    assert np.linalg.norm(markers.xy_px - truth.marker_xy_px, axis=1)[found].max() < 1.0


@settings(max_examples=20, deadline=None)
@given(
    first=st.integers(0, 2),
    second=st.integers(1, 2),
    weak=st.floats(0.1, 1.0),
    middle=st.floats(0.25, 1.0),
    black=st.integers(0, 110),
    paleness=st.floats(0.0, 0.4),
)
def test_ids_are_the_same_in_any_light(
    first: int, second: int, weak: float, middle: float, black: int, paleness: float
) -> None:
    gains = np.ones(3)
    gains[first], gains[(first + second) % 3] = weak, middle
    seen = picture()
    assert_ids_are_right(lit(seen.image, gains, black, paleness), seen.truth, 1.0)


@pytest.mark.parametrize("turn_deg", [0, 75, 150, 225, 300])
def test_three_lamps_around_the_pad_move_the_hues_and_not_the_ids(turn_deg: int) -> None:
    """A red, a green and a blue lamp at three sides: across the pad the light of each falls to a third."""
    seen = picture(noise=0.0)
    height, width = seen.image.shape[:2]
    y, x = np.mgrid[:height, :width]
    lamps = np.radians(turn_deg + np.array([0, 120, 240]))
    along = np.stack([(x - width / 2) * np.cos(a) + (y - height / 2) * np.sin(a) for a in lamps], axis=2)
    light = srgb_light(seen.image) * np.exp(along * np.log(3.0) / 240.0) * 0.6
    noise = np.random.default_rng(turn_deg).normal(0, 2, seen.image.shape)
    image = np.clip(np.rint(srgb_values(light) + noise), 0, 255).astype(np.uint8)
    assert_ids_are_right(image, seen.truth, 0.97)


@pytest.mark.parametrize("surround", [(90, 130, 200), (200, 200, 200), (60, 90, 130)])
def test_a_surround_does_not_change_the_ids(surround: tuple[int, int, int]) -> None:
    """Of one color and with a texture, over four times the pattern's area."""
    seen = picture()
    colored = lit(seen.image, np.array([0.3, 1.0, 1.0]))
    height, width = colored.shape[:2]
    wide = np.zeros((2 * height, 2 * width, 3), np.uint8)
    texture = 1 + 0.1 * np.random.default_rng(1).standard_normal((*wide.shape[:2], 1))
    wide[:] = np.clip(np.array(surround) * texture, 0, 255)
    wide[:height, :width] = colored
    assert_ids_are_right(wide, seen.truth, 1.0)


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.0), (0.2, 1.0, 1.0), (1.0, 0.3, 0.5)])
def test_the_other_side_is_refused_in_any_light(gains: tuple[float, float, float]) -> None:
    """Swapped channels show the same order of inks; colored light may leave open which of the two it is."""
    image = lit(picture().image, np.array(gains))
    others = {Reason.MIRRORED, Reason.SWAPPED_CHANNELS, Reason.OTHER_SIDE}
    for other, excluded in ((image[:, ::-1], Reason.SWAPPED_CHANNELS), (image[..., ::-1], Reason.MIRRORED)):
        markers = READER.extract(other)
        assert (markers.status == Status.LOST).all()
        assert markers.reason in others - {excluded}
