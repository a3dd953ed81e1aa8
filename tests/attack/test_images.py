"""Pictures that nobody takes: every array of the right kind is read without an error, and what is found is finite.

The slow test reads 2,000 of them; ``make test-sanitized`` runs it with every index and address checked.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from extractor import Extractor, parse_layout
from tests.support.layouts import small_text
from tests.support.pictures import picture as shot


@pytest.fixture(scope="module")
def extractor() -> Extractor:
    return Extractor(parse_layout(small_text()))


@pytest.fixture(scope="module")
def picture() -> Any:
    return shot(layers=2).image


def hostile(picture: Any, rng: np.random.Generator) -> Any:
    """A picture of the pattern that was cut, folded, swapped, scaled, or is none at all."""
    image = picture
    for _ in range(int(rng.integers(1, 4))):
        height, width = image.shape[:2]
        match int(rng.integers(10)):
            case 0:  # a part, down to the smallest that is read
                top, left = int(rng.integers(height - 15)), int(rng.integers(width - 15))
                image = image[
                    top : top + int(rng.integers(16, 400)), left : left + int(rng.integers(16, 400))
                ]
            case 1:  # rows of another picture
                image = image[rng.permutation(height)] if rng.random() < 0.3 else np.roll(image, 7, axis=0)
            case 2:
                image = rng.integers(0, 256, image.shape, dtype=np.uint8)
            case 3:  # one value
                image = np.full_like(image, rng.integers(0, 256))
            case 4:  # few values
                image = image // np.uint8(128) * np.uint8(255)
            case 5:
                image = image[:, :, rng.permutation(3)]
            case 6:  # a checkerboard of pixels
                image = image.copy()
                image[::2, ::2] = rng.integers(0, 256, 3)
            case 7:
                image = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[:600, :600]
            case 8:  # every pixel with noise
                image = np.clip(image + rng.normal(0, 40, image.shape), 0, 255).astype(np.uint8)
            case _:  # the pattern many times
                image = np.tile(image[:: rng.integers(1, 3), :: rng.integers(1, 3)], (2, 2, 1))[:600, :600]
    image = np.ascontiguousarray(image)
    return image.astype(np.uint16) * np.uint16(257) if rng.random() < 0.2 else image


def attack(extractor: Extractor, picture: Any, count: int, seed: int) -> int:
    """How many of the pictures gave a marker."""
    rng, found = np.random.default_rng(seed), 0
    for _ in range(count):
        markers = extractor.extract(hostile(picture, rng))
        known = markers.status > 0
        assert np.isfinite(markers.xy_px[known]).all() and np.isnan(markers.xy_px[~known]).all()
        assert (np.linalg.eigvalsh(markers.cov_px2[known]) >= 0).all()
        assert markers.found or markers.reason is not None
        found += bool(known.any())
    return found


def test_any_picture_is_read_or_has_a_reason(extractor: Extractor, picture: Any) -> None:
    assert 5 < attack(extractor, picture, 80, seed=1) < 75


@pytest.mark.slow
def test_2000_pictures_are_read_or_have_a_reason(extractor: Extractor, picture: Any) -> None:
    assert attack(extractor, picture, 2000, seed=2) > 100
