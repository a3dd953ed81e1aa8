"""An image at reduced scales: blurred or large images need no fine pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native
from extractor.image.response import ResponseTables


class PolynomialFrame(NamedTuple):
    """The coordinates of polynomials over an image: (px - x) / scale, (py - y) / scale, for a pixel (px, py)."""

    x: float
    y: float
    scale: float


class PyramidLevel(NamedTuple):
    """An image at 1/``scale`` of the full size.

    Attributes:
        image: (H, W, 3) uint8, the values of the mean light of ``scale`` x ``scale`` pixels.
        scale: full-scale pixels per pixel.
        frame: the coordinates of polynomials over this image.
        response: from values to light.
    """

    image: NDArray[np.uint8]
    scale: int
    frame: PolynomialFrame
    response: ResponseTables

    def to_level(self, xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 2) of the full image in this level, px."""
        return (xy_px + 0.5) / self.scale - 0.5

    def to_full_scale(self, xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 2) of this level in the full image, px."""
        return (xy_px + 0.5) * self.scale - 0.5


class Pyramid:
    """One image at several scales; each level is computed on its first use.

    Args:
        image: (H, W, 3) uint8.
        response: leads from values to light. Pixels are averaged as light.
    """

    def __init__(self, image: NDArray[np.uint8], response: ResponseTables) -> None:
        self._image = image
        self._response = response
        self._levels: dict[int, PyramidLevel] = {}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height at full scale, px."""
        return self._image.shape[1], self._image.shape[0]

    @property
    def response(self) -> ResponseTables:
        """From values to light."""
        return self._response

    def level(self, scale: int) -> PyramidLevel:
        """The image reduced by averaging the light of ``scale`` x ``scale`` pixels."""
        if scale not in self._levels:
            self._levels[scale] = _pyramid_level(self._image, scale, self._response)
        return self._levels[scale]


def _pyramid_level(image: NDArray[np.uint8], scale: int, response: ResponseTables) -> PyramidLevel:
    if scale > 1:
        image = native.block_means(image, scale, response.light_steps, response.value_of_steps)
    height, width = image.shape[:2]
    frame = PolynomialFrame(0.5 * width, 0.5 * height, 0.5 * max(width, height))
    return PyramidLevel(image, scale, frame, response)
