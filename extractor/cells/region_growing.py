"""Stage 4: the adaptive growing algorithm (AGA, the article's eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.cells import Cells
from extractor.image.pyramid import PyramidLevel

MAX_GROWN_AREA = 2.0  # of the seed's region; a larger region has leaked. Chosen


@dataclass(frozen=True, eq=False)
class Regions:
    """Stage 4.

    Attributes:
        region_map: (H, W) int32, the region of each pixel, counted from 1; 0 without a region.
        seed: (N, 2) int32, x and y of the pixel about which the moments are taken.
        moments: (N, 10) float64, sums of 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy over the region's pixels.
    """

    region_map: NDArray[np.int32]
    seed: NDArray[np.int32]
    moments: NDArray[np.float64]


def grow(view: PyramidLevel, cells: Cells) -> Regions:
    """Stage 4 (AGA): add 4-neighbours to each seed while eq. 3 is below a limit, with the mean updated after each wave.

    The seeds are the cells' centres. Eq. 3 uses OpenCV's 8-bit HSV (H 0..179, S and V 0..255). Differences and means of
    hue are circular; ``P . mean = 0`` (black) rejects the pixel instead of dividing.
    """
    height, width = view.image.shape[:2]
    seed = np.clip(np.rint(view.to_level(cells.centre_px)), 0, (width - 1, height - 1)).astype(np.int32)
    limit_px = np.maximum(MAX_GROWN_AREA * cells.area_px / view.scale**2, 1).astype(np.int64)
    hsv = cv2.cvtColor(view.image, cv2.COLOR_BGR2HSV)
    framed, moments = native.grow(np.asarray(hsv, np.uint8), seed, limit_px)
    return Regions(region_map=framed[1:-1, 1:-1], seed=seed, moments=moments)
