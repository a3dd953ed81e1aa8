"""The response: light is blurred, and encoded afterwards; against the formula of IEC 61966-2-1."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.special import ndtr

from cmpdesign.patterns.colors import RED
from cmpdesign.scene import (
    Blob,
    Camera,
    Damage,
    Light,
    Optics,
    Plain,
    Scene,
    SceneError,
    Sensor,
    render,
    standard_layout,
)
from cmpdesign.scene.drawing.encoding import encode_planes
from cmpdesign.scene.parts.sensor import encoding_slope

SIZE = (120, 100)
INKS = {"red": (230.0, 60.0, 12.0), "black": (25.0, 5.0, 90.0)}
Values = NDArray[np.float64]


def srgb_light(value: Values) -> Values:
    """IEC 61966-2-1, values and light from 0 to 1."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb_value(light: Values) -> Values:
    """IEC 61966-2-1, values and light from 0 to 1."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def power_light(value: Values) -> Values:
    return np.asarray(value**1.8)


def power_value(light: Values) -> Values:
    return np.asarray(light ** (1 / 1.8))


def one_edge(blur_px: float, sensor: Sensor) -> tuple[NDArray[np.uint16], float, bool]:
    """The row through the middle of an upright gridline, (W, 3) B, G, R; its x in px; whether red is at its right."""
    layout = standard_layout(layers=1)
    camera = Camera(pitch_px=400, rotation_deg=90)
    ends = layout.edges[np.abs(np.diff(layout.marker_xy_mm[layout.edges, 1], axis=1)[:, 0]) < 1e-9]
    (a, b), cells = next(
        (edge, np.flatnonzero(np.isin(layout.cell_corners, edge).sum(axis=1) == 2))
        for edge in ends
        if RED in layout.cell_color[np.isin(layout.cell_corners, edge).sum(axis=1) == 2]
    )
    red = int(cells[layout.cell_color[cells] == RED][0])
    middle_px = render(Scene(layout, camera), size=SIZE).truth.marker_xy_px[[a, b]].mean(axis=0)
    x, y = 60.3, 50.0
    moved = replace(camera, centre_px=(59.5 + x - middle_px[0], 49.5 + y - middle_px[1]))
    seen = render(Scene(layout, moved, optics=Optics(blur_px), sensor=sensor, inks=INKS), size=SIZE)
    np.testing.assert_allclose(seen.truth.marker_xy_px[[a, b]].mean(axis=0), (x, y), atol=1e-9)
    at_right = seen.truth.marker_xy_px[layout.cell_corners[red], 0].mean() > x
    return np.asarray(seen.image[int(y)], np.uint16), x, bool(at_right)


@pytest.mark.parametrize("blur_px", [0.7, 1.6])
@pytest.mark.parametrize(
    ("response", "light", "value"), [("srgb", srgb_light, srgb_value), (1.8, power_light, power_value)]
)
def test_an_edge_is_encoded_after_the_blur(blur_px, response, light, value) -> None:  # type: ignore[no-untyped-def]
    """The encoded normal distribution (over the pixel's box), not the blurred encoded edge."""
    row, x, right = one_edge(blur_px, Sensor(bits=16, response=response))
    places = np.arange(50, 72)
    # The mean of the normal distribution over each pixel.
    share = np.array([quad(lambda u: ndtr(u / blur_px), p - x - 0.5, p - x + 0.5)[0] for p in places])
    share = (share if right else 1 - share)[:, None]
    red, black = (np.array(INKS[name][::-1]) / 255 for name in ("red", "black"))
    expected = 255 * value(light(black) + share * (light(red) - light(black)))
    np.testing.assert_allclose(row[places] / 257, expected, atol=0.1)
    blurred_values = 255 * (black + share * (red - black))
    assert np.abs(row[places] / 257 - blurred_values).max() > 15


@pytest.mark.parametrize("response", ["srgb", "linear", 0.45, 2.2, tuple(np.linspace(0, 3, 256) ** 2)])
def test_cells_background_and_dirt_have_their_own_colors(response) -> None:  # type: ignore[no-untyped-def]
    layout, dirt, desk = standard_layout(layers=2), (90.0, 3.0, 250.0), (200.0, 140.0, 35.0)
    damage = Damage(blobs=(Blob(tuple(layout.marker_xy_mm[2]), 0.3, dirt),))
    scene = Scene(layout, Camera(60), optics=Optics(1.0), sensor=Sensor(response=response), damage=damage)
    seen = render(replace(scene, background=Plain(desk)), size=(400, 360))
    np.testing.assert_array_equal(seen.image[1, 1], desk[::-1])
    x, y = seen.truth.marker_xy_px[2].round().astype(int)
    np.testing.assert_array_equal(seen.image[y, x], dirt[::-1])
    middles = seen.truth.marker_xy_px[layout.cell_corners].mean(axis=1).round().astype(int)
    assert seen.truth.cell_visible.sum() > 15
    for cell in np.flatnonzero(seen.truth.cell_visible):
        x, y = middles[cell]
        np.testing.assert_array_equal(seen.image[y, x], scene.ink(int(layout.cell_color[cell]))[::-1])


def test_light_and_saturation_act_before_the_encoding() -> None:
    scene = Scene(standard_layout(layers=1), Camera(2), background=Plain((200, 100, 4)))
    dim = render(replace(scene, light=Light(rgb=(0.5, 0.5, 0.5))), size=SIZE).image[1, 1]
    expected = 255 * srgb_value(0.5 * srgb_light(np.array([4, 100, 200]) / 255))
    np.testing.assert_allclose(dim, expected, atol=0.51)
    bright = replace(scene, light=Light(rgb=(2.0, 2.0, 2.0)), sensor=Sensor(noise=3.0))
    assert render(bright, size=SIZE).image[1, 1, 2] == 255
    exponent = replace(scene, light=Light(rgb=(0.5, 0.5, 0.5)), sensor=Sensor(response=2.0))
    assert render(exponent, size=SIZE).image[1, 1, 2] == round(200 * 0.5**0.5)


@pytest.mark.parametrize("response", ["srgb", 0.3, 4.0, tuple(np.linspace(0.1, 3, 256) ** 2)])
def test_both_engines_encode_alike(response) -> None:  # type: ignore[no-untyped-def]
    light = np.concatenate([np.linspace(-1, 400, 9001), 10.0 ** np.linspace(-9, 0, 2000)]).astype(np.float32)
    plain, loop = (
        encode_planes(Sensor(response=response), light, engine) for engine in ("numpy", "compiled")
    )
    np.testing.assert_allclose(loop, plain, rtol=1e-6, atol=1e-6)


def test_noise_is_that_of_the_encoded_picture() -> None:
    """A dark and a bright level have the same noise in values; 0.5 % is three deviations of the estimate."""
    for level in (20.0, 230.0):
        grey = Scene(standard_layout(layers=1), Camera(1), background=Plain((level, level, level)))
        image = render(replace(grey, sensor=Sensor(noise=2.0)), size=(300, 300)).image[:130]
        assert image.mean() == pytest.approx(level, abs=0.03)
        assert image.std() == pytest.approx(np.sqrt(4 + 1 / 12), rel=0.01)


def test_the_slope_is_the_derivative_of_the_encoding() -> None:
    light = np.array([0.2, 3.0, 50.0, 254.0])
    step = 1e-4 * light
    expected = 255 * (srgb_value((light + step) / 255) - srgb_value((light - step) / 255)) / (2 * step)
    np.testing.assert_allclose(encoding_slope(Sensor(), light), expected, rtol=0.02)
    np.testing.assert_array_equal(encoding_slope(Sensor(response="linear"), light), 1.0)
    np.testing.assert_array_equal(encoding_slope(Sensor(), np.array([255.5, 400.0])), 0.0)


@pytest.mark.parametrize(
    ("response", "message"),
    [
        ("rec709", "response is 'rec709'; give 'srgb', 'linear', an exponent"),
        ("auto", "response is 'auto'"),
        (0.1, "response is the exponent 0.1; it must lie between 0.2 and 5"),
        (np.nan, "exponent nan; it must lie between 0.2 and 5"),
        ((0.0, 1.0), r"table of shape \(2,\); give 256 values"),
        ((-1.0, *range(255)), "negative or infinite light; give finite values from 0 on"),
        ((*range(255), 254), r"does not rise from value 254 \(254\) to the next \(254\)"),
    ],
)
def test_responses_that_are_none(response, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SceneError, match=message):
        Sensor(response=response)
