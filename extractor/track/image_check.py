"""The check of predicted cells by the image: a cell must show its own ink inside and none of it across its edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.response import ResponseTables, decode_values
from extractor.numeric.bilinear import fill_patch_mean, weighted_sample
from extractor.numeric.compilation import compiled
from extractor.numeric.dense_systems import dot3
from extractor.track.warm_tables import BLACK_CELL, NO_CELL, WHITE_CELL, WarmTables

MIN_WHITE_RATIO = 0.75  # of the white cell's brightness (sum of the channels) to an ink's; black is below
MIN_COSINE = 0.8  # between an ink level over black and the same cell's a frame ago
STRENGTH_RANGE = (0.4, 2.5)  # of an ink level over black, relative to the same cell's a frame ago
INNER_SAMPLE_POSITION = (
    0.5  # of the second samples of the ink, as a share of the way from the middle to a corner
)
MIN_INNER_STRENGTH = 0.4  # of the ink level at these samples, relative to the middle
LEVEL_RADIUS = 0.15  # of the disc over which the ink is averaged, relative to the distance of a corner

UNSEEN, CONTRADICTED, CONFIRMED = range(3)  # verdicts on a cell


class CellCheck(NamedTuple):
    """The check of C predicted cells.

    Attributes:
        verdict: (C,) uint8, ``UNSEEN`` (outside the image or not predicted), ``CONTRADICTED`` or ``CONFIRMED``.
        cell_levels: (2, C, 3) float64 BGR, each visible cell's ink level minus the black around the cell, and this
            black; NaN where unseen.
        white_count: number of edges of colored cells across which the white cell is bright, as in the layout.
        white_missing_count: number of edges across which the white cell is not bright.
        white_elsewhere_count: number of edges across which a black cell is as bright as white.
    """

    verdict: NDArray[np.uint8]
    cell_levels: NDArray[np.float64]
    white_count: int
    white_missing_count: int
    white_elsewhere_count: int


@compiled
def _check_cells(image, xy, ink, across_edge, nearest, before, compare):  # type: ignore[no-untyped-def]
    """The ``CellCheck`` of the cells with the corners ``xy`` (C, 3, 2).

    Args:
        before: (C, 3) ink levels over black in the frame before; used if ``compare``.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    count = xy.shape[0]
    verdict = np.zeros(count, np.uint8)
    levels = np.full((2, count, 3), np.nan)
    middle, black, across = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    white, white_missing, white_elsewhere = 0, 0, 0
    for i in range(count):
        x, y = xy[i, :, 0].mean(), xy[i, :, 1].mean()
        size = np.hypot(xy[i, 0, 0] - x, xy[i, 0, 1] - y)
        radius = LEVEL_RADIUS * size
        if not fill_patch_mean(flat, height, width, x, y, radius, middle):
            continue
        black_count, confirmed, outside = 0, True, False
        black[:] = 0.0
        for k in range(3):
            if across_edge[i, k] == NO_CELL:
                continue
            mx = xy[i, k, 0] + xy[i, (k + 1) % 3, 0] - x
            my = xy[i, k, 1] + xy[i, (k + 1) % 3, 1] - y
            if not fill_patch_mean(flat, height, width, mx, my, radius, across[k]):
                outside = True
                continue
            bright = across[k].sum() > MIN_WHITE_RATIO * middle.sum()
            if across_edge[i, k] == WHITE_CELL:
                white += bright
                white_missing += not bright
            else:
                white_elsewhere += bright
                confirmed = confirmed and not bright
                black += across[k]
                black_count += 1
        if outside or black_count == 0:
            continue
        own = levels[0, i]
        for channel in range(3):
            own[channel] = middle[channel] - black[channel] / black_count
            levels[1, i, channel] = black[channel] / black_count
        strength = dot3(own, own)
        for k in range(3):
            px, py = (
                x + INNER_SAMPLE_POSITION * (xy[i, k, 0] - x),
                y + INNER_SAMPLE_POSITION * (xy[i, k, 1] - y),
            )
            inner = weighted_sample(flat, height, width, px, py, own[0], own[1], own[2])
            confirmed = confirmed and inner - dot3(own, black) / black_count > MIN_INNER_STRENGTH * strength
            if across_edge[i, k] == BLACK_CELL:
                outer = dot3(across[k], own) - dot3(black, own) / black_count
                confirmed = confirmed and outer < MIN_INNER_STRENGTH * strength
        if compare:
            ratio = dot3(own, before[i]) / max(dot3(before[i], before[i]), 1e-9)
            confirmed = confirmed and ratio > STRENGTH_RANGE[0] and ratio < STRENGTH_RANGE[1]
            best, best_cosine = 0, -1.0
            for k in range(3):
                level = before[nearest[i, k]]
                cosine = dot3(own, level) / np.sqrt(max(strength * dot3(level, level), 1e-9))
                if cosine > best_cosine:
                    best, best_cosine = k + 1, cosine
            confirmed = confirmed and best == ink[i] and best_cosine > MIN_COSINE
        verdict[i] = CONFIRMED if confirmed else CONTRADICTED
    return CellCheck(verdict, levels, white, white_missing, white_elsewhere)


def check_cells(
    image: NDArray[np.uint8],
    corner_px: NDArray[np.float64],
    tables: WarmTables,
    levels_before: NDArray[np.float64] | None,
) -> CellCheck:
    """Compare predicted cells with the image, and their inks with those in the frame before.

    Args:
        image: (H, W, 3) uint8 BGR.
        corner_px: (C, 3, 2) predicted corners, NaN where not predicted.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the frame before; None: inks are not compared.
    """
    compare = levels_before is not None
    before = np.zeros((len(tables.ink), 3)) if levels_before is None else levels_before[0]
    check: CellCheck = _check_cells(
        image, corner_px, tables.ink, tables.across_edge, tables.nearest, before, compare
    )
    return check


def light_levels(cell_levels: NDArray[np.float64], response: ResponseTables) -> NDArray[np.float64]:
    """(2, C, 3) the light of cells over black, and of their black, from ``CellCheck.cell_levels``."""
    light = response.light.astype(np.float64)
    black = decode_values(cell_levels[1], light)
    return np.stack([decode_values(cell_levels[0] + cell_levels[1], light) - black, black])
