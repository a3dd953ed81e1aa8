"""An image at a reduced scale: what is blurred, or large, needs no fine pixels."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray


class Frame(NamedTuple):
    """The image coordinates of polynomials: (x - x) / scale, (y - y) / scale."""

    x: float
    y: float
    scale: float


class Sight(NamedTuple):
    """An image at 1/``scale`` of its size, and the coordinates of its polynomials."""

    image: NDArray[np.uint8]
    scale: int
    frame: Frame

    def reduced(self, xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the full image in this one."""
        return (xy_px + 0.5) / self.scale - 0.5

    def full(self, xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of this image in the full one."""
        return (xy_px + 0.5) * self.scale - 0.5


class Sights:
    """One image at every scale that is asked for, each made once."""

    def __init__(self, image: NDArray[np.uint8]) -> None:
        self._image = image
        self._made: dict[int, Sight] = {}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height at full scale, px."""
        return self._image.shape[1], self._image.shape[0]

    def at(self, scale: int) -> Sight:
        """The image reduced by averaging ``scale`` x ``scale`` pixels."""
        if scale not in self._made:
            self._made[scale] = _sight(self._image, scale)
        return self._made[scale]


def _sight(image: NDArray[np.uint8], scale: int) -> Sight:
    if scale > 1:
        width, height = image.shape[1] // scale, image.shape[0] // scale
        whole = image[: height * scale, : width * scale]
        image = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)  # type: ignore[assignment]
    height, width = image.shape[:2]
    return Sight(image, scale, Frame(0.5 * width, 0.5 * height, 0.5 * max(width, height)))
