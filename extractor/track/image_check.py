"""What the image says of predicted cells: whether each shows its own ink inside and nothing of it beyond its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.bilinear import fill_patch_mean, weighted_sample
from extractor.numeric.compilation import compiled
from extractor.numeric.dense_systems import dot3
from extractor.track.warm_tables import BLACK_CELL, NO_CELL, WHITE_CELL, WarmTables

MIN_WHITE_RATIO = (
    0.75  # the white cell's brightness against an ink's, summed over the channels; black stays below
)
MIN_COSINE = 0.8  # between an ink and the same cell's ink a frame ago, black subtracted
STRENGTH_RANGE = (0.4, 2.5)  # of an ink against the same cell's a frame ago
INNER_SAMPLE_POSITION = 0.5  # of the way from the middle to each corner, where the ink is looked at again
MIN_INNER_STRENGTH = 0.4  # of the ink's strength that must be there
LEVEL_RADIUS = 0.15  # of the middle's distance to the corners, over which the ink is averaged

UNSEEN, CONTRADICTED, CONFIRMED = range(3)  # what the image says of a cell


@dataclass(frozen=True, eq=False)
class CellCheck:
    """What the image says of predicted cells.

    Attributes:
        verdict: (C,) uint8, ``UNSEEN`` (outside the image or not predicted), ``CONTRADICTED`` or ``CONFIRMED``.
        look: (2, C, 3) float64 BGR, each seen cell's ink minus the black around it, and this black.
        white, not_white: how many edges of inked cells see the white cell beyond them where it belongs, and do not.
        other_white: how many see something as bright where a black cell belongs.
    """

    verdict: NDArray[np.uint8]
    cell_levels: NDArray[np.float64]
    white: int
    white_missing_count: int
    white_elsewhere_count: int


@compiled
def _check_cells(image, xy, ink, beyond, nearest, before, compare):  # type: ignore[no-untyped-def]
    """Verdict and look of every cell with the corners ``xy`` (C, 3, 2); how often white is seen where it belongs."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    count = xy.shape[0]
    verdict = np.zeros(count, np.uint8)
    look = np.full((2, count, 3), np.nan)
    middle, black, other = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    white, not_white, other_white = 0, 0, 0
    for i in range(count):
        x, y = xy[i, :, 0].mean(), xy[i, :, 1].mean()
        size = np.hypot(xy[i, 0, 0] - x, xy[i, 0, 1] - y)
        radius = LEVEL_RADIUS * size
        if not fill_patch_mean(flat, height, width, x, y, radius, middle):
            continue
        blacks, fits, outside = 0, True, False
        black[:] = 0.0
        for k in range(3):
            if beyond[i, k] == NO_CELL:
                continue
            mx = xy[i, k, 0] + xy[i, (k + 1) % 3, 0] - x
            my = xy[i, k, 1] + xy[i, (k + 1) % 3, 1] - y
            if not fill_patch_mean(flat, height, width, mx, my, radius, other[k]):
                outside = True
                continue
            bright = other[k].sum() > MIN_WHITE_RATIO * middle.sum()
            if beyond[i, k] == WHITE_CELL:
                white += bright
                not_white += not bright
            else:
                other_white += bright
                fits = fits and not bright
                black += other[k]
                blacks += 1
        if outside or blacks == 0:
            continue
        own = look[0, i]
        for channel in range(3):
            own[channel] = middle[channel] - black[channel] / blacks
            look[1, i, channel] = black[channel] / blacks
        strength = dot3(own, own)
        for k in range(3):
            px, py = (
                x + INNER_SAMPLE_POSITION * (xy[i, k, 0] - x),
                y + INNER_SAMPLE_POSITION * (xy[i, k, 1] - y),
            )
            at = weighted_sample(flat, height, width, px, py, own[0], own[1], own[2])
            fits = fits and at - dot3(own, black) / blacks > MIN_INNER_STRENGTH * strength
            if beyond[i, k] == BLACK_CELL:
                fits = (
                    fits and dot3(other[k], own) - dot3(black, own) / blacks < MIN_INNER_STRENGTH * strength
                )
        if compare:
            ratio = dot3(own, before[i]) / max(dot3(before[i], before[i]), 1e-9)
            fits = fits and ratio > STRENGTH_RANGE[0] and ratio < STRENGTH_RANGE[1]
            best, best_cosine = 0, -1.0
            for k in range(3):
                hue = before[nearest[i, k]]
                cosine = dot3(own, hue) / np.sqrt(max(strength * dot3(hue, hue), 1e-9))
                if cosine > best_cosine:
                    best, best_cosine = k + 1, cosine
            fits = fits and best == ink[i] and best_cosine > MIN_COSINE
        verdict[i] = CONFIRMED if fits else CONTRADICTED
    return verdict, look, white, not_white, other_white


def check_cells(
    image: NDArray[np.uint8],
    corner_px: NDArray[np.float64],
    tables: WarmTables,
    look: NDArray[np.float64] | None,
) -> CellCheck:
    """Compare cells with corners at (C, 3, 2) (NaN: not predicted) with the image, and their inks with
    ``cell_levels``."""
    before = np.zeros((len(tables.ink), 3)) if look is None else look[0]
    return CellCheck(
        *_check_cells(image, corner_px, tables.ink, tables.beyond, tables.nearest, before, look is not None)
    )
