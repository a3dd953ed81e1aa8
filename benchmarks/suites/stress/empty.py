"""Images without a pattern, or with another pattern: no marker may be reported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scenes import standard_layout
from benchmarks.suites.stress.frames import EmptyFrame, PatternFrame, Size
from benchmarks.suites.stress.kinds import ConditionKind, group_kinds
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, WHITE
from cmpdesign.scene import Busy, Plain, Sensor, render, standard_scene
from extractor.image.response import decode_values, encode_light

Pixels = NDArray[np.float32]


def noise_image(rng: np.random.Generator, size: Size, sigma_px: float) -> Pixels:
    """Colored noise with a grain of ``sigma_px``."""
    grain = rng.standard_normal((size[1], size[0], 3), dtype=np.float32)
    if sigma_px:
        grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), sigma_px))
    return np.asarray(127 + 70 * grain / grain.std(), dtype=np.float32)


def uniform_image(rng: np.random.Generator, size: Size, sigma: float) -> Pixels:
    """One color with sensor noise."""
    grain = rng.standard_normal((size[1], size[0], 3), dtype=np.float32)
    return np.asarray(rng.uniform(0, 255, 3) + sigma * grain, dtype=np.float32)


def blur_light(image: Pixels) -> Pixels:
    """An sRGB image (H, W, 3) blurred as a lens does: its light, by a sigma of 0.8 px."""
    light_of_value = Sensor().light_of_values()
    light = cv2.GaussianBlur(decode_values(image, light_of_value), (0, 0), 0.8)
    return encode_light(light, light_of_value).astype(np.float32)


def clutter_image(rng: np.random.Generator, size: Size, shapes: float, *, triangles: bool) -> Pixels:
    planes = Busy(int(shapes), triangles).planes(size, rng)
    return blur_light(planes.transpose(1, 2, 0))


def photo_like_image(rng: np.random.Generator, size: Size, steps: float) -> Pixels:
    """Smooth areas with sharp borders, as in a photograph: quantised noise of two grains."""
    coarse, fine = noise_image(rng, size, 30), noise_image(rng, size, 2)
    return np.asarray(np.round(coarse / (255 / steps)) * (255 / steps) + 0.2 * (fine - 127), dtype=np.float32)


def checkerboard_image(rng: np.random.Generator, size: Size, pitch_px: float) -> Pixels:
    """Rotated squares in red, green, blue, white and black."""
    turn = rng.uniform(0, np.pi)
    y, x = np.mgrid[: size[1], : size[0]]
    u = np.floor((np.cos(turn) * x - np.sin(turn) * y) / pitch_px).astype(int)
    v = np.floor((np.sin(turn) * x + np.cos(turn) * y) / pitch_px).astype(int)
    color = rng.integers(0, 4, (512, 512))[u % 512, v % 512] + 1
    palette = np.array(_ink_colors(), dtype=np.float32)
    image = palette[np.where((u + v) % 2 == 0, color, 0)]
    return blur_light(image)


def _ink_colors() -> list[tuple[float, float, float]]:
    inks = standard_scene(standard_layout("honeycomb", 2)).inks
    return [inks[name][::-1] for name in ("black", "red", "green", "blue", "white")]


def recolored_pattern_image(
    rng: np.random.Generator, size: Size, pitch_px: float, recolor: Callable[..., Layout]
) -> Pixels:
    """The honeycomb pattern's triangles in other colors."""
    layout = recolor(standard_layout("honeycomb", 11), rng)
    scene = standard_scene(layout, seed=int(rng.integers(1 << 30)))
    camera = replace(scene.camera, pitch_px=pitch_px, rotation_deg=float(rng.uniform(0, 360)))
    scene = replace(scene, camera=camera, sensor=Sensor(2), background=Plain(tuple(rng.uniform(0, 255, 3))))
    return np.asarray(render(scene, size=size).image, dtype=np.float32)


def shuffle_colors(layout: Layout, rng: np.random.Generator) -> Layout:
    """The colors of the colored cells and the white cell in random order."""
    color = layout.cell_color.copy()
    up = color != BLACK
    color[up] = rng.permuted(color[up])
    return replace(layout, cell_color=color)


def recolor_to_one_ink(layout: Layout, rng: np.random.Generator) -> Layout:
    """All colored cells in one ink, with the white cell."""
    color = layout.cell_color.copy()
    color[(color != BLACK) & (color != WHITE)] = rng.integers(3)
    return replace(layout, cell_color=color)


REPEATS = 12  # for each of the three patterns; 28 steps: more than 1,000 images


def _nothing(
    name: str, unit: str, steps: tuple[float, ...], draw: Callable[..., Pixels], **fixed: object
) -> ConditionKind:
    """A kind without a pattern: drawn from the frame's seed, in small and standard size in turn."""

    def change(frame: PatternFrame, step: float) -> EmptyFrame:
        seed = frame.scene.seed
        return EmptyFrame(
            lambda rng, size: draw(rng, size, step, **fixed), (320, 240) if seed % 2 else (640, 480), seed
        )

    return ConditionKind(f"nothing: {name}", unit, steps, change, False, REPEATS)


EMPTY_KINDS = group_kinds(
    "nothing",
    _nothing("noise", "grain px", (0, 1, 3, 8), noise_image),
    _nothing("one color", "noise", (0, 2, 10), uniform_image),
    _nothing("clutter", "shapes", (10, 50, 150, 400), clutter_image, triangles=False),
    _nothing("triangles", "shapes", (10, 50, 150, 400), clutter_image, triangles=True),
    _nothing("smooth areas", "levels", (2, 3, 4, 6), photo_like_image),
    _nothing("colored squares", "px", (8, 14, 24), checkerboard_image),
    _nothing("shuffled colors", "px", (10, 16, 24), recolored_pattern_image, recolor=shuffle_colors),
    _nothing("one ink", "px", (10, 16, 24), recolored_pattern_image, recolor=recolor_to_one_ink),
)
