"""Stage 1: the target area, the tiles that a flood fill from the image's border does not reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.image.color import MIN_CHROMA, Colors
from extractor.numeric.compilation import compiled

TARGET_TILE_PX = 8  # pixels per side of a tile of the target area
MIN_CHROMA_QUANTILE = 0.95  # rank of the tile chroma that counts as strong
MIN_CHROMA_SHARE = 0.15  # of the strong chroma; tiles with less have no color


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
    return Target(mask=_target_mask(_tile_chroma(colors.chroma, TARGET_TILE_PX)), tile_px=TARGET_TILE_PX)


@compiled
def _tile_chroma(chroma, tile_px):  # type: ignore[no-untyped-def]
    """(rows, columns) uint8, the largest chroma in every tile of ``tile_px`` x ``tile_px`` pixels."""
    height, width = chroma.shape
    rows, columns = (height + tile_px - 1) // tile_px, (width + tile_px - 1) // tile_px
    largest, strongest = np.zeros((rows, columns), np.uint8), np.empty(width, np.uint8)
    flat = chroma.reshape(-1)
    for row in range(rows):
        strongest[:] = 0
        for y in range(row * tile_px, min((row + 1) * tile_px, height)):
            begin = np.uint64(y * width)
            for x in range(np.uint64(width)):
                strongest[x] = max(strongest[x], flat[begin + x])
        for column in range(columns):
            tile_max = np.uint8(0)
            for x in range(column * tile_px, min((column + 1) * tile_px, width)):
                tile_max = max(tile_max, strongest[x])
            largest[row, column] = tile_max
    return largest


@compiled
def _target_mask(chroma):  # type: ignore[no-untyped-def]
    """(rows, columns) uint8, 1 for tiles that the flood fill does not reach."""
    counts = np.zeros(256, np.int64)
    for level in chroma.ravel():
        counts[level] += 1
    rank, below, strong = int(MIN_CHROMA_QUANTILE * (chroma.size - 1)), counts[0], 0
    while below <= rank:
        strong += 1
        below += counts[strong]
    colored = (chroma > max(float(MIN_CHROMA), MIN_CHROMA_SHARE * strong)).astype(np.uint8)
    closed = _dilated(_dilated(colored, 1), 0)
    return 1 - _flooded(closed)


@compiled
def _dilated(mask, value):  # type: ignore[no-untyped-def]
    """The mask with ``value`` also in the eight tiles around each tile that has the value."""
    rows, columns = mask.shape
    out = mask.copy()
    for row in range(rows):
        for column in range(columns):
            if mask[row, column] == value:
                out[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = value
    return out


@compiled
def _flooded(barrier):  # type: ignore[no-untyped-def]
    """(rows, columns) uint8, 1 for tiles outside the barrier that are 4-connected to the image's border."""
    rows, columns = barrier.shape
    filled = np.zeros((rows, columns), np.uint8)
    stack, height = np.empty((4 * rows * columns + 2 * (rows + columns), 2), np.int32), 0
    for row in range(rows):
        for column in range(columns):
            if row == 0 or column == 0 or row == rows - 1 or column == columns - 1:
                stack[height, 0], stack[height, 1] = row, column
                height += 1
    while height > 0:
        height -= 1
        row, column = stack[height]
        if row < 0 or column < 0 or row == rows or column == columns:
            continue
        if barrier[row, column] or filled[row, column]:
            continue
        filled[row, column] = 1
        for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            stack[height, 0], stack[height, 1] = row + dy, column + dx
            height += 1
    return filled
