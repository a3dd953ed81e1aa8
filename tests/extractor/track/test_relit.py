"""A frame in another light starts from the levels of the frame before, changed as light changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Light, render, standard_layout, standard_scene
from extractor import Extractor, Tracker, parse_layout


@pytest.mark.parametrize("gain", [0.5, 0.8, 1.2])
def test_levels_follow_the_light(gain: float) -> None:
    layout = standard_layout("honeycomb", 6)
    reference = parse_layout(layout_to_json(layout))
    tracker, images = Tracker(reference), []
    for factor in (1.0, gain):
        scene = replace(standard_scene(layout), light=Light(rgb=(factor, factor, factor)))
        images.append(np.asarray(render(scene).image, np.uint8))
    frames = [tracker.track(image) for image in images]
    now = Extractor(reference).extract(images[1]).stages["refine"].appearance
    relit = now._replace(levels=frames[1].markers.stages["prove"].ink_levels)
    assert frames[1].start == "warm"
    assert np.median(np.abs(relit.levels.cell - now.levels.cell)) < 0.02 * np.median(
        now.levels.cell.max(axis=1)
    )
    assert relit.is_similar(now)
