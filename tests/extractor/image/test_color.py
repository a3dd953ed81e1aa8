"""Stages 1 and 2 alone: colors, the hues found in the image, the target area, labels, noise.

Inside: regions grow beyond their labels, and gridlines are measured without hues, so that markers do not show errors.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK
from extractor import parse_layout
from extractor.image.color import find_hues, hue_weights, nominal_hues_deg, to_colors
from extractor.image.ink_segmentation import segment
from extractor.image.input import estimate_noise
from extractor.image.target_area import Target, find_target
from tests.support.layouts import small_layout, small_text
from tests.support.pictures import picture

Image = NDArray[np.uint8]
NOMINAL_DEG = nominal_hues_deg(dict(small_layout().palette))


def bgr(hue_deg: float, saturation: float = 0.8, value: float = 200.0) -> NDArray[np.float64]:
    color = cv2.cvtColor(np.array([[[hue_deg % 360, saturation, value]]], np.float32), cv2.COLOR_HSV2BGR)
    return np.asarray(color[0, 0], np.float64)


def hue_distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs((a - b + 180) % 360 - 180)


def everywhere(image: Image) -> Target:
    return Target(mask=np.ones((-(-image.shape[0] // 8), -(-image.shape[1] // 8)), np.uint8), tile_px=8)


def test_nominal_hues_are_the_palettes() -> None:
    palette = {
        "red": "#ff0000",
        "green": "#00ff00",
        "blue": "#0000ff",
        "black": "#000000",
        "white": "#ffffff",
    }
    np.testing.assert_allclose(nominal_hues_deg(palette), (0, 120, 240), atol=1e-4)


@pytest.mark.parametrize("shift_deg", [-30, -8, -1, 0, 1, 8, 30])
def test_hues_are_found_where_the_light_puts_them(shift_deg: int) -> None:
    """Red wanders over the wrap at 0; the hues are those of the image, not the palette's."""
    weight = np.zeros(180)
    true_deg = NOMINAL_DEG + shift_deg
    for hue in true_deg:
        for away in range(-3, 4):
            weight[round(hue / 2 + away) % 180] += 100 - 20 * abs(away)
    found = find_hues(weight, NOMINAL_DEG)
    assert found is not None and (found >= 0).all() and (found < 360).all()
    assert hue_distance(found, true_deg).max() <= 1.01


def test_colors_are_opencvs_to_the_bit() -> None:
    """And the chroma, made of these, is max - min but for a step here and there."""
    levels = np.concatenate([np.arange(0, 256, 5), np.arange(1, 256, 17), np.arange(250, 256)])
    image = (
        np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(len(levels), -1, 3).astype(np.uint8)
    )
    colors = to_colors(image)
    np.testing.assert_array_equal(colors.hsv, cv2.cvtColor(image, cv2.COLOR_BGR2HSV))
    np.testing.assert_array_equal(colors.hue, colors.hsv[..., 0])
    np.testing.assert_allclose(colors.chroma, np.ptp(image.astype(int), axis=2), atol=1)


def test_without_one_of_the_inks_there_are_no_hues() -> None:
    weight = np.zeros(180)
    assert find_hues(weight, NOMINAL_DEG) is None
    weight[[round(hue / 2) % 180 for hue in NOMINAL_DEG[:2]]] = 100
    assert find_hues(weight, NOMINAL_DEG) is None


def test_hues_weigh_the_chroma_of_colored_pixels() -> None:
    rng = np.random.default_rng(255)
    hue = rng.integers(0, 180, (70, 90)).astype(np.uint8)
    chroma = rng.integers(0, 256, hue.shape).astype(np.uint8)
    kept = chroma >= 12
    expected = np.bincount(hue[kept], chroma[kept], minlength=180)
    np.testing.assert_array_equal(hue_weights(hue, chroma), expected)


@pytest.mark.parametrize("shift_deg", [-12, 0, 12])
def test_red_on_both_sides_of_the_wrap_is_one_ink(shift_deg: int) -> None:
    image = np.zeros((96, 144, 3), np.uint8)
    rng = np.random.default_rng(1)
    for ink, hue in enumerate((0 + shift_deg, 120, 240)):
        block = [bgr(hue + wobble) for wobble in rng.uniform(-9, 9, 32 * 32)]
        image[32:64, 8 + 48 * ink : 40 + 48 * ink] = np.rint(block).reshape(32, 32, 3)
    found = segment(to_colors(image), everywhere(image), np.array([0.0, 120.0, 240.0]))
    assert found is not None
    expected = np.zeros(image.shape[:2], np.uint8)
    for ink in range(3):
        expected[32:64, 8 + 48 * ink : 40 + 48 * ink] = ink + 1
    np.testing.assert_array_equal(found.label, expected)


def test_labels_are_the_layouts_inks() -> None:
    seen = picture(noise=0.0)
    layout = small_layout("honeycomb", 4)
    colors = to_colors(seen.image)
    found = segment(colors, find_target(colors), NOMINAL_DEG)
    assert found is not None
    middle = np.rint(seen.truth.marker_xy_px[layout.cell_corners].mean(axis=1)).astype(int)
    expected = np.where(layout.cell_color < 3, layout.cell_color + 1, 0)
    np.testing.assert_array_equal(found.label[middle[:, 1], middle[:, 0]], expected)


def test_chroma_is_the_spread_of_the_channels() -> None:
    image = np.random.default_rng(3).integers(0, 256, (40, 50, 3), np.uint8)
    spread = image.max(axis=2).astype(int) - image.min(axis=2)
    assert np.abs(to_colors(image).chroma - spread).max() <= 1


def test_the_target_holds_the_pattern_and_leaves_out_what_lies_apart() -> None:
    seen = picture(noise=0.0)
    image = np.zeros((700, 700, 3), np.uint8)
    image[: seen.image.shape[0], : seen.image.shape[1]] = seen.image
    target = find_target(to_colors(image))
    at = np.rint(seen.truth.marker_xy_px).astype(int) // target.tile_px
    assert target.mask[at[:, 1], at[:, 0]].all()
    assert not target.mask[60:, 60:].any()


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
