"""The light's color is taken from an image: ids in any light, and the limits of the fields of gains.

Inside: recognition alone sees the corrected image, and markers hide where its fields are wrong.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from extractor import Extractor, Status, parse_layout
from extractor.image.grey_card import LIMITS, GreyCard, find_grey_card, remove_light_color
from tests.support.layouts import small_text
from tests.support.pictures import picture

Image = NDArray[np.uint8]
READER = Extractor(parse_layout(small_text("honeycomb", 4)))


def lit(image: Image, gains: tuple[float, ...], black: int = 0, paleness: float = 0.0) -> Image:
    """The image with paler inks, over a lifted black, each channel multiplied by a gain, B, G, R."""
    pale = image * (1 - paleness) + paleness * image.max(axis=2, keepdims=True)
    over = pale * (255 - black) / 255 * np.array(gains)
    return np.clip(np.rint(black + over), 0, 255).astype(np.uint8)


def assert_all_ids_are_right(image: Image) -> None:
    truth = picture().truth.marker_xy_px
    markers = READER.extract(image)
    assert (markers.status == Status.MEASURED).all()
    assert np.linalg.norm(markers.xy_px - truth, axis=1).max() < 1.0


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
    gains = [1.0, 1.0, 1.0]
    gains[first], gains[(first + second) % 3] = weak, middle
    assert_all_ids_are_right(lit(picture().image, (gains[0], gains[1], gains[2]), black, paleness))


def test_in_white_light_the_image_stays_the_same() -> None:
    image = picture().image
    card = find_grey_card(image, 1)
    assert card.is_white and 1.0 <= card.ratio < 1.3
    assert (card.gain == 1.0).all() and (card.offset == 0.0).all()
    assert remove_light_color(image, card, 1) is image


@pytest.mark.parametrize("gains", [(0.2, 1.0, 1.0), (1.0, 0.3, 0.5)])
def test_what_was_grey_is_grey_again(gains: tuple[float, float, float]) -> None:
    """But for the part of the ratio that is left to the inks."""
    plain = picture().image
    colored = lit(plain, gains)
    found = remove_light_color(colored, find_grey_card(colored, 1), 1).astype(float)
    white = (plain.min(axis=2) > 180) & (found.max(axis=2) < 255)
    assert white.sum() > 20
    ratio = found[white].max(axis=1) / found[white].min(axis=1)
    assert np.median(ratio) < LIMITS.ink_ratio * 1.15
    assert np.median(colored[white].max(axis=1) / colored[white].min(axis=1)) > 2.5


@pytest.mark.parametrize("surround", [(90, 130, 200), (200, 200, 200), (60, 90, 130)])
def test_a_surround_does_not_change_the_light(surround: tuple[int, int, int]) -> None:
    """Of one color and with a texture, over four times the pattern's area."""
    seen = lit(picture().image, (0.3, 1.0, 1.0))
    height, width = seen.shape[:2]
    wide = np.zeros((2 * height, 2 * width, 3), np.uint8)
    texture = 1 + 0.1 * np.random.default_rng(1).standard_normal((*wide.shape[:2], 1))
    wide[:] = np.clip(np.array(surround) * texture, 0, 255)
    wide[:height, :width] = seen
    alone, amid = find_grey_card(seen, 1), find_grey_card(wide, 1)
    assert amid.ratio == pytest.approx(alone.ratio, rel=0.1)
    y, x = (np.array(seen.shape[:2]) // 16).tolist()
    np.testing.assert_allclose(amid.gain[:, y, x], alone.gain[:, y, x], rtol=0.1)


def test_fields_follow_the_light_across_the_image() -> None:
    """Blue fades to a fifth from left to right: the gain of blue rises about as much."""
    image = picture().image.astype(float)
    fading = np.linspace(1.0, 0.2, image.shape[1])
    image[..., 0] *= fading[None, :]
    card = find_grey_card(np.rint(image).astype(np.uint8), 1)
    rows, columns = card.gain.shape[1:]
    left, right = card.gain[0, rows // 2, columns // 4], card.gain[0, rows // 2, 3 * columns // 4]
    assert 1.3 < right / left < 2.5


def test_values_are_stretched_rounded_and_clipped() -> None:
    ones = np.ones((3, 2, 3), np.float32)
    card = GreyCard(ones * np.float32(1.75), ones * np.float32(-20.3), 8, 2.0)
    image = np.random.default_rng(2).integers(0, 256, (16, 24, 3), np.uint8)
    expected = np.clip(np.floor(np.clip(image * 1.75 - 20.3, 0, 255) + 0.5), 0, 255)
    np.testing.assert_array_equal(remove_light_color(image, card, 1), expected)


def test_fields_lie_alike_at_every_scale() -> None:
    """A field that is linear in x is the same function of the place in the full image, but for its rims."""
    gain = np.ones((3, 4, 6), np.float32) + np.arange(6, dtype=np.float32)[None, None, :]
    card = GreyCard(gain, np.zeros_like(gain), 24, 9.0)
    for scale in (1, 2, 3):
        image = np.full((96 // scale, 144 // scale, 3), 20, np.uint8)
        full_x = (np.arange(image.shape[1]) + 0.5) * scale - 0.5
        expected = 20 * (1 + np.clip((full_x + 0.5) / 24 - 0.5, 0, 5))
        found = remove_light_color(image, card, scale)
        assert np.abs(found[10 // scale] - expected[:, None]).max() <= 0.51


@pytest.mark.parametrize("level", [0, 128, 255])
def test_without_a_pattern_the_light_counts_as_white(level: int) -> None:
    for shape in ((16, 16, 3), (17, 300, 3), (480, 640, 3)):
        image = np.full(shape, level, np.uint8)
        card = find_grey_card(image, 1)
        assert card.ratio == 1.0 and remove_light_color(image, card, 1) is image
