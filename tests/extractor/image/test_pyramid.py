"""Reduced images: the values of the mean light of squares of pixels.

Inside: a mean that is rounded to the wrong side moves markers by less than their noise.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor.image.pyramid import Pyramid
from extractor.image.response import (
    Response,
    decode_values,
    encode_light,
    light_of_values,
    response_tables,
)

SCALES = [1, 2, 3, 4, 7, 17]
SIZES = [(60, 84), (59, 71)]


def noise_and_white(scale: int, size: tuple[int, int]) -> NDArray[np.uint8]:
    image = np.random.default_rng(scale).integers(0, 256, (*size, 3)).astype(np.uint8)
    image[:20, :20] = 255
    return image


def squares(image: NDArray[np.uint8], scale: int) -> NDArray[np.uint8]:
    """(h, scale, w, scale, 3): the image cut into squares, without the rest at its right and bottom."""
    height, width = image.shape[0] // scale, image.shape[1] // scale
    return image[: height * scale, : width * scale].reshape(height, scale, width, scale, 3)


def reduced(image: NDArray[np.uint8], scale: int, response: Response) -> NDArray[np.uint8]:
    return Pyramid(image, response_tables(light_of_values(response))).level(scale).image


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("response", ["srgb", "linear", 0.45, 2.2])
def test_a_reduced_image_has_the_mean_light(scale: int, size: tuple[int, int], response: Response) -> None:
    """Half a value, and half a step of light (255 / 16383) in each pixel and in their mean."""
    image, light = noise_and_white(scale, size), light_of_values(response)
    mean = decode_values(squares(image, scale), light).mean(axis=(1, 3))
    found = reduced(image, scale, response)
    step = 255.0 / 16383
    low, high = (encode_light(np.maximum(mean + k * step, 0.0), light) for k in (-1.01, 1.01))
    assert (found > low - 0.5001).all() and (found < high + 0.5001).all()
    if scale > 1 and response != "linear":
        of_values = squares(image, scale).mean(axis=(1, 3))
        assert np.abs(found - of_values).mean() > 2  # they are no means of values


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("response", ["srgb", "linear", 0.45, 2.2])
def test_what_is_flat_keeps_its_values(scale: int, response: Response) -> None:
    """At an exponent of 2.2, the values 1 and 2 have less than half a step of light."""
    values = np.arange(256, dtype=np.uint8)
    values[1:3] = 0 if response == 2.2 else values[1:3]
    image = np.repeat(np.repeat(values[None, :, None], scale, axis=1), scale, axis=0).repeat(3, axis=2)
    np.testing.assert_array_equal(reduced(image, scale, response)[0, :, 0], values)
