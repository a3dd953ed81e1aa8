"""The quality of images against their scenes, and reasons where few markers are reported."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.scene import Camera, Light, Optics, Rendered, Scene, Sensor, render
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Extractor, Markers, Quality, Reason, Status, Tracker, parse_layout
from tests.support.layouts import small_layout, small_text
from tests.support.pictures import SIZE, picture, srgb_light, srgb_values

LAYERS = 4
GOOD = Quality(1.0, 2.0, 50.0, ("blue", "black"), 0.0, 0.9, 20.0)


@cache
def extractor() -> Extractor:
    return Extractor(parse_layout(small_text("honeycomb", LAYERS)))


def shot(
    light: Light | None = None, blur: float = 1.0, noise: float = 2.0, pitch_px: float = 26.0
) -> Rendered:
    scene = Scene(
        small_layout("honeycomb", LAYERS),
        camera=Camera(pitch_px, 17.0),
        light=light,
        optics=Optics(blur),
        sensor=Sensor(noise=noise),
        inks=INKS,
    )
    return render(scene, size=SIZE)


def read(image: NDArray[np.uint8]) -> Markers:
    return extractor().extract(image)


def quality_of(image: NDArray[np.uint8]) -> Quality:
    quality = read(image).quality
    assert quality is not None
    return quality


def exposed(image: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    return np.rint(srgb_values(np.minimum(factor * srgb_light(image), 255))).astype(np.uint8)


@pytest.mark.parametrize(
    ("blur", "noise", "pitch_px"), [(0.8, 1.0, 28.0), (1.5, 4.0, 22.0), (2.5, 2.0, 26.0)]
)
def test_blur_noise_and_scale_are_the_scenes(blur: float, noise: float, pitch_px: float) -> None:
    quality = quality_of(shot(blur=blur, noise=noise, pitch_px=pitch_px).image)
    assert quality.blur_px == pytest.approx(np.sqrt(blur**2 + 1 / 12), rel=0.05)
    assert quality.noise == pytest.approx(noise, rel=0.25)
    assert quality.edge_px == pytest.approx(pitch_px, rel=0.01)
    assert not quality.hints


def test_contrast_is_the_difference_of_the_two_nearest_inks() -> None:
    quality = quality_of(shot(blur=0.6, noise=0).image)
    colors = {**{name: INKS[name] for name in ("red", "green", "blue")}, "black": BLACK_RGB}
    lab = {
        name: cv2.cvtColor(np.float32([[rgb]]) / 255, cv2.COLOR_RGB2LAB)[0, 0].astype(float)
        for name, rgb in colors.items()
    }
    pairs = {(a, b): float(np.linalg.norm(lab[a] - lab[b])) for a in lab for b in lab if a < b}
    nearest = min(pairs, key=lambda pair: pairs[pair])
    assert quality.contrast == pytest.approx(pairs[nearest], rel=0.04)
    assert set(quality.weakest_inks) == set(nearest)


def test_dim_light_lowers_the_contrast() -> None:
    image = shot().image
    assert quality_of(exposed(image, 0.05)).contrast < 0.6 * quality_of(image).contrast


def test_evenness_is_that_of_the_light() -> None:
    even, uneven = quality_of(shot().image), quality_of(shot(Light(gradient=(0.6, 0.0))).image)
    assert even.evenness > 0.9 > 0.7 > uneven.evenness > 0.2


def test_overexposure_is_clipping_and_a_hint() -> None:
    image = shot().image
    assert quality_of(image).clipping == 0
    quality = quality_of(exposed(image, 4.0))
    assert quality.clipping > 0.5 and any("shorten the exposure" in hint for hint in quality.hints)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"edge_px": 6.0}, "px an edge"),
        ({"blur_px": 5.0}, "focus"),
        ({"noise": 25.0}, "noisy"),
        ({"contrast": 12.0}, "blue and black look alike"),
        ({"clipping": 0.4}, "shorten the exposure"),
        ({"evenness": 0.1}, "uneven"),
    ],
)
def test_what_limits_has_a_hint_of_its_own(changed: dict[str, float], said: str) -> None:
    (hint,) = replace(GOOD, **changed).hints  # type: ignore[arg-type]
    assert said in hint and not GOOD.hints
    assert not replace(GOOD, **dict.fromkeys(changed, float("nan"))).hints  # type: ignore[arg-type]


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_quality_can_be_copied_and_not_changed(duplicate) -> None:  # type: ignore[no-untyped-def]
    markers = read(shot().image)
    assert duplicate(markers.quality) == markers.quality == duplicate(markers).quality
    with pytest.raises(AttributeError):
        markers.quality.noise = 0.0  # type: ignore[misc,union-attr]


def test_images_without_a_pattern_say_what_they_can() -> None:
    white, grey = np.full((240, 320, 3), 255, np.uint8), np.full((240, 320, 3), 90, np.uint8)
    for image, clipping in ((white, 1.0), (grey, 0.0)):
        markers = read(image)
        assert markers.reason is Reason.NO_COLOR and not markers.found
        assert markers.quality is not None and markers.quality.clipping == clipping
        assert np.isnan([markers.quality.blur_px, markers.quality.contrast, markers.quality.edge_px]).all()
        assert len(markers.advice) == 1 + (clipping > 0)
    assert read(grey[..., 0]).quality is None


def test_an_edge_is_that_of_a_pattern() -> None:
    """Cells in noise have a size, and no edge; cells of a pattern without numbers have an edge."""
    noise = read(np.random.default_rng(1).integers(0, 255, (480, 640, 3), dtype=np.uint8))
    assert noise.reason is Reason.NO_PATTERN and np.isnan(noise.quality.edge_px)  # type: ignore[union-attr]
    assert not any("px an edge" in text for text in noise.quality.hints)  # type: ignore[union-attr]
    small = read(cv2.resize(shot().image[:, :150], None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA))
    assert small.reason is Reason.REFERENCE_LOST
    assert any("px an edge" in text for text in small.quality.hints)  # type: ignore[union-attr]


@pytest.mark.parametrize("reason", Reason)
def test_every_reason_says_what_to_do(reason: Reason) -> None:
    found, _, to_do = reason.text.partition("; ")
    assert len(found) > 20 and len(to_do) > 10 and "_" not in reason.text


def covered(rendered: Rendered, share: float) -> NDArray[np.uint8]:
    """A grey sheet over the pattern's left ``share``."""
    image, x = rendered.image.copy(), rendered.truth.marker_xy_px[:, 0]
    image[:, : int(x.min() + share * (x.max() - x.min()))] = 90
    return image


def test_a_pattern_that_is_mostly_covered_has_markers_and_a_reason() -> None:
    usual, mostly = read(covered(picture(), 0.3)), read(covered(picture(), 0.62))
    assert usual.found and usual.reason is None
    assert mostly.reason is not None
    if mostly.found:
        assert mostly.reason is Reason.FEW_MARKERS and mostly.mirrored is False
        assert (mostly.status != Status.LOST).mean() < 0.5


def test_a_pattern_that_lies_mostly_outside_needs_no_reason() -> None:
    """All that the image shows is read: that it shows a third of the markers is no fault of the reader."""
    rendered = picture(layers=6, pitch_px=24.0, rotation_deg=5.0)
    markers = Extractor(parse_layout(small_text("honeycomb", 6))).extract(rendered.image[90:210, 110:250])
    assert 0.1 < (markers.status != Status.LOST).mean() < 0.5
    assert markers.reason is None


def test_a_frame_with_few_markers_is_tracked_and_says_so() -> None:
    """The first frame is cold; the sheet leaves less than half."""
    frame = Tracker(extractor().layout).track(covered(picture(), 0.62))
    assert bool(np.isfinite(frame.markers.xy_px).any()) is (frame.status == 1)
    assert frame.reason
