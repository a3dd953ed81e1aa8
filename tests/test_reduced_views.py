"""Reduced views: their pixels, and what goes from a fine one to a coarse one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_drawing import extractor, shown

from extractor import refine
from extractor.drawing import Draughtsman
from extractor.fit import Fit
from extractor.sight import Sights


@pytest.mark.parametrize("scale", [2, 3, 4, 7])
def test_a_reduced_image_holds_means(scale: int) -> None:
    image = np.random.default_rng(scale).integers(0, 256, (61, 83, 3), np.uint8)
    height, width = 61 // scale, 83 // scale
    whole = image[: height * scale, : width * scale].astype(float)
    means = whole.reshape(height, scale, width, scale, 3).mean(axis=(1, 3))
    np.testing.assert_array_equal(Sights(image).at(scale).image, np.floor(means + 0.5).astype(np.uint8))


def test_a_coarser_view_starts_where_the_finer_one_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    passed: list[Any] = []
    plain = refine.coarser

    def kept(*given: Any) -> Any:
        found = plain(*given)
        passed.append((given, found))
        return found

    monkeypatch.setattr(refine, "coarser", kept)
    extractor("honeycomb").extract(shown("honeycomb", blur=2.0).image)
    (fit, sides, finer, view), (now, beside) = passed[0]
    assert view.scale > finer.scale
    np.testing.assert_allclose(view.full(now.measured), finer.full(fit.measured))
    np.testing.assert_allclose(view.scale * now.maps, finer.scale * fit.maps)
    np.testing.assert_allclose(view.scale * beside.room[:, 0], finer.scale * sides.room[:, 0])
    # a pixel of the coarser view adds more to the blur
    assert (
        view.scale * now.sigma == pytest.approx(2.0, abs=0.4)
        and now.sigma * view.scale > fit.sigma * finer.scale
    )


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_where_blur_is_wide_gridlines_stay_straight_and_few_steps_do(
    pattern: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[Fit] = []
    plain = Draughtsman._first

    def first(self: Draughtsman, view: Any, fit: Fit) -> Any:
        taken.append(fit)
        return plain(self, view, fit)

    monkeypatch.setattr(Draughtsman, "_first", first)
    seen = shown(pattern, blur=3.0)
    markers = extractor(pattern).extract(seen.image)
    assert len(taken) <= 3
    assert not any(fit.rough.any() or fit.bend.any() for fit in taken)
    off = np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1)
    assert np.sqrt(np.nanmean(off**2)) < 0.2
