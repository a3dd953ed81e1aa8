"""Stage 1: the target area, the tiles that a flood fill from the image's border does not reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native
from extractor.image.color import LIMITS as HUE_LIMITS
from extractor.image.color import Colors

TARGET_TILE_PX = 8  # pixels per side of a tile of the target area


class TargetLimits(NamedTuple):
    """Limits of the target area.

    Attributes:
        strong_quantile: rank of the tile chroma that counts as strong. Chosen.
        strong_share: of the strong chroma; tiles with less have no color. Chosen.
        min_chroma: gray levels; tiles with less have no color either, as in ``HueLimits``. Derived.
    """

    strong_quantile: float = 0.95
    strong_share: float = 0.15
    min_chroma: int = HUE_LIMITS.min_chroma


LIMITS = TargetLimits()


@dataclass(frozen=True, eq=False)
class Target:
    """The result of stage 1.

    Attributes:
        mask: (h, w) uint8, 1 for tiles that may belong to the pattern.
        tile_px: side of a tile, px.
    """

    mask: NDArray[np.uint8]
    tile_px: int


def find_target(colors: Colors) -> Target:
    """Stage 1: fill the tiles without color from the image's border; the remaining tiles may be pattern.

    A morphological closing of the colored tiles comes first. It closes the gaps between cells, so that the flood fill
    stops at the pattern's rim and does not reach the black cells.
    """
    chroma = native.tile_chroma(colors.chroma, TARGET_TILE_PX)
    return Target(mask=native.target_mask(chroma, LIMITS), tile_px=TARGET_TILE_PX)
