"""A frame in another light starts from the levels of the frame before, changed as light changes.

Inside: the appearance of a frame, and the levels of its cells.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Light, render, standard_layout, standard_scene
from extractor import parse_layout
from extractor.pipeline import ImageReader
from extractor.track.warm_start import seen_cells
from extractor.track.warm_tables import build_warm_tables


@pytest.mark.parametrize("gain", [0.5, 0.8, 1.2])
def test_levels_follow_the_light(gain: float) -> None:
    layout = standard_layout("honeycomb", 6)
    reference = parse_layout(layout_to_json(layout))
    reader, tables = ImageReader(reference), build_warm_tables(reference)
    looks, light = [], []
    for factor in (1.0, gain):
        scene = replace(standard_scene(layout), light=Light(rgb=(factor, factor, factor)))
        image = np.asarray(render(scene).image, np.uint8)
        read = reader.read(image)
        looks.append(read.appearance)
        pyramid = reader.pyramid(image)
        assert pyramid is not None
        light.append(seen_cells(pyramid.level(1), read.markers.xy_px, tables).light)
    before, now = looks
    assert before is not None and now is not None
    relit = before.with_lighting(*light)
    assert np.median(np.abs(relit.levels.cell - now.levels.cell)) < 0.02 * np.median(
        now.levels.cell.max(axis=1)
    )
    assert relit.is_similar(now)
