"""Frames of the stress suite: a scene and its size, or an image without a pattern; each shoots its image and truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.scene import (
    STANDARD_SIZE,
    Damage,
    Light,
    Optics,
    Scene,
    Sensor,
    Truth,
    composed,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.parts.surface import Deformation

Image = NDArray[Any]
Size = tuple[int, int]
RGB = tuple[float, float, float]
PATTERNS = ("honeycomb", "round", "elliptical")


@dataclass(frozen=True, eq=False)
class CaseImage:
    """An image and the truths (M of the layout) of every pattern in it: none, one or two.

    Attributes:
        scene: of the first pattern; None where there is none.
    """

    image: Image
    truths: tuple[Truth, ...]
    scene: Scene | None


@dataclass(frozen=True, eq=False)
class PatternFrame:
    """One pattern, or two beside each other, in an image of ``size`` (width, height) each."""

    scene: Scene
    size: Size = STANDARD_SIZE
    beside: Scene | None = None

    @property
    def layout(self) -> Layout:
        return self.scene.layout

    @property
    def pitch_px(self) -> float:
        return self.scene.camera.pitch_px

    @property
    def rng(self) -> np.random.Generator:
        """A fresh stream of the scene's seed, for places and choices."""
        return np.random.default_rng([self.scene.seed, 77])

    def having(self, **changes: Any) -> PatternFrame:
        """With other parts of the scene."""
        return replace(self, scene=replace(self.scene, **changes))

    def seen(self, **changes: Any) -> PatternFrame:
        """With other settings of the camera."""
        return self.having(camera=replace(self.scene.camera, **changes))

    def lit(self, **light: Any) -> PatternFrame:
        """Under another light."""
        return self.having(light=Light(**light))

    def taken(self, **sensor: Any) -> PatternFrame:
        """By another sensor; noise 2 unless told."""
        return self.having(sensor=Sensor(**{"noise": 2.0, **sensor}))

    def blurred(self, blur_px: float) -> PatternFrame:
        return self.having(optics=Optics(blur_px))

    def inked(self, **inks: RGB) -> PatternFrame:
        """With some inks of another color."""
        return self.having(inks={**self.scene.inks, **inks})

    def formed(self, *deformations: Deformation) -> PatternFrame:
        """On a deformed surface."""
        return self.having(surface=composed(*deformations))

    def damaged(self, **damage: Any) -> PatternFrame:
        return self.having(damage=Damage(**damage))

    def scaled(self, pitch_px: float) -> PatternFrame:
        """Another pitch, in an image that grows with it."""
        ratio = pitch_px / self.pitch_px
        size = (round(self.size[0] * ratio), round(self.size[1] * ratio))
        return replace(self.seen(pitch_px=pitch_px), size=size)

    def shoot(self) -> CaseImage:
        first = render(self.scene, size=self.size)
        if self.beside is None:
            return CaseImage(first.image, (first.truth,), self.scene)
        second = render(self.beside, size=self.size)
        moved = replace(second.truth, marker_xy_px=second.truth.marker_xy_px + [self.size[0], 0])
        image = np.ascontiguousarray(np.hstack([first.image, second.image]))
        return CaseImage(image, (first.truth, moved), self.scene)


@dataclass(frozen=True, eq=False)
class EmptyFrame:
    """An image (H, W, 3) uint8 BGR without a pattern."""

    draw: Callable[[np.random.Generator, Size], NDArray[np.float32]]
    size: Size
    seed: int

    def shoot(self) -> CaseImage:
        drawn = self.draw(np.random.default_rng([self.seed, 78]), self.size)
        return CaseImage(np.clip(np.rint(drawn), 0, 255).astype(np.uint8), (), None)


@cache
def cached_layout(pattern: str, layers: int = 11) -> Layout:
    """The standard scene's layout, built once."""
    return standard_layout(pattern, layers)


def plain_frame(pattern: str, seed: int, layers: int = 11, size: Size = STANDARD_SIZE) -> PatternFrame:
    """The standard scene, turned at random."""
    frame = PatternFrame(standard_scene(cached_layout(pattern, layers), seed=seed), size)
    turn = float(np.random.default_rng([seed, 79]).uniform(0, 360))
    return frame.seen(rotation_deg=turn)
