"""Backgrounds of the pattern: a color, a picture, or generated clutter that may resemble a pattern."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError

RGB = tuple[float, float, float]
Planes = NDArray[np.float32]


class Background(Protocol):
    """``planes`` draws (3, height, width) float32, channels B, G, R, 0 to 255, for an image of (width, height) px."""

    def planes(self, size: tuple[int, int], rng: np.random.Generator) -> Planes: ...


@dataclass(frozen=True)
class Plain:
    """One color."""

    __pydantic_config__: ClassVar = STRICT

    rgb: RGB = (20.0, 20.0, 20.0)

    def planes(self, size: tuple[int, int], rng: np.random.Generator) -> Planes:
        width, height = size
        color = np.asarray(self.rgb[::-1], dtype=np.float32)[:, None, None]
        return np.broadcast_to(color, (3, height, width))


@dataclass(frozen=True)
class Gradient:
    """A linear gradient from one color to another along a direction, counter-clockwise from the right."""

    __pydantic_config__: ClassVar = STRICT

    rgb_from: RGB = (60.0, 70.0, 80.0)
    rgb_to: RGB = (190.0, 180.0, 170.0)
    angle_deg: float = 30.0

    def planes(self, size: tuple[int, int], rng: np.random.Generator) -> Planes:
        width, height = size
        angle = np.radians(self.angle_deg)
        x, y = np.linspace(-1, 1, width), np.linspace(1, -1, height)
        along = np.cos(angle) * x[None, :] + np.sin(angle) * y[:, None]
        share = 0.5 + 0.5 * along / (abs(np.cos(angle)) + abs(np.sin(angle)))
        ends = np.asarray([self.rgb_from[::-1], self.rgb_to[::-1]])[:, :, None, None]
        return np.asarray(ends[0] * (1 - share) + ends[1] * share, dtype=np.float32)


@dataclass(frozen=True)
class Paper:
    """Paper: a warm white with fibres, grain and slow shading."""

    __pydantic_config__: ClassVar = STRICT

    rgb: RGB = (236.0, 230.0, 216.0)
    grain: float = 4.0

    def planes(self, size: tuple[int, int], rng: np.random.Generator) -> Planes:
        import cv2

        width, height = size
        fine = cv2.GaussianBlur(rng.standard_normal((height, width), dtype=np.float32), (0, 0), 0.8)
        fibres = cv2.GaussianBlur(
            rng.standard_normal((height, width), dtype=np.float32), (0, 0), 6.0, sigmaY=1.2
        )
        coarse = rng.standard_normal((max(height // 64, 2), max(width // 64, 2)), dtype=np.float32)
        shade = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        texture = self.grain * (fine / fine.std() + 0.5 * fibres / fibres.std() + 0.7 * shade)
        return np.asarray(
            np.asarray(self.rgb[::-1], dtype=np.float32)[:, None, None] + texture, dtype=np.float32
        )


@dataclass(frozen=True)
class Busy:
    """A cluttered desk: discs, boxes, lines and triangles in all colors.

    Attributes:
        shapes: the number of shapes.
        triangles: draw only triangles in red, green, blue and white, the hardest clutter for this pattern.
    """

    __pydantic_config__: ClassVar = STRICT

    shapes: int = 150
    triangles: bool = False

    def planes(self, size: tuple[int, int], rng: np.random.Generator) -> Planes:
        import cv2

        width, height = size
        scale = min(size) / 12
        image = np.full((height, width, 3), rng.uniform(40, 200, 3), dtype=np.float32)
        inks = [(45, 50, 200), (60, 150, 40), (190, 60, 45), (235, 235, 235)]
        for _ in range(self.shapes):
            centre = rng.uniform((0, 0), (width, height))
            radius = scale * rng.uniform(0.15, 1.0)
            color = inks[rng.integers(4)] if self.triangles else tuple(rng.uniform(0, 255, 3))
            kind = 3 if self.triangles else rng.integers(4)
            turn = rng.uniform(0, 2 * np.pi)
            if kind == 0:
                cv2.circle(image, centre.astype(int).tolist(), int(radius), color, -1, cv2.LINE_AA)
            elif kind == 1:
                end = centre + 4 * radius * np.array([np.cos(turn), np.sin(turn)])
                cv2.line(image, centre.astype(int).tolist(), end.astype(int).tolist(), color, 2, cv2.LINE_AA)
            else:
                corners = turn + 2 * np.pi * np.arange(6 - kind) / (6 - kind)
                points = centre + radius * np.stack([np.cos(corners), np.sin(corners)], axis=-1)
                cv2.fillPoly(image, [points.astype(np.int32)], color, cv2.LINE_AA)
        return np.ascontiguousarray(image.transpose(2, 0, 1))


@dataclass(frozen=True, eq=False)
class Picture:
    """An image (H, W, 3) uint8 BGR, resized to the whole image."""

    image: NDArray[np.uint8]

    def __post_init__(self) -> None:
        if (
            self.image.dtype != np.uint8
            or self.image.ndim != 3
            or self.image.shape[2] != 3
            or not self.image.size
        ):
            raise SceneError(
                f"the background picture is {self.image.dtype} of shape {self.image.shape}; "
                "give uint8 BGR of shape (H, W, 3)"
            )

    def planes(self, size: tuple[int, int], rng: np.random.Generator) -> Planes:
        import cv2

        shrinks = size[0] < self.image.shape[1]
        scaled = cv2.resize(self.image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
        return np.ascontiguousarray(scaled.transpose(2, 0, 1), dtype=np.float32)
