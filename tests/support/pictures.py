"""Pictures for the extractor's tests: scenes of small layouts, pictures without any pattern, and the sRGB curve."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Camera, Optics, Rendered, Scene, Sensor, render
from extractor import Extractor, parse_layout
from tests.support.layouts import small_layout, small_text

Image = NDArray[np.uint8]
SIZE = (360, 300)


@cache
def extractor(pattern: str = "honeycomb", layers: int = 4) -> Extractor:
    """It reads both sides, as ``picture`` shows both."""
    return Extractor(parse_layout(small_text(pattern, layers)), side="either")


@cache
def picture(
    pattern: str = "honeycomb",
    layers: int = 4,
    *,
    pitch_px: float = 26.0,
    rotation_deg: float = 17.0,
    mirrored: bool = False,
    noise: float = 2.0,
    size: tuple[int, int] = SIZE,
) -> Rendered:
    """A slightly tilted view of a small layout, in full with the default size."""
    return scene_of(small_layout(pattern, layers), pitch_px, rotation_deg, mirrored, noise, size)


def scene_of(
    layout: Layout,
    pitch_px: float = 26.0,
    rotation_deg: float = 17.0,
    mirrored: bool = False,
    noise: float = 2.0,
    size: tuple[int, int] = SIZE,
) -> Rendered:
    camera = Camera(pitch_px, rotation_deg, 12.0, 50.0, mirrored=mirrored)
    scene = Scene(layout, camera=camera, optics=Optics(1.0), sensor=Sensor(noise=noise))
    return render(scene, size=size)


def recolored(layout: Layout, colors: Mapping[int, int]) -> Layout:
    """The layout with some cells painted otherwise: cell -> color."""
    color = layout.cell_color.copy()
    color[list(colors)] = list(colors.values())
    return replace(layout, cell_color=color)


def _blobs(rng: np.random.Generator) -> Image:
    """Blotches of all hues, smooth over some ten pixels."""
    field = np.stack(
        [cv2.GaussianBlur(rng.standard_normal((240, 320)), (0, 0), 9) for _ in range(3)], axis=-1
    )
    return np.clip(128 + 60 * field / field.std(), 0, 255).astype(np.uint8)


def _pink_noise(rng: np.random.Generator) -> Image:
    """A picture of amplitudes that decrease with the spatial frequency, as in photographs."""
    fy, fx = np.fft.fftfreq(240)[:, None], np.fft.rfftfreq(320)[None]
    falloff = 1 / np.maximum(np.hypot(fy, fx), 1 / 320)
    planes = [
        np.fft.irfft2(falloff * np.fft.rfft2(rng.standard_normal((240, 320))), (240, 320)) for _ in range(3)
    ]
    field = np.stack([plane / plane.std() for plane in planes], axis=-1)
    return np.clip(120 + 55 * field, 0, 255).astype(np.uint8)


def _triangles(rng: np.random.Generator) -> Image:
    """Confetti: triangles of the pattern's own inks and of white, anywhere on black."""
    image = np.full((240, 320, 3), 20, np.uint8)
    inks = [(45, 50, 200), (60, 150, 40), (190, 60, 45), (245, 245, 245)]
    for _ in range(150):
        corners = rng.uniform((0, 0), (320, 240)) + rng.normal(0, 14, (3, 2))
        cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), inks[rng.integers(4)], cv2.LINE_AA)
    return image


def _mosaic(rng: np.random.Generator) -> Image:
    """A Delaunay mosaic in the pattern's five colors, with common corners of gridlines."""
    image = np.full((240, 320, 3), 20, np.uint8)
    inks = [(45, 50, 200), (60, 150, 40), (190, 60, 45), (20, 20, 20), (245, 245, 245)]
    net = cv2.Subdiv2D((0, 0, 320, 240))
    net.insert(rng.uniform((2, 2), (318, 238), (160, 2)).astype(np.float32).tolist())
    for corners in net.getTriangleList().reshape(-1, 3, 2):
        cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), inks[rng.integers(5)], cv2.LINE_AA)
    return image


def _shapes(rng: np.random.Generator) -> Image:
    """Discs, boxes and lines in any color over a gradient."""
    image = np.linspace((30, 60, 90), (220, 180, 140), 320)[None].repeat(240, axis=0).astype(np.uint8)
    for _ in range(60):
        color = rng.integers(0, 256, 3).tolist()
        x, y, dx, dy = rng.integers((0, 0, 3, 3), (320, 240, 40, 40)).tolist()
        match rng.integers(3):
            case 0:
                cv2.circle(image, (x, y), dx, color, -1, cv2.LINE_AA)
            case 1:
                cv2.rectangle(image, (x, y), (x + dx, y + dy), color, -1)
            case _:
                cv2.line(image, (x, y), (x + 3 * dx, y - 2 * dy), color, 3, cv2.LINE_AA)
    return image


def _noise(rng: np.random.Generator) -> Image:
    return rng.integers(0, 256, (240, 320, 3), np.uint8)


STRANGE: Mapping[str, Callable[[np.random.Generator], Image]] = {
    "noise": _noise,
    "blobs": _blobs,
    "pink": _pink_noise,
    "confetti": _triangles,
    "mosaic": _mosaic,
    "shapes": _shapes,
}


def srgb_light(values: NDArray[Any]) -> NDArray[np.float64]:
    """The light, 0 to 255, of values 0 to 255."""
    value = np.asarray(values, np.float64) / 255
    return 255 * np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb_values(light: NDArray[Any]) -> NDArray[np.float64]:
    """The values, 0 to 255 and not rounded, of light 0 to 255."""
    share = np.clip(np.asarray(light, np.float64) / 255, 0, 1)
    return 255 * np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
