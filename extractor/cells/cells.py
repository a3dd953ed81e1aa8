"""Stages 2 and 3: the cells of an image by contrast over the local black, in whatever channels show them best.

A cell is a triangle that is brighter than the black around it. Maps show cells: each channel, the sum of the channels,
and each channel over the mean of the others, or for coded pads over the least channel. In each map the regions above a
share of the local contrast are taken; regions with the moments of triangles may be cells. Of several at one place the
best triangle is kept. No hue and no color of the light is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.image.pyramid import PyramidLevel

MIN_SPREAD = 12  # between the channels of a colored pixel, gray levels; chosen
COLORED_SHARE = 0.002  # of an image that is not gray; chosen
MIN_TILE_PX = 6  # of the tiles of local levels; chosen
MAX_TILE_PX = 24


class Effort(NamedTuple):
    """The maps and levels in which cells are sought.

    Attributes:
        maps: (K,) int64, their numbers: 0 to 2 the channels, 3 their sum, 4 to 6 each channel over the mean of the
            others, 7 to 9 each channel over the least one.
        shares: of the local contrast, the levels.
    """

    maps: NDArray[np.int64]
    shares: NDArray[np.float64]


# Most images show every cell in a channel of its own; the others are looked at closely.
# Chosen, for time.
EFFORTS = (
    Effort(np.arange(3), np.array([0.5])),
    Effort(np.arange(7), np.array([0.32, 0.5, 0.65])),
    Effort(np.arange(7), np.array([0.2, 0.42, 0.75])),
)
# The white cells of a coded pad lie at the sides of inks, and no channel shows both apart. Over the least channel white
# is as dark as black.
OVER_LEAST = np.arange(7, 10)
CODED_EFFORTS = (
    Effort(OVER_LEAST, EFFORTS[0].shares),
    *(one._replace(maps=np.concatenate([np.arange(4), OVER_LEAST])) for one in EFFORTS[1:]),
)


@dataclass(frozen=True, eq=False)
class Cells:
    """The regions of an image that may be colored cells.

    Attributes:
        centre_px: (N, 2) float64 in the image frame.
        area_px: (N,) float64, px^2.
        corner_px: (N, 3, 2) float64, the corners of the triangle with the region's moments, clockwise in the image.
        quality: (N,) float64, how well the region is a triangle, at most 1.
        share: (N,) float64, the level of the region as a share of the local contrast.
    """

    centre_px: NDArray[np.float64]
    area_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    quality: NDArray[np.float64]
    share: NDArray[np.float64]


NO_CELLS = Cells(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 3, 2)), np.zeros(0), np.zeros(0))


def has_color(image: NDArray[np.uint8]) -> bool:
    """Whether some pixels of an image (H, W, 3) have a color: others than gray, black and white."""
    spread = image.max(axis=2) - image.min(axis=2)
    return bool(np.count_nonzero(spread >= MIN_SPREAD) > COLORED_SHARE * spread.size)


def find_cells(
    view: PyramidLevel, largest_edge_px: float, effort: Effort, before: Cells | None = None
) -> Cells:
    """The regions that may be cells.

    Args:
        view: the image at the scale of recognition.
        largest_edge_px: edges, at full scale, of a pattern that fills the image; sizes the tiles of local levels.
        effort: maps and levels.
        before: regions that were found with less effort.
    """
    scale = view.scale
    # a cell and its black neighbours fit into three by three tiles
    tile_px = int(min(max(0.5 * largest_edge_px / scale, MIN_TILE_PX), MAX_TILE_PX))
    known = NO_CELLS
    if before is not None:
        known = replace(
            before,
            centre_px=view.to_level(before.centre_px),
            area_px=before.area_px / scale**2,
            corner_px=view.to_level(before.corner_px),
        )
    image = np.ascontiguousarray(view.image)
    found = native.find_candidates(image, effort.maps, effort.shares, known, tile_px)
    return replace(
        found,
        centre_px=view.to_full_scale(found.centre_px),
        area_px=found.area_px * scale**2,
        corner_px=view.to_full_scale(found.corner_px),
    )
