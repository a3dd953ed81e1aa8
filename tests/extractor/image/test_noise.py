"""The noise of an image, by which refinement states its covariances.

Inside: covariances are checked as a whole; a wrong noise at one pitch would hide among other errors.
"""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.patterns.colors import BLACK
from extractor import parse_layout
from extractor.image.input import estimate_noise
from tests.support.layouts import small_text
from tests.support.pictures import picture


@pytest.mark.parametrize("pitch_px", [10.0, 26.0])
@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0, 10.0])
def test_noise_is_estimated_in_the_middle_of_the_cells(sigma: float, pitch_px: float) -> None:
    seen = picture(noise=0.0, pitch_px=pitch_px)
    noise = np.random.default_rng(0).normal(0, sigma, seen.image.shape)
    noisy = np.rint(seen.image * 0.6 + 50 + noise).astype(np.uint8)
    layout = parse_layout(small_text("honeycomb", 4))
    cells = layout.cell_corners[layout.cell_color != BLACK]  # as refinement takes them
    assert estimate_noise(noisy, seen.truth.marker_xy_px, cells) == pytest.approx(sigma, rel=0.12)
    assert np.isnan(estimate_noise(noisy, seen.truth.marker_xy_px + 1000, cells))
