"""Reduced views: their pixels, and what goes from a fine one to a coarse one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmpdesign.scene import Camera
from extractor import Status
from extractor.image.pyramid import Pyramid, PyramidLevel
from extractor.refine import refiner as refine
from extractor.refine.estimate import Estimate
from extractor.refine.synthesis_steps import SynthesisSolver
from tests.support.standard_views import extractor, shown


@pytest.fixture
def drawings(monkeypatch: pytest.MonkeyPatch) -> list[tuple[PyramidLevel, Estimate]]:
    """Filled with the view and the fit of everything that is drawn as a whole."""
    seen: list[tuple[PyramidLevel, Estimate]] = []
    plain = SynthesisSolver._full_step

    def first(self: SynthesisSolver, view: PyramidLevel, fit: Estimate) -> Any:
        seen.append((view, fit))
        return plain(self, view, fit)

    monkeypatch.setattr(SynthesisSolver, "_full_step", first)
    return seen


@pytest.mark.parametrize("scale", [2, 3, 4, 7])
def test_a_reduced_image_holds_means(scale: int) -> None:
    image = np.random.default_rng(scale).integers(0, 256, (61, 83, 3), np.uint8)
    height, width = 61 // scale, 83 // scale
    whole = image[: height * scale, : width * scale].astype(float)
    means = whole.reshape(height, scale, width, scale, 3).mean(axis=(1, 3))
    np.testing.assert_array_equal(Pyramid(image).at(scale).image, np.floor(means + 0.5).astype(np.uint8))


def test_a_coarser_view_starts_where_the_finer_one_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    passed: list[Any] = []
    rescaled, magnified = refine.rescaled, refine.rescaled_contrasts

    def kept(*given: Any) -> Any:
        passed.append((given, rescaled(*given)))
        return passed[-1][1]

    def kept_wide(*given: Any) -> Any:
        passed.append((given, magnified(*given)))
        return passed[-1][1]

    monkeypatch.setattr(refine, "rescaled", kept)
    monkeypatch.setattr(refine, "rescaled_contrasts", kept_wide)
    extractor("honeycomb").extract(shown("honeycomb", blur=2.0).image)
    ((fit, finer, view), now), ((sides, _), beside) = passed
    assert view.scale > finer.scale
    np.testing.assert_allclose(view.to_full_scale(now.measured), finer.to_full_scale(fit.measured))
    np.testing.assert_allclose(view.scale * now.maps, finer.scale * fit.maps)
    np.testing.assert_allclose(view.scale * beside.clearance[:, 0], finer.scale * sides.clearance[:, 0])
    # a pixel of the coarser view adds more to the blur
    assert (
        view.scale * now.sigma == pytest.approx(2.0, abs=0.4)
        and now.sigma * view.scale > fit.sigma * finer.scale
    )


def test_a_fit_comes_back_from_another_view(drawings: list[tuple[PyramidLevel, Estimate]]) -> None:
    image = shown("honeycomb", blur=2.0).image
    extractor("honeycomb").extract(image)
    view, fit = drawings[0]
    fit = fit._replace(bend=np.full_like(fit.bend, 0.2), dot_gain=0.3)
    finer = Pyramid(image).at(1)
    away = refine.rescaled(fit, view, finer)
    # what is a length there is as long in the full image, and information is by the square of one
    for name in ("maps", "bend", "swelling"):
        np.testing.assert_allclose(getattr(away, name), view.scale * getattr(fit, name))
    np.testing.assert_allclose(away.levels.slope, fit.levels.slope / view.scale)
    for one, other in zip(fit.information, away.information, strict=True):
        np.testing.assert_allclose(other, one / view.scale**2)
    back = refine.rescaled(away, finer, view)
    for one, other in zip(fit, back, strict=True):
        if isinstance(one, np.ndarray | float):
            np.testing.assert_allclose(one, other, rtol=1e-9)


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_where_few_gridlines_are_short_the_first_step_is_coarse(
    pattern: str, drawings: list[tuple[PyramidLevel, Estimate]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a steep view, full pixels are drawn once; what comes of it is no worse than what comes of two such steps."""

    def scales() -> list[int]:
        return [view.scale for view, _ in drawings]

    def error(seen: Any) -> float:
        drawings.clear()
        found = extractor(pattern).extract(seen.image)
        assert (found.status == Status.MEASURED).mean() > 0.9
        off = np.linalg.norm(found.xy_px - seen.truth.marker_xy_px, axis=1)
        return float(np.sqrt(np.nanmean(off**2)))

    steep = shown(pattern, camera=Camera(pitch_px=20.0, rotation_deg=7.3, tilt_deg=65, tilt_axis_deg=20))
    coarse = error(steep)
    assert scales() == [2, 1]
    (_, first), (_, then) = drawings
    assert not (first.roughness.any() or first.bend.any()) and then.roughness.any()  # far off, none may bend
    monkeypatch.setattr(refine, "COARSE_EDGE_PX", np.inf)
    assert coarse < 1.25 * error(steep)
    assert scales() == [1, 1]
    error(shown(pattern))
    assert 1 not in scales()  # in a plain frame all gridlines are long enough for half the pixels


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_where_blur_is_wide_gridlines_stay_straight_and_few_steps_do(
    pattern: str, drawings: list[tuple[PyramidLevel, Estimate]]
) -> None:
    seen = shown(pattern, blur=3.0)
    markers = extractor(pattern).extract(seen.image)
    assert len(drawings) <= 3
    assert not any(fit.roughness.any() or fit.bend.any() for _, fit in drawings)
    off = np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1)
    assert np.sqrt(np.nanmean(off**2)) < 0.2
