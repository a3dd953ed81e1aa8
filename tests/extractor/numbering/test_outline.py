"""The outline determines the numbering if the white cell is hidden."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.patterns.colors import BLACK, WHITE
from extractor import Origin, Status
from tests.support.layouts import small_layout
from tests.support.pictures import extractor, recolored, scene_of

LAYERS = 7


@pytest.mark.parametrize("missing", [0, 12])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_the_outline_leaves_one_way(pattern: str, missing: int) -> None:
    """At any rotation, from either side, with missing inner cells."""
    layout = small_layout(pattern, LAYERS)
    white = int(np.flatnonzero(layout.cell_color == WHITE)[0])
    inner = np.flatnonzero(
        (layout.cell_color < BLACK) & (layout.marker_layer[layout.cell_corners].max(axis=1) < 5)
    )
    for seed in range(8):
        rng = np.random.default_rng(seed)
        gone = [white, *rng.choice(inner, missing, replace=False).tolist()]
        mirrored = bool(seed % 2)
        seen = scene_of(
            recolored(layout, dict.fromkeys(gone, BLACK)), 17.0, float(rng.uniform(0, 360)), mirrored
        )
        markers = extractor(pattern, LAYERS).extract(seen.image)
        assert markers.origin is Origin.OUTLINE and markers.mirrored is mirrored
        error = np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1)
        assert np.nanmax(error) < 1.5 and (markers.status != Status.LOST).mean() > 0.9
