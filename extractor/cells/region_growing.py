"""Stage 4: the adaptive growing algorithm (AGA, the article's eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.seeds import Seeds
from extractor.image.ink_segmentation import Segmentation


class GrowLimits(NamedTuple):
    """The limit of growing.

    Attributes:
        threshold: of eq. 3 over OpenCV's 8-bit HSV, below which a pixel belongs to the region; as in the article.
            Published: the article, below eq. 3.
    """

    threshold: float = 0.15


LIMITS = GrowLimits()


@dataclass(frozen=True, eq=False)
class Regions:
    """Stage 4.

    Attributes:
        region_map: (H, W) int32, the region of each pixel, counted from 1; 0 without a region.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        seed: (N, 2) int32, x and y of the pixel about which the moments are taken.
        moments: (N, 10) float64, sums of 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy over the region's pixels.
    """

    region_map: NDArray[np.int32]
    ink: NDArray[np.uint8]
    seed: NDArray[np.int32]
    moments: NDArray[np.float64]


def grow(segmentation: Segmentation, seeds: Seeds) -> Regions:
    """Stage 4 (AGA): add 4-neighbours to each seed while eq. 3 is below a limit, with the mean updated after each wave.

    Eq. 3 uses OpenCV's 8-bit HSV (H 0..179, S and V 0..255). Differences and means of hue are circular;
    ``P . mean = 0`` (black) rejects the pixel instead of dividing. A region never enters another ink's domain.
    """
    limit_px = segmentation.label.size // 6
    framed, moments = native.grow(segmentation.hsv, segmentation.label, seeds.xy, seeds.ink, limit_px, LIMITS)
    return Regions(region_map=framed[1:-1, 1:-1], ink=seeds.ink, seed=seeds.xy, moments=moments)
