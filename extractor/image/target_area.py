"""Stage 1: the target area, which a flood from outside does not reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.image.color import MIN_CHROMA, Colors
from extractor.numeric.compilation import compiled

TARGET_TILE_PX = 8  # pixels per side of a tile of the target area
MIN_CHROMA_QUANTILE, MIN_CHROMA_SHARE = (
    0.95,
    0.15,
)  # tiles with less than this share of the chroma of that rank have no color


@dataclass(frozen=True, eq=False)
class Target:
    """Stage 1. ``mask`` (h, w) bool: pixels that may belong to the pattern, at 1/``tile_px`` of the image's scale."""

    mask: NDArray[np.uint8]
    tile_px: int


def find_target(colors: Colors) -> Target:
    """Stage 1: flood the image from outside; what the flood cannot reach may be pattern.

    Tiles without color are water; closing seals the gaps between cells first, so that the flood stops at the
    pattern's rim while its black cells stay dry.
    """
    return Target(mask=_target_mask(_tile_chroma(colors.chroma, TARGET_TILE_PX)), tile_px=TARGET_TILE_PX)


@compiled
def _tile_chroma(chroma, shrink):  # type: ignore[no-untyped-def]
    """The largest chroma in every tile of ``tile_px`` pixels."""
    height, width = chroma.shape
    rows, columns = (height + shrink - 1) // shrink, (width + shrink - 1) // shrink
    largest, strongest, flat = (
        np.zeros((rows, columns), np.uint8),
        np.empty(width, np.uint8),
        chroma.reshape(-1),
    )
    for row in range(rows):
        strongest[:] = 0
        for y in range(row * shrink, min((row + 1) * shrink, height)):
            begin = np.uint64(y * width)
            for x in range(np.uint64(width)):
                strongest[x] = max(strongest[x], flat[begin + x])
        for column in range(columns):
            most = np.uint8(0)
            for x in range(column * shrink, min((column + 1) * shrink, width)):
                most = max(most, strongest[x])
            largest[row, column] = most
    return largest


@compiled
def _target_mask(chroma):  # type: ignore[no-untyped-def]
    """(rows, columns) uint8, which tiles the flood does not reach."""
    counts = np.zeros(256, np.int64)
    for much in chroma.ravel():
        counts[much] += 1
    rank, below, strong = int(MIN_CHROMA_QUANTILE * (chroma.size - 1)), counts[0], 0
    while below <= rank:
        strong += 1
        below += counts[strong]
    colored = (chroma > max(float(MIN_CHROMA), MIN_CHROMA_SHARE * strong)).astype(np.uint8)
    closed = _dilated(_dilated(colored, 1), 0)
    return 1 - _flooded(closed)


@compiled
def _dilated(mask, value):  # type: ignore[no-untyped-def]
    """The mask with ``value`` in the eight tiles around each that has it, too."""
    rows, columns = mask.shape
    out = mask.copy()
    for row in range(rows):
        for column in range(columns):
            if mask[row, column] == value:
                out[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = value
    return out


@compiled
def _flooded(dry):  # type: ignore[no-untyped-def]
    """The tiles that are not dry and hang together with the image's border by their sides."""
    rows, columns = dry.shape
    wet = np.zeros((rows, columns), np.uint8)
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
        if dry[row, column] or wet[row, column]:
            continue
        wet[row, column] = 1
        for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            stack[height, 0], stack[height, 1] = row + dy, column + dx
            height += 1
    return wet
