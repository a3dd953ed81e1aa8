"""Stage 2: the ink of every pixel, by hues and levels found in the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native
from extractor.image.color import LIMITS as HUE_LIMITS
from extractor.image.color import Colors, HueLimits
from extractor.image.target_area import Target


class LabelLimits(NamedTuple):
    """Limits of the pixels' labels.

    Attributes:
        level_share: a pixel shows an ink when its chroma exceeds this share of the ink's local level. Chosen.
        min_chroma: gray levels, the lowest chroma of an ink, as in ``HueLimits``. Derived.
        tile_px: side of the smallest tiles in which levels are local. Chosen.
        tiles_across: that many larger tiles lie across an image. Chosen.
        survey_pixels: in larger images, hues and levels come from every other pixel of every other row. Chosen.
        hues: of the inks' hues.
    """

    level_share: float = 0.4
    min_chroma: int = HUE_LIMITS.min_chroma
    tile_px: int = 32
    tiles_across: int = 12
    survey_pixels: int = 20_000
    hues: HueLimits = HUE_LIMITS


LIMITS = LabelLimits()


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
    found, label, hues, chroma = native.segment(colors.hue, colors.chroma, target, nominal_deg, LIMITS)
    return Segmentation(hsv=colors.hsv, label=label, hues_deg=hues, chroma=chroma) if found else None
