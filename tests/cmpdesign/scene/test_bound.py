"""The Cramer-Rao bound of a scene, against its published figure and against rendered derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmpdesign.scene import (
    Optics,
    Scene,
    SceneError,
    Sensor,
    cramer_rao,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.bounds.gridline_bound import edge_information
from cmpdesign.scene.camera.plain import Camera
from cmpdesign.scene.drawing.render import render_truth


def rms_per_axis(covariance: np.ndarray) -> float:
    return float(np.sqrt(np.einsum("mii->m", covariance).mean() / 2))


def test_the_standard_scene_allows_0_0054_px() -> None:
    scene = standard_scene()
    inner = scene.layout.marker_layer < scene.layout.marker_layer.max()
    assert rms_per_axis(cramer_rao(scene)[inner]) == pytest.approx(0.0054, abs=0.00005)


def test_it_scales_with_noise_blur_and_contrast() -> None:
    scene = standard_scene(standard_layout(layers=4))
    plain = rms_per_axis(cramer_rao(scene))
    noisy = rms_per_axis(cramer_rao(replace(scene, sensor=Sensor(noise=6.0))))
    assert noisy == pytest.approx(3 * plain, rel=1e-6)
    blurred = rms_per_axis(cramer_rao(replace(scene, optics=Optics(2.0))))
    assert blurred == pytest.approx(plain * ((4 + 1 / 12) / (1 + 1 / 12)) ** 0.25, rel=1e-6)
    pale = {name: tuple(20 + 0.5 * (v - 20) for v in rgb) for name, rgb in scene.inks.items()}
    assert rms_per_axis(cramer_rao(replace(scene, inks=pale))) == pytest.approx(2 * plain, rel=1e-6)


@pytest.mark.parametrize("marker", [4, 1])  # away from the white cell, and at its corner
@pytest.mark.parametrize("axis", [0, 1])
def test_a_marker_alone_matches_the_derivative_of_the_image(marker: int, axis: int) -> None:
    """With all other markers known, the information on one is the rendered image's squared derivative.

    Where edges meet, within the blur of a corner, they share pixels and tell less: a few per cent here.
    """
    layout = standard_layout(layers=2)
    camera, size, step_px = Camera(pitch_px=160), (700, 600), 0.2
    scene = Scene(layout, camera, optics=Optics(1.0), sensor=Sensor(bits=16))

    def shifted(by_px: float) -> np.ndarray:
        xy = layout.marker_xy_mm.copy()
        xy[marker, axis] += by_px / camera.pitch_px
        moved = replace(scene, layout=replace(layout, marker_xy_mm=xy))
        return render(moved, size=size).image.astype(np.float64) / 257

    derivative = (shifted(step_px) - shifted(-step_px)) / (2 * step_px)
    truth = render_truth(scene, size=size)
    information = edge_information(replace(scene, sensor=Sensor(noise=1.0)), truth, size)
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
