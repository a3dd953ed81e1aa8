"""Results have the same bits on every processor.

Inside: a processor has one width of vectors, and only a switch shows what other processors compute.
"""

from __future__ import annotations

import pytest

from extractor import Extractor
from extractor.numeric.processor import use_widest_vectors
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
    found = reader.extract(image)
    for name in ("xy_px", "cov_px2", "virtual_xy_px", "virtual_cov_px2"):
        assert getattr(found, name).tobytes() == getattr(expected, name).tobytes()
