"""What the image says of predicted cells: whether each shows its own ink inside and nothing of it beyond its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.bilinear import sample_dot, sample_patch
from extractor.numeric.compilation import compiled
from extractor.numeric.dense_systems import dot
from extractor.track.warm_tables import BLACK_CELL, NO_CELL, WHITE_CELL, Tables

WHITE_RATIO = (
    0.75  # the white cell's brightness against an ink's, summed over the channels; black stays below
)
MIN_COSINE = 0.8  # between an ink and the same cell's ink a frame ago, black subtracted
STRENGTH = (0.4, 2.5)  # of an ink against the same cell's a frame ago
INNER = 0.5  # of the way from the middle to each corner, where the ink is looked at again
MIN_INNER = 0.4  # of the ink's strength that must be there
LEVEL_RADIUS = 0.15  # of the middle's distance to the corners, over which the ink is averaged

UNSEEN, WRONG, RIGHT = range(3)  # what the image says of a cell


@dataclass(frozen=True, eq=False)
class Proof:
    """What the image says of predicted cells.

    Attributes:
        verdict: (C,) uint8, ``UNSEEN`` (outside the image or not predicted), ``WRONG`` or ``RIGHT``.
        look: (2, C, 3) float64 BGR, each seen cell's ink minus the black around it, and this black.
        white, not_white: how many edges of inked cells see the white cell beyond them where it belongs, and do not.
        other_white: how many see something as bright where a black cell belongs.
    """

    verdict: NDArray[np.uint8]
    look: NDArray[np.float64]
    white: int
    not_white: int
    other_white: int


@compiled
def _examine(image, xy, ink, beyond, nearest, before, compare):  # type: ignore[no-untyped-def]
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
        if not sample_patch(flat, height, width, x, y, radius, middle):
            continue
        blacks, fits, outside = 0, True, False
        black[:] = 0.0
        for k in range(3):
            if beyond[i, k] == NO_CELL:
                continue
            mx = xy[i, k, 0] + xy[i, (k + 1) % 3, 0] - x
            my = xy[i, k, 1] + xy[i, (k + 1) % 3, 1] - y
            if not sample_patch(flat, height, width, mx, my, radius, other[k]):
                outside = True
                continue
            bright = other[k].sum() > WHITE_RATIO * middle.sum()
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
        strength = dot(own, own)
        for k in range(3):
            px, py = x + INNER * (xy[i, k, 0] - x), y + INNER * (xy[i, k, 1] - y)
            at = sample_dot(flat, height, width, px, py, own[0], own[1], own[2])
            fits = fits and at - dot(own, black) / blacks > MIN_INNER * strength
            if beyond[i, k] == BLACK_CELL:
                fits = fits and dot(other[k], own) - dot(black, own) / blacks < MIN_INNER * strength
        if compare:
            ratio = dot(own, before[i]) / max(dot(before[i], before[i]), 1e-9)
            fits = fits and ratio > STRENGTH[0] and ratio < STRENGTH[1]
            best, best_cosine = 0, -1.0
            for k in range(3):
                hue = before[nearest[i, k]]
                cosine = dot(own, hue) / np.sqrt(max(strength * dot(hue, hue), 1e-9))
                if cosine > best_cosine:
                    best, best_cosine = k + 1, cosine
            fits = fits and best == ink[i] and best_cosine > MIN_COSINE
        verdict[i] = RIGHT if fits else WRONG
    return verdict, look, white, not_white, other_white


def examine(
    image: NDArray[np.uint8], corner_px: NDArray[np.float64], tables: Tables, look: NDArray[np.float64] | None
) -> Proof:
    """Compare cells with corners at (C, 3, 2) (NaN: not predicted) with the image, and their inks with ``look``."""
    before = np.zeros((len(tables.ink), 3)) if look is None else look[0]
    return Proof(
        *_examine(image, corner_px, tables.ink, tables.beyond, tables.nearest, before, look is not None)
    )
