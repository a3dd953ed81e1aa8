"""The article's regions: seeds by the hues of the inks, grown by AGA.

The extractor seeds by contrast instead. Pixels with color are divided from black by Otsu's threshold on the chroma, and
have the ink whose hue is the nearest.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.cells.region_growing import grow
from extractor.image.pyramid import PyramidLevel

MIN_SEED_AREA_PX = 4  # of a domain of one ink; smaller ones are clutter


@dataclass(frozen=True, eq=False)
class InkRegions:
    """Grown regions.

    Attributes:
        region_map: (H, W) int32, the region of each pixel, counted from 1; 0 without a region.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
    """

    region_map: NDArray[np.int32]
    ink: NDArray[np.uint8]


def grow_from_hues(view: PyramidLevel, palette: dict[str, str]) -> InkRegions:
    """The regions of an image, one for each domain of one ink."""
    label = _ink_of_pixels(view.image, palette)
    seeds, areas, inks = [], [], []
    for ink in (1, 2, 3):
        _, _, stats, centres = cv2.connectedComponentsWithStats(
            (label == ink).astype(np.uint8), connectivity=4
        )
        for area, (x, y) in zip(stats[1:, cv2.CC_STAT_AREA].tolist(), centres[1:], strict=True):
            if area >= MIN_SEED_AREA_PX and label[round(y), round(x)] == ink:
                seeds.append((x, y))
                areas.append(float(area))
                inks.append(ink)
    count = len(seeds)
    centre = np.array(seeds, np.float64).reshape(count, 2)
    none = np.zeros(count)
    regions = grow(view, Cells(centre, np.array(areas), np.zeros((count, 3, 2)), none, none))
    is_leak = np.concatenate([[True], regions.moments[:, 0] == 0])
    region_map = np.where(is_leak[regions.region_map], 0, regions.region_map)
    return InkRegions(region_map, np.array(inks, np.uint8))


def _ink_of_pixels(image: NDArray[np.uint8], palette: dict[str, str]) -> NDArray[np.uint8]:
    """(H, W) uint8, 1 red, 2 green, 3 blue by the nearest hue; 0 for pixels without color."""
    inks = [[int(palette[name][i : i + 2], 16) for i in (5, 3, 1)] for name in ("red", "green", "blue")]
    nominal = cv2.cvtColor(np.array([inks], np.uint8), cv2.COLOR_BGR2HSV)[0, :, 0].astype(np.int16)
    hue = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[..., 0].astype(np.int16)
    away = np.abs((hue[..., None] - nominal + 90) % 180 - 90)
    chroma = (image.max(axis=2) - image.min(axis=2)).astype(np.uint8)
    _, colored = cv2.threshold(chroma, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return np.where(colored > 0, away.argmin(axis=2) + 1, 0).astype(np.uint8)
