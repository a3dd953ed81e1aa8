"""Frames of the stress suite: a scene and its size, or an image without a pattern; ``shoot`` renders the image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scenes import standard_layout
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
    standard_scene,
)
from cmpdesign.scene.parts.surface import Deformation

Image = NDArray[Any]
Size = tuple[int, int]
RGB = tuple[float, float, float]
PATTERNS = ("honeycomb", "round", "elliptical")


@dataclass(frozen=True, eq=False)
class CaseImage:
    """An image and the truths of all patterns in it: none, one or two.

    Attributes:
        image: (H, W, 3) BGR, uint8 or uint16.
        truths: one truth per pattern.
        scene: the scene of the first pattern; None without a pattern.
    """

    image: Image
    truths: tuple[Truth, ...]
    scene: Scene | None


@dataclass(frozen=True, eq=False)
class PatternFrame:
    """One pattern, or two side by side, in an image of ``size`` (width, height) px each."""

    scene: Scene
    size: Size = STANDARD_SIZE
    second: Scene | None = None

    @property
    def layout(self) -> Layout:
        return self.scene.layout

    @property
    def pitch_px(self) -> float:
        return self.scene.camera.pitch_px

    @property
    def rng(self) -> np.random.Generator:
        """A new random stream of the scene's seed, for positions and choices."""
        return np.random.default_rng([self.scene.seed, 77])

    def with_parts(self, **changes: Any) -> PatternFrame:
        """The frame with other parts of the scene."""
        return replace(self, scene=replace(self.scene, **changes))

    def with_camera(self, **changes: Any) -> PatternFrame:
        """The frame with other parameters of the camera."""
        return self.with_parts(camera=replace(self.scene.camera, **changes))

    def with_light(self, **light: Any) -> PatternFrame:
        """The frame with another light."""
        return self.with_parts(light=Light(**light))

    def with_sensor(self, **sensor: Any) -> PatternFrame:
        """The frame with another sensor; the default noise is 2."""
        return self.with_parts(sensor=Sensor(**{"noise": 2.0, **sensor}))

    def blurred(self, blur_px: float) -> PatternFrame:
        """The frame with another blur."""
        return self.with_parts(optics=Optics(blur_px))

    def with_inks(self, **inks: RGB) -> PatternFrame:
        """The frame with other colors of some inks."""
        return self.with_parts(inks={**self.scene.inks, **inks})

    def with_surface(self, *deformations: Deformation) -> PatternFrame:
        """The frame with a deformed surface."""
        return self.with_parts(surface=composed(*deformations))

    def damaged(self, **damage: Any) -> PatternFrame:
        """The frame with damage."""
        return self.with_parts(damage=Damage(**damage))

    def scaled(self, pitch_px: float) -> PatternFrame:
        """The frame with another pitch, in an image of proportional size."""
        ratio = pitch_px / self.pitch_px
        size = (round(self.size[0] * ratio), round(self.size[1] * ratio))
        return replace(self.with_camera(pitch_px=pitch_px), size=size)

    def shoot(self) -> CaseImage:
        """Render the image."""
        first = render(self.scene, size=self.size)
        if self.second is None:
            return CaseImage(first.image, (first.truth,), self.scene)
        second = render(self.second, size=self.size)
        aside_px = np.array([self.size[0], 0])
        moved = replace(
            second.truth,
            marker_xy_px=second.truth.marker_xy_px + aside_px,
            virtual_xy_px=second.truth.virtual_xy_px + aside_px,
        )
        image = np.ascontiguousarray(np.hstack([first.image, second.image]))
        return CaseImage(image, (first.truth, moved), self.scene)


@dataclass(frozen=True, eq=False)
class EmptyFrame:
    """An image (H, W, 3) uint8 BGR without a pattern."""

    draw: Callable[[np.random.Generator, Size], NDArray[np.float32]]
    size: Size
    seed: int

    def shoot(self) -> CaseImage:
        """Draw the image."""
        drawn = self.draw(np.random.default_rng([self.seed, 78]), self.size)
        return CaseImage(np.clip(np.rint(drawn), 0, 255).astype(np.uint8), (), None)


def plain_frame(pattern: str, seed: int, layers: int = 11, size: Size = STANDARD_SIZE) -> PatternFrame:
    """The standard scene with a random rotation."""
    frame = PatternFrame(standard_scene(standard_layout(pattern, layers), seed=seed), size)
    turn = float(np.random.default_rng([seed, 79]).uniform(0, 360))
    return frame.with_camera(rotation_deg=turn)
