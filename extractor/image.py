"""What comes in: an image of any common kind becomes 8-bit BGR; what is not an image is refused."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .errors import ImageError

MIN_SIDE_PX = 16
NOISE_ROWS, NOISE_COLUMNS = 60, 120  # how many places the noise is estimated from


def prepare(image: NDArray[Any]) -> NDArray[np.uint8] | None:
    """The image as contiguous (H, W, 3) uint8 BGR, or None when it has no color.

    16-bit images are scaled to 8 bits (value / 257, rounded), the alpha of BGRA is dropped, and a grayscale image
    ((H, W) or (H, W, 1)) has no color to read.

    Raises:
        ImageError: not an array, a float or signed type, another shape, or a side below 16 px.
    """
    if not isinstance(image, np.ndarray):
        raise ImageError(
            f"image is {type(image).__name__}; give a numpy array (H, W, 3) of uint8 in BGR order"
        )
    if image.dtype not in (np.uint8, np.uint16):
        raise ImageError(
            f"image has dtype {image.dtype}; give uint8 or uint16 (scale float images to 0..255 first)"
        )
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3, 4)):
        raise ImageError(
            f"image has shape {image.shape}; give (H, W, 3) BGR, (H, W, 4) BGRA or (H, W) grayscale"
        )
    if min(image.shape[:2]) < MIN_SIDE_PX:
        raise ImageError(
            f"image is {image.shape[1]} x {image.shape[0]} px; give at least {MIN_SIDE_PX} px a side"
        )
    if image.ndim == 2 or image.shape[2] == 1:
        return None
    color = image[:, :, :3]
    if color.dtype == np.uint16:
        color = cv2.convertScaleAbs(color, alpha=1 / 257)
    return np.ascontiguousarray(color, dtype=np.uint8)


def estimate_noise(image: NDArray[np.uint8]) -> float:
    """Standard deviation of a channel's noise in grey levels (Immerkaer 1996, with a median against edges).

    The Laplacian-like mask [1 -2 1; -2 4 -2; 1 -2 1] ignores straight edges; its response to noise is 6 sigma.
    """
    every = max(1, image.shape[0] // NOISE_ROWS)
    counts = _responses(image, every, max(1, image.shape[1] // NOISE_COLUMNS))
    below = np.cumsum(counts)
    bin_of = int(np.searchsorted(below, 0.5 * below[-1]))
    # responses are integers: each stands for half a step on both sides
    median = bin_of + 0.5 - (below[bin_of] - 0.5 * below[-1]) / counts[bin_of]
    return float(median / (6 * 0.6745))


@compiled
def _responses(image, every_row, every_column):  # type: ignore[no-untyped-def]
    """How often the mask's absolute response in the green channel is 0, 1, 2 ..."""
    counts = np.zeros(8 * 255 + 1, np.int64)
    for y in range(1, image.shape[0] - 1, every_row):
        for x in range(1, image.shape[1] - 1, every_column):
            total = np.int64(0)
            for dy in range(-1, 2):
                column = np.int64(image[y + dy, x - 1, 1]) + np.int64(image[y + dy, x + 1, 1])
                column -= 2 * np.int64(image[y + dy, x, 1])
                total += -2 * column if dy == 0 else column
            counts[abs(total)] += 1
    return counts
