"""Cells that look too large or too small: neither the rim nor virtual markers move."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.suites.scoring.reading import cached_extractor
from benchmarks.suites.stress.frames import CaseImage, plain_frame
from extractor import Markers


def off(markers: Markers, shot: CaseImage) -> tuple[float, float]:
    """The errors' RMS per axis, px: of the outermost layer, and of all virtual markers."""
    truth, outermost = shot.truths[0], shot.scene.layout.marker_layer == 11
    error = (markers.xy_px - truth.marker_xy_px)[outermost]
    virtual = markers.virtual_xy_px - truth.virtual_xy_px
    return float(np.sqrt(np.nanmean(error**2))), float(np.sqrt(np.nanmean(virtual**2)))


@pytest.mark.parametrize("pattern", ["honeycomb", "round"])
@pytest.mark.parametrize("response", [1.0, 5.0])
def test_an_unknown_response_moves_neither_rim_nor_virtual_markers(pattern: str, response: float) -> None:
    """Cells look larger or smaller if their values are taken for sRGB. Without correction, the rim is off by 0.5 to 1
    px, and virtual markers by 0.3 to 0.5 px."""
    shot = plain_frame(pattern, 0).with_sensor(response=response).shoot()
    rim, virtual = off(cached_extractor(pattern, 11).extract(shot.image), shot)
    assert rim < 0.12 and virtual < 0.13


@pytest.mark.parametrize("pattern, seed", [("honeycomb", 0), ("round", 2), ("elliptical", 8)])
def test_bled_inks_lose_no_rim_and_widen_no_blur(pattern: str, seed: int) -> None:
    """The elliptical pattern loses three markers without the swelling of the rim, five without the correction of
    triangles.
    """
    shot = plain_frame(pattern, seed).damaged(bleed_mm=0.1).shoot()
    markers = cached_extractor(pattern, 11).extract(shot.image)
    assert np.isnan(markers.xy_px[:, 0]).sum() <= 3
    assert off(markers, shot)[0] < 1.0
    found = markers.stages["refine"].blur_px
    assert found == pytest.approx(np.sqrt(1.0 + 1 / 3), rel=0.17)
