"""The Cramer-Rao bound of a scene, against its published figure and against rendered derivatives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from scipy.special import ndtr

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, RED
from cmpdesign.scene import (
    Light,
    Optics,
    Scene,
    SceneError,
    Sensor,
    cramer_rao,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.bounds.gridline_bound import edge_information
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.drawing.render import render_truth
from cmpdesign.scene.standard import INKS

Response = Literal["srgb", "linear"] | float


def rms_per_axis(covariance: np.ndarray) -> float:
    return float(np.sqrt(np.einsum("mii->m", covariance).mean() / 2))


def standard_with(response: Response, **changes: Any) -> Scene:
    return replace(standard_scene(**changes), sensor=Sensor(noise=2.0, response=response))


@pytest.mark.parametrize(("response", "px"), [("linear", 0.00543), ("srgb", 0.00574)], ids=["linear", "srgb"])
def test_the_standard_scene_allows_a_two_hundredth_of_a_pixel(response: Response, px: float) -> None:
    scene = standard_with(response)
    inner = scene.layout.marker_layer < scene.layout.marker_layer.max()
    assert rms_per_axis(cramer_rao(scene)[inner]) == pytest.approx(px, abs=0.00001)


def test_without_a_response_it_is_the_closed_form() -> None:
    """A^2 / (2 sqrt(pi) s sigma^2) per pixel of a gridline; the ends' weights 1 - t and t leave a third each."""
    scene = standard_with("linear", layout=standard_layout(layers=2))
    layout, truth = scene.layout, render_truth(scene)
    expected = 0.0
    for edge in layout.edges:
        colors = [np.array(scene.ink(int(c))) for c in (*layout.cell_color[beside(layout, edge)], BLACK)[:2]]
        length = np.linalg.norm(np.diff(truth.marker_xy_px[edge], axis=0))
        expected += 2 / 3 * length * ((colors[0] - colors[1]) ** 2).sum()
    expected /= 2 * np.sqrt(np.pi) * np.sqrt(1 + 1 / 12) * 2.0**2
    for response in ("linear", 1.0):
        found = edge_information(standard_with(response, layout=layout), truth, (640, 480))
        assert found.diagonal().sum() == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("response", ["linear", "srgb", 2.2, 0.5])
def test_long_gridlines_are_alone(response: Response) -> None:
    """The gridlines' bound is the exact one where the corners, which gridlines share, are a small part of them."""
    size = (700, 600)
    scene = replace(standard_with(response, layout=standard_layout(layers=2)), camera=Camera(160))
    inner = scene.layout.marker_layer < 2
    alone, exact = (rms_per_axis(bound(scene, size=size)[inner]) for bound in (cramer_rao, exact_bound))
    assert 1.0 < exact / alone < 1.03


@pytest.mark.parametrize("response", ["linear", "srgb", 0.5])
def test_a_fitted_edge_scatters_as_much(response: Response) -> None:
    """Least squares of the place of one encoded, noisy edge: 4000 draws, whose variance is known to 2.2 %."""
    blur_px, noise, size = 1.0, 3.0, (200, 160)
    layout = standard_layout(layers=1)
    scene = Scene(layout, Camera(60), optics=Optics(blur_px), sensor=Sensor(noise, response), inks=INKS)
    truth = render_truth(scene, size=size)
    a, b = next(e for e in layout.edges if set(layout.cell_color[beside(layout, e)]) == {RED, BLACK})
    along = truth.marker_xy_px[b] - truth.marker_xy_px[a]
    # This gridline alone couples its markers, by a sixth of the information on its length.
    coupling = edge_information(scene, truth, size)[2 * a : 2 * a + 2, 2 * b : 2 * b + 2].toarray()
    per_px = 6 * np.trace(coupling) / np.linalg.norm(along)

    light_of_value = scene.sensor.light_of_values() if scene.sensor else np.arange(256.0)
    red, black = (np.interp(INKS[name], np.arange(256), light_of_value) for name in ("red", "black"))
    pixels = np.arange(-12.0, 13.0)[:, None]

    def row(place: np.ndarray) -> np.ndarray:
        """(draws, pixels * 3): one pixel wide rows across an upright edge at these places."""
        boxes = (np.arange(20) + 0.5) / 20 - 0.5
        share = ndtr((pixels + boxes - place[:, None, None]) / blur_px).mean(axis=2)[..., None]
        values = np.interp(black + share * (red - black), light_of_value, np.arange(256.0))
        return np.asarray(values.reshape(len(place), -1))

    rng = np.random.default_rng(1)
    true = rng.uniform(-0.5, 0.5, 4000)
    noisy = row(true) + noise * rng.standard_normal((4000, 75))
    place = true.copy()
    for _ in range(4):
        slope = (row(place + 0.01) - row(place - 0.01)) / 0.02
        place += ((noisy - row(place)) * slope).sum(axis=1) / (slope**2).sum(axis=1)
    assert np.mean((place - true) ** 2) * per_px == pytest.approx(1.0, abs=0.06)


