"""Results have the same bits on every processor, in one thread and in two.

Inside: a processor has one width of vectors, and only a switch shows what other processors compute; loops run in two
threads for patterns of 75 layers and more, which take seconds to draw.
"""

from __future__ import annotations

import pytest

from extractor import Extractor, Markers
from extractor.numeric.processor import use_parts_from, use_widest_vectors
from extractor.presets import PRESETS, Preset
from tests.support.pictures import extractor, picture


@pytest.mark.parametrize("preset", PRESETS)
def test_the_width_of_vectors_changes_no_bit(preset: Preset) -> None:
    reader, image = Extractor(extractor("honeycomb").layout, preset), picture("honeycomb").image
    try:
        if not use_widest_vectors(False):
            pytest.skip("this processor has one width of vectors")
        expected = reader.extract(image)
    finally:
        use_widest_vectors(True)
    assert bits(reader.extract(image)) == bits(expected)


@pytest.mark.parametrize("preset", PRESETS)
def test_two_threads_change_no_bit(preset: Preset) -> None:
    reader, image = Extractor(extractor("honeycomb").layout, preset), picture("honeycomb").image
    expected, usual = reader.extract(image), use_parts_from(2)
    try:
        found = reader.extract(image)
    finally:
        use_parts_from(usual)
    assert bits(found) == bits(expected) and usual > 10_000


def bits(markers: Markers) -> list[bytes]:
    """Positions and covariances."""
    names = ("xy_px", "cov_px2", "virtual_xy_px", "virtual_cov_px2")
    return [getattr(markers, name).tobytes() for name in names]
