"""Bilinear samples of an image at sub-pixel points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import numeric as native


def fill_patch_mean(
    flat: NDArray[np.uint8],
    height: int,
    width: int,
    x: float,
    y: float,
    radius: float,
    out: NDArray[np.float64],
) -> bool:
    """Write the mean (3,) of seven samples, at (x, y) and on a hexagon of ``radius`` px; False outside the image.

    The image (H, W, 3) is passed as ``flat`` (3 H W,) with its height and width.
    """
    return native.fill_patch_mean(flat, height, width, x, y, radius, out)