def beside(layout: Layout, edge: np.ndarray) -> np.ndarray:
    """(C,) bool: the cells on both sides of an edge."""
    return np.asarray(np.isin(layout.cell_corners, edge).sum(axis=1) == 2)


def test_saturated_cells_tell_nothing() -> None:
    """Where black is clipped, too, only the prior of 1000 px remains."""
    scene = replace(standard_with("linear", layout=standard_layout(layers=1)), camera=Camera(60))
    for bound in (cramer_rao, exact_bound):
        for gain, px in ((13.0, 1000.0), (1.0, 0.005)):
            lit = replace(scene, light=Light(rgb=(gain, gain, gain)))
            assert rms_per_axis(bound(lit)) == pytest.approx(px, rel=0.2)


def test_it_scales_with_noise_blur_and_contrast() -> None:
    scene = standard_with("linear", layout=standard_layout(layers=4))
    plain = rms_per_axis(cramer_rao(scene))
    noisy = rms_per_axis(cramer_rao(replace(scene, sensor=Sensor(6.0, "linear"))))
    assert noisy == pytest.approx(3 * plain, rel=1e-6)
    blurred = rms_per_axis(cramer_rao(replace(scene, optics=Optics(2.0))))
    assert blurred == pytest.approx(plain * ((4 + 1 / 12) / (1 + 1 / 12)) ** 0.25, rel=1e-6)
    pale = {name: tuple(20 + 0.5 * (v - 20) for v in rgb) for name, rgb in scene.inks.items()}
    assert rms_per_axis(cramer_rao(replace(scene, inks=pale))) == pytest.approx(2 * plain, rel=1e-6)


@pytest.mark.parametrize("marker", [4, 1])  # away from the white cell, and at its corner
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("response", ["linear", "srgb"])
def test_a_marker_alone_matches_the_derivative_of_the_image(
    marker: int, axis: int, response: Response
) -> None:
    """With all other markers known, the information on one is the rendered image's squared derivative.

    Edges share pixels within the blur of a corner, and give less information: here by a few per cent.
    """
    layout = standard_layout(layers=2)
    camera, size, step_px = Camera(pitch_px=160), (700, 600), 0.2
    scene = Scene(layout, camera, optics=Optics(1.0), sensor=Sensor(bits=16, response=response))

    def shifted(by_px: float) -> np.ndarray:
        xy = layout.marker_xy_mm.copy()
        xy[marker, axis] += by_px / camera.pitch_px
        moved = replace(scene, layout=replace(layout, marker_xy_mm=xy))
        return render(moved, size=size).image.astype(np.float64) / 257

    derivative = (shifted(step_px) - shifted(-step_px)) / (2 * step_px)
    truth = render_truth(scene, size=size)
    information = edge_information(replace(scene, sensor=Sensor(1.0, response)), truth, size)
    ratio = information[2 * marker + axis, 2 * marker + axis] / (derivative**2).sum()
    assert 1.0 < ratio < 1.05


def test_invisible_markers_have_none() -> None:
    scene = standard_scene()
    covariance = cramer_rao(scene, size=(200, 200))
    visible = render(scene, size=(200, 200)).truth.visible
    assert 20 < visible.sum() < len(visible)
    np.testing.assert_array_equal(np.isfinite(covariance).all(axis=(1, 2)), visible)


def test_without_noise_there_is_no_bound() -> None:
    with pytest.raises(SceneError, match="noise"):
        cramer_rao(replace(standard_scene(standard_layout(layers=1)), sensor=None))
