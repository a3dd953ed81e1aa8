"""Views of any scale, tilt and blur: as good as each other, at a bounded cost, and without a trace of those before.

Inside: no result says how many rounds a picture took, and its time depends on the machine.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

from cmpdesign.scene import Blob, Camera, Damage, Press, Rendered, Sensor, composed
from cmpdesign.scene.standard import BLACK_RGB
from extractor import Extractor, Status
from extractor.refine.refiner import Refiner
from tests.support.errors import deviations, errors_px, rms
from tests.support.standard_views import SIZE, extractor, shown

PATTERNS = ("honeycomb", "round", "elliptical")
PRESETS = ("balanced", "accurate")
PRESSED = composed(Press(5.0, 1.0))


def dirty(*places_mm: tuple[float, float]) -> Rendered:
    """Dark blobs: markers beside them take several steps."""
    return shown("honeycomb", damage=Damage(blobs=tuple(Blob(at, 0.5, BLACK_RGB) for at in places_mm)))


@pytest.mark.parametrize(("preset", "limit"), [("balanced", 0.019), ("accurate", 0.017)])
@pytest.mark.parametrize("pattern", ["honeycomb", "round"])
def test_a_larger_image_of_the_same_is_read_alike(pattern: str, preset: str, limit: float) -> None:
    """Pixels, blur and noise grow alike: the error in px of the smallest grows by as much, and is as well known."""
    for scale in (1, 2, 3):
        camera, sensor = Camera(20.0 * scale, 7.3), Sensor(noise=2.0 * scale)
        size = (SIZE[0] * scale, SIZE[1] * scale)
        seen = shown(pattern, blur=scale, size=size, camera=camera, sensor=sensor, surface=PRESSED)
        markers = extractor(pattern, preset).extract(seen.image)
        assert (markers.status == Status.MEASURED).all()
        assert rms(errors_px(markers, seen)) < limit * scale
        assert rms(deviations(markers, seen)) < 1.5


@pytest.mark.parametrize("tilt_deg", [50.0, 65.0])
@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    ("pattern", "limit_px"), [("honeycomb", 0.036), ("round", 0.036), ("elliptical", 0.1)]
)
def test_a_steep_view_is_measured(pattern: str, limit_px: float, preset: str, tilt_deg: float) -> None:
    """Some gridlines are short there, and reduced views show them badly."""
    camera = Camera(pitch_px=20.0, rotation_deg=7.3, tilt_deg=tilt_deg, tilt_axis_deg=20)
    seen = shown(pattern, camera=camera)
    markers = extractor(pattern, preset).extract(seen.image)
    assert (markers.status == Status.MEASURED).all()
    assert rms(errors_px(markers, seen)) < limit_px and rms(deviations(markers, seen)) < 2.4


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    ("pattern", "limit_px"), [("honeycomb", 0.09), ("round", 0.09), ("elliptical", 0.22)]
)
def test_where_blur_is_wide_all_is_measured(pattern: str, limit_px: float, preset: str) -> None:
    """All but two markers of the elliptical pattern's outermost layer, whose gridlines are at small angles."""
    seen, own = shown(pattern, blur=3.0), extractor(pattern, preset)
    markers = own.extract(seen.image)
    lost = np.flatnonzero(markers.status != Status.MEASURED)
    assert (own.layout.layer[lost] == own.layout.layer.max()).all()
    assert len(lost) <= 0
    limit_px = {"balanced": limit_px, "accurate": 0.055}[preset]
    assert rms(errors_px(markers, seen)) < limit_px
    assert rms(deviations(markers, seen)) < 1.85


HARD = {
    "dirty": lambda: dirty((1.5, 0.4), (-2.0, 1.5), (0.3, -2.4)),
    "all dirty": lambda: dirty(*((x, y) for x in (-3.0, -1.0, 1.0, 3.0) for y in (-3.0, -1.0, 1.0, 3.0))),
    "blurred": lambda: shown("honeycomb", blur=2.5),
    "noisy": lambda: shown("honeycomb", blur=3.0, sensor=Sensor(noise=6.0)),
}


@pytest.mark.parametrize("preset", PRESETS)
def test_no_image_takes_more_rounds_than_its_preset_allows(
    preset: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dirt, noise and blur take a first estimate, one more at another scale, and one series of steps, though they never
    let the markers rest.
    """
    by, calls = extractor("honeycomb", preset), Counter[str]()

    def count(name: str) -> None:
        own = getattr(Refiner, name)

        def counted(*arguments: Any) -> Any:
            calls[name] += 1
            return own(*arguments)

        monkeypatch.setattr(Refiner, name, counted)

    count("first_estimate")
    count("measured")
    for name, hard in HARD.items():
        calls.clear()
        assert (by.extract(hard().image).status == Status.MEASURED).mean() > 0.8
        assert calls["first_estimate"] <= 2 and calls["measured"] == 1, name


@pytest.mark.parametrize("preset", PRESETS)
def test_an_image_leaves_no_trace_in_those_after_it(preset: str) -> None:
    """Buffers are kept from image to image: other sizes, dirt and blur in between change no byte."""
    first, others = shown("honeycomb", surface=PRESSED), [dirty((-2.0, 1.5)), shown("honeycomb", blur=2.5)]
    smaller = shown("honeycomb", size=(140, 120), camera=Camera(16.0, 50.0))
    by = Extractor(extractor("honeycomb").layout, preset)  # type: ignore[arg-type]
    fresh = by.extract(first.image)
    for other in (*others, smaller):
        by.extract(other.image)
        again = by.extract(first.image)
        for name in ("xy_px", "cov_px2", "virtual_xy_px", "virtual_cov_px2", "status"):
            assert getattr(again, name).tobytes() == getattr(fresh, name).tobytes(), name


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_most_accurate_preset_is_the_most_accurate(pattern: str) -> None:
    """Over several noises, each preset is at least as good as the preset before."""
    found = {}
    for preset in PRESETS:
        errors = []
        for seed in range(4):
            seen = shown(pattern, surface=PRESSED, seed=seed)
            errors.append(errors_px(extractor(pattern, preset).extract(seen.image), seen))
        found[preset] = rms(np.concatenate(errors))
    assert found["accurate"] < 1.02 * found["balanced"]
