"""Stage 2: the ink of every pixel, by hues and levels found in the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native
from extractor.image.color import LIMITS as HUE_LIMITS
from extractor.image.color import Colors, find_hues, hue_weights, ink_of_hue
from extractor.image.target_area import TARGET_TILE_PX, Target

TILE_PX = 32  # side of the smallest tiles in which levels are local
SURVEY_PIXELS = 20_000  # in larger images, hues and levels come from every other pixel of every other row


class LabelLimits(NamedTuple):
    """Limits of the pixels' labels.

    Attributes:
        level_share: a pixel shows an ink when its chroma exceeds this share of the ink's local level. Chosen.
        min_chroma: gray levels, the lowest chroma of an ink, as in ``HueLimits``. Derived.
    """

    level_share: float = 0.4
    min_chroma: int = HUE_LIMITS.min_chroma


LIMITS = LabelLimits()


class LabelTiles(NamedTuple):
    """The tiles by which pixels are labelled.

    Attributes:
        threshold: (3, rows, columns) uint8, the minimum chroma of an ink's pixels in each tile.
        tile_px: side of these tiles, px.
        target: (h, w) uint8, 1 in the target area.
        target_tile_px: side of these tiles, px.
    """

    threshold: NDArray[np.uint8]
    tile_px: int
    target: NDArray[np.uint8]
    target_tile_px: int


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The result of stage 2.

    Attributes:
        hsv: (H, W, 3) uint8, OpenCV's scale: H 0..179 (2 degrees per step), S and V 0..255.
        label: (H, W) uint8, 0 none, 1 red, 2 green, 3 blue.
        hues_deg: (3,) float64, the inks' hues as found.
        chroma: (3,) float64, the inks' typical chroma (max - min of B, G, R), 0..255.
    """

    hsv: NDArray[np.uint8]
    label: NDArray[np.uint8]
    hues_deg: NDArray[np.float64]
    chroma: NDArray[np.float64]


def segment(colors: Colors, target: Target, nominal_deg: NDArray[np.float64]) -> Segmentation | None:
    """Stage 2: label every pixel of the target area with its ink; None when one of the three inks is absent.

    Args:
        nominal_deg: (3,) hues of red, green and blue in the palette, degrees.
    """
    hue, chroma = colors.hue, colors.chroma
    tile = max(TILE_PX, min(chroma.shape) // 12 // TARGET_TILE_PX * TARGET_TILE_PX)
    survey_hue, survey_chroma, survey_tile = hue, chroma, tile
    if chroma.size > SURVEY_PIXELS:
        survey_hue, survey_chroma = native.subsampled(hue), native.subsampled(chroma)
        survey_tile = tile // 2
    hues = find_hues(hue_weights(survey_hue, survey_chroma), nominal_deg)
    if hues is None:
        return None
    ranges = native.hue_ranges(ink_of_hue(hues))
    level = native.tile_max_chroma(survey_hue, survey_chroma, ranges, survey_tile, LIMITS)
    threshold, typical = native.tile_thresholds(level, LIMITS)
    tiles = LabelTiles(threshold, tile, target.mask, target.tile_px)
    label = native.label_pixels(hue, chroma, ranges, tiles)
    return Segmentation(hsv=colors.hsv, label=label, hues_deg=hues, chroma=typical)
