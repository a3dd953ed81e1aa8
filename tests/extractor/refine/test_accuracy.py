"""Refinement against the exact bound of its scene: error, bias and covariance, flat and bent, sharp and blurred."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.suites.scoring.calibration import squared_distances, summarise
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Optics, Scene, Sensor, render, standard_layout, standard_scene
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.bounds.gridline_bound import cramer_rao
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.parts.light import Light
from cmpdesign.scene.parts.surface import Press, Twist, composed
from extractor import Extractor, parse_layout

SIZE = (300, 260)
LAYERS = 5
SEEDS = 3


@cache
def extractor(preset: str, pattern: str = "honeycomb") -> Extractor:
    layout = standard_layout(pattern, LAYERS)
    return Extractor(parse_layout(layout_to_json(layout)), preset=preset)  # type: ignore[arg-type]


def scene(pattern: str = "honeycomb", bent: str = "", blur: float = 1.0) -> Scene:
    surface = {
        "bulge": composed(Press(radius_mm=5.0, depth_mm=1.2)),
        "twist": composed(Twist(radius_mm=5.0, angle_deg=8.0)),
    }.get(bent)
    plain = standard_scene(standard_layout(pattern, LAYERS))
    return replace(plain, surface=surface, optics=Optics(blur))


def inner_markers(pattern: str) -> np.ndarray:
    """(M,) bool: the markers with all their gridlines."""
    return np.asarray(standard_layout(pattern, LAYERS).marker_layer < LAYERS)


@cache
def rms_bound(pattern: str, bent: str, blur: float) -> float:
    covariance = exact_bound(scene(pattern, bent, blur), size=SIZE)[inner_markers(pattern)]
    return float(np.sqrt(np.einsum("mii->m", covariance).mean() / 2))


def measured(wanted: Scene, preset: str, pattern: str = "honeycomb") -> tuple[np.ndarray, np.ndarray]:
    """Errors (S, M, 2) and covariances (S, M, 2, 2) of the inner markers."""
    inner = wanted.layout.marker_layer < LAYERS
    errors, covariances = [], []
    for seed in range(SEEDS):
        seen = render(replace(wanted, seed=seed), size=SIZE)
        markers = extractor(preset, pattern).extract(seen.image)
        errors.append((markers.xy_px - seen.truth.marker_xy_px)[inner])
        covariances.append(markers.cov_px2[inner])
    return np.array(errors), np.array(covariances)


CASES = [
    ("honeycomb", "", 1.0),
    ("honeycomb", "", 0.6),
    ("honeycomb", "", 2.0),
    ("honeycomb", "bulge", 1.0),
    ("honeycomb", "twist", 1.0),
    ("honeycomb", "bulge", 3.0),
    ("round", "", 1.0),
    ("elliptical", "twist", 2.0),
]


@pytest.mark.parametrize(("preset", "limit"), [("balanced", 1.4), ("accurate", 1.15)])
@pytest.mark.parametrize(("pattern", "bent", "blur"), CASES)
def test_the_error_is_near_the_exact_bound(
    preset: str, limit: float, pattern: str, bent: str, blur: float
) -> None:
    error, covariance = measured(scene(pattern, bent, blur), preset, pattern)
    assert np.isfinite(error).all()
    # where the blur is wide, bending cannot be told from noise
    limit *= 1.04 if blur == 3.0 else 1.0
    assert np.sqrt(np.mean(error**2)) < limit * rms_bound(pattern, bent, blur)
    found = summarise([squared_distances(*one) for one in zip(error, covariance, strict=True)])
    # the misfit of the first drawing counts where no second one is needed
    assert 0.8 < found.z.value < (1.13 if blur < 3 else 1.3)


@pytest.mark.parametrize(("blur", "limit"), [(0.6, 0.002), (1.0, 0.003), (2.0, 0.013), (3.0, 0.013)])
@pytest.mark.parametrize("bent", ["", "bulge", "twist"])
@pytest.mark.parametrize("pattern", ["honeycomb", "round"])
def test_without_noise_there_is_no_bias(pattern: str, bent: str, blur: float, limit: float) -> None:
    """Cells and curved gridlines are drawn as blur shows them, and inks and blur are found, however wide it is."""
    seen = render(replace(scene(pattern, bent, blur), sensor=None), size=SIZE)
    markers = extractor("accurate", pattern).extract(seen.image)
    error = markers.xy_px - seen.truth.marker_xy_px
    inside = error[inner_markers(pattern)]
    assert np.sqrt(np.mean(inside**2)) < limit * (1 if bent else 0.6)
    assert abs(inside.mean(axis=0)).max() < 0.15 * limit
    assert np.sqrt(np.mean(error**2)) < 4 * limit
    with_pixel = [
        np.sqrt(blur**2 + scale**2 / 12) for scale in (1, 2)
    ]  # of the image, or of one of half its size
    assert min(abs(markers.stages["refine"].blur_px / true - 1) for true in with_pixel) < 0.005


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("blur", [0.6, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_the_blur_is_found(pattern: str, blur: float, preset: str) -> None:
    """Optics and pixel together; a pixel is that of the image, or of one reduced by four at most."""
    seen = render(scene(pattern, "", blur), size=SIZE)
    found = extractor(preset, pattern).extract(seen.image).stages["refine"].blur_px
    assert 0.97 * np.sqrt(blur**2 + 1 / 12) < found < 1.04 * np.sqrt(blur**2 + 16 / 12)
    if blur <= 1.0:
        assert found == pytest.approx(np.sqrt(blur**2 + 4 / 12), rel=0.04) or found == pytest.approx(
            np.sqrt(blur**2 + 1 / 12), rel=0.04
        )


def test_uneven_light_does_not_pull_the_markers() -> None:
    lit = replace(scene(), light=Light(gradient=(0.35, -0.2), vignetting=0.2))
    error, _ = measured(lit, "balanced")
    assert np.sqrt(np.mean(error**2)) < 1.8 * rms_bound("honeycomb", "", 1.0)


def test_a_view_of_a_part_keeps_its_markers() -> None:
    """Cells that the image's border cuts are drawn too, so they do not pull the markers beside them."""
    wanted = scene()
    seen = render(wanted, size=(120, 110))
    markers = extractor("accurate").extract(seen.image)
    error = np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1)
    deep = np.all((seen.truth.marker_xy_px > 24) & (seen.truth.marker_xy_px < [95, 85]), axis=1)
    assert deep.sum() > 10 and np.isfinite(error[deep]).all() and error[deep].max() < 0.1


@pytest.mark.parametrize("pitch", [16.0, 20.0, 48.0])
def test_the_exact_bound_meets_the_closed_form_for_long_gridlines(pitch: float) -> None:
    """Gridlines share pixels at their ends only: the longer they are, the less that matters."""
    wanted = replace(
        scene(),
        layout=standard_layout(layers=2),
        camera=Camera(pitch_px=pitch),
        sensor=Sensor(noise=2.0, response="linear"),
    )
    exact, closed = (
        np.einsum("mii->m", f(wanted, size=(320, 300))).mean() for f in (exact_bound, cramer_rao)
    )
    expected = {16.0: 1.087, 20.0: 1.062, 48.0: 1.019}[pitch]
    assert np.sqrt(exact / closed) == pytest.approx(expected, abs=0.005)
