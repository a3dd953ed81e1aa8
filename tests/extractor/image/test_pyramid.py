"""Reduced images: means of squares of pixels.

Inside: a mean that is rounded to the wrong side moves markers by less than their noise.
"""

from __future__ import annotations

import numpy as np
import pytest

from extractor.image.pyramid import Pyramid


@pytest.mark.parametrize("scale", [1, 2, 3, 4, 7, 17])
@pytest.mark.parametrize("size", [(60, 84), (59, 71)])
def test_a_reduced_image_is_of_means(scale: int, size: tuple[int, int]) -> None:
    image = np.random.default_rng(scale).integers(0, 256, (*size, 3)).astype(np.uint8)
    image[:20, :20] = 255
    height, width = size[0] // scale, size[1] // scale
    whole = image[: height * scale, : width * scale].reshape(height, scale, width, scale, 3)
    sums = whole.astype(np.int64).sum(axis=(1, 3))
    np.testing.assert_array_equal(Pyramid(image).level(scale).image, (2 * sums + scale**2) // (2 * scale**2))
