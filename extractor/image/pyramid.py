"""An image at reduced scales: blurred or large images need no fine pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.response import LIGHT_STEPS, ResponseTables
from extractor.numeric.compilation import compiled, inlined


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
    if scale == 2:
        image = _halved(image, response.light_steps, response.value_of_steps)
    elif scale > 1:
        image = _block_means(image, scale, response.light_steps, response.value_of_steps)
    height, width = image.shape[:2]
    frame = PolynomialFrame(0.5 * width, 0.5 * height, 0.5 * max(width, height))
    return PyramidLevel(image, scale, frame, response)


@compiled
def _block_means(image, scale, light_steps, value_of_steps):  # type: ignore[no-untyped-def]
    """(H // scale, W // scale, 3) uint8: the values of the mean light of ``scale`` x ``scale`` pixels."""
    height, width, row = image.shape[0] // scale, image.shape[1] // scale, 3 * image.shape[1]
    out = np.empty((height, width, 3), np.uint8)
    flat, means = image.reshape(-1), out.reshape(-1)
    column = np.empty(row, np.uint32)
    total = np.empty(3 * width, np.uint32)
    share, half, last = np.float32(1.0 / scale**2), np.float32(0.5), np.uint32(LIGHT_STEPS - 1)
    for y in range(height):
        line = flat[scale * y * row : (scale * y + 1) * row]
        for i in range(row):
            column[i] = light_steps[line[i]]
        for k in range(1, scale):
            line = flat[(scale * y + k) * row : (scale * y + k + 1) * row]
            for i in range(row):
                column[i] += light_steps[line[i]]
        _fill_block_sums(column, scale, width, total)
        line = means[3 * y * width : 3 * (y + 1) * width]
        for i in range(3 * width):
            line[i] = value_of_steps[min(np.uint32(np.float32(total[i]) * share + half), last)]
    return out


@inlined
def _fill_block_sums(column, scale, width, total):  # type: ignore[no-untyped-def]
    """Write the sums of ``scale`` adjacent pixels of a row into ``total`` (3 * width,), all channels at once."""
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    i = np.uint64(0)
    for x in range(np.uint64(width)):
        blue, green, red = np.uint32(0), np.uint32(0), np.uint32(0)
        for _ in range(scale):
            blue += column[i]
            green += column[i + one]
            red += column[i + two]
            i += three
        total[three * x], total[three * x + one], total[three * x + two] = blue, green, red


@compiled
def _halved(image, light_steps, value_of_steps):  # type: ignore[no-untyped-def]
    """The same for 2 x 2 pixels, in half of the time."""
    height, width, row = image.shape[0] // 2, image.shape[1] // 2, 3 * image.shape[1]
    out = np.empty((height, width, 3), np.uint8)
    flat, means = image.reshape(-1), out.reshape(-1)
    three, six, two = np.uint64(3), np.uint64(6), np.uint32(2)
    for y in range(height):
        above, below = flat[2 * y * row : (2 * y + 1) * row], flat[(2 * y + 1) * row : (2 * y + 2) * row]
        line = means[3 * y * width : 3 * (y + 1) * width]
        for x in range(np.uint64(width)):
            for channel in range(three):
                k = six * x + channel
                left = np.uint32(light_steps[above[k]]) + np.uint32(light_steps[below[k]])
                right = np.uint32(light_steps[above[k + three]]) + np.uint32(light_steps[below[k + three]])
                line[three * x + channel] = value_of_steps[(left + right + two) >> two]
    return out
