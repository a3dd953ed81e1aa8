"""Stage 2: which ink every pixel shows, with hues and levels found from the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .color import HUES, MIN_CHROMA, Colors, find_hues, hue_weights, ink_of_hue
from .engine import compiled
from .target import SHRINK, Target

LEVEL_SHARE = 0.4  # a pixel shows an ink when its chroma exceeds this share of that ink's local level
TILE_PX = 32
SURVEY_PIXELS = 20_000  # every other pixel of every other row of larger images tells the hues and levels


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Stage 2.

    Attributes:
        hsv: (H, W, 3) uint8, OpenCV's scale: H 0..179 (2 degrees a step), S and V 0..255.
        label: (H, W) uint8, 0 none, 1 red, 2 green, 3 blue.
        hues_deg: (3,) the inks' hues as found.
        chroma: (3,) the inks' typical chroma (max - min of B, G, R), 0..255.
    """

    hsv: NDArray[np.uint8]
    label: NDArray[np.uint8]
    hues_deg: NDArray[np.float64]
    chroma: NDArray[np.float64]


@compiled
def _every_other(plane):  # type: ignore[no-untyped-def]
    """Every other pixel of every other row."""
    out = np.empty(((plane.shape[0] + 1) // 2, (plane.shape[1] + 1) // 2), np.uint8)
    for y in range(out.shape[0]):
        row, line = plane[2 * y], out[y]
        for x in range(line.shape[0]):
            line[x] = row[2 * x]
    return out


@compiled
def _arcs(inks):  # type: ignore[no-untyped-def]
    """(3, 2) uint8: of each ink's hues, which lie side by side, the first and their number."""
    arcs = np.zeros((3, 2), np.uint8)
    for hue in range(HUES):
        ink = inks[hue]
        if ink > 0:
            arcs[ink - 1, 1] += 1
            if inks[hue - 1] != ink:
                arcs[ink - 1, 0] = hue
    return arcs


@compiled
def _within(hue, arc):  # type: ignore[no-untyped-def]
    """Whether a hue is among those of an arc."""
    first, count = arc
    past = np.uint8(int(hue) - int(first)) if hue >= first else np.uint8(int(hue) + HUES - int(first))
    return past < count


@compiled
def _tile_levels(hue, chroma, arcs, tile):  # type: ignore[no-untyped-def]
    """(3, rows, columns) the largest chroma of each ink in every tile; 0 where it is below ``MIN_CHROMA``."""
    height, width = hue.shape
    rows, columns = (height + tile - 1) // tile, (width + tile - 1) // tile
    level = np.zeros((3, rows, columns), np.float32)
    strongest = np.empty((3, width), np.uint8)
    for row in range(rows):
        strongest[:] = 0
        for y in range(row * tile, min((row + 1) * tile, height)):
            for ink in range(3):
                _keep_strongest(hue[y], chroma[y], arcs[ink], strongest[ink])
        for ink in range(3):
            for column in range(columns):
                largest = strongest[ink, column * tile : (column + 1) * tile].max()
                if largest >= MIN_CHROMA:
                    level[ink, row, column] = largest
    return level


@compiled
def _keep_strongest(hue, chroma, arc, strongest):  # type: ignore[no-untyped-def]
    """Let ``strongest`` be the larger of itself and the chroma where the hue is of an arc."""
    for x in range(hue.shape[0]):
        much = chroma[x] if _within(hue[x], arc) else np.uint8(0)
        strongest[x] = max(strongest[x], much)


@compiled
def _thresholds(level):  # type: ignore[no-untyped-def]
    """(3, rows, columns) uint8: the chroma that shows an ink in each tile; (3,) the upper quartile of its levels.

    A tile's level is the mean, over it and its neighbours, of the largest level among each one's neighbours.
    """
    _, rows, columns = level.shape
    threshold, typical = np.empty(level.shape, np.uint8), np.zeros(3)
    wide = np.empty((rows, columns), np.float32)
    for ink in range(3):
        seen = np.sort(level[ink].ravel()[level[ink].ravel() > 0.0])
        if seen.shape[0] > 0:
            typical[ink] = seen[3 * seen.shape[0] // 4]
        for row in range(rows):
            for column in range(columns):
                largest = np.float32(0.0)
                for y in range(max(row - 1, 0), min(row + 2, rows)):
                    for x in range(max(column - 1, 0), min(column + 2, columns)):
                        largest = max(largest, level[ink, y, x])
                wide[row, column] = largest
        for row in range(rows):
            for column in range(columns):
                total, count = 0.0, 0
                for y in range(max(row - 1, 0), min(row + 2, rows)):
                    for x in range(max(column - 1, 0), min(column + 2, columns)):
                        total += wide[y, x]
                        count += 1
                local = LEVEL_SHARE * max(total / count, 0.15 * typical[ink])
                threshold[ink, row, column] = np.uint8(min(max(local, MIN_CHROMA), 255))
    return threshold, typical


@compiled
def _label(hue, chroma, arcs, threshold, tile, target, shrink):  # type: ignore[no-untyped-def]
    """(H, W) uint8: each pixel's ink where its chroma exceeds the tile's threshold, inside the target area."""
    height, width = chroma.shape
    label = np.empty((height, width), np.uint8)
    inside, limit = np.empty(width, np.uint8), np.empty((3, width), np.uint8)  # of a row's pixels
    for y in range(height):
        if y % shrink == 0:
            for column in range(target.shape[1]):
                inside[column * shrink : (column + 1) * shrink] = target[y // shrink, column]
        if y % tile == 0:
            for ink in range(3):
                for column in range(threshold.shape[2]):
                    limit[ink, column * tile : (column + 1) * tile] = threshold[ink, y // tile, column]
        _label_row(hue[y], chroma[y], arcs, limit, inside, label[y])
    return label


@compiled
def _label_row(hue, chroma, arcs, limit, inside, out):  # type: ignore[no-untyped-def]
    """One row of ``_label``."""
    red, green, blue = arcs
    red_limit, green_limit, blue_limit = limit
    for x in range(hue.shape[0]):
        one = np.uint8(_within(hue[x], red) & (chroma[x] > red_limit[x]))
        two = np.uint8(_within(hue[x], green) & (chroma[x] > green_limit[x]))
        three = np.uint8(_within(hue[x], blue) & (chroma[x] > blue_limit[x]))
        out[x] = np.uint8(inside[x] * np.uint8(one + np.uint8(2) * two + np.uint8(3) * three))


def segment(colors: Colors, target: Target, nominal_deg: NDArray[np.float64]) -> Segmentation | None:
    """Stage 2: label every pixel of the target area with its ink; None when one of the three inks is absent."""
    hue, chroma = colors.hue, colors.chroma
    tile = max(TILE_PX, min(chroma.shape) // 12 // SHRINK * SHRINK)
    few, few_tile = (hue, chroma), tile
    if chroma.size > SURVEY_PIXELS:
        few, few_tile = (_every_other(hue), _every_other(chroma)), tile // 2
    hues = find_hues(hue_weights(*few), nominal_deg)
    if hues is None:
        return None
    arcs = _arcs(ink_of_hue(hues))
    threshold, typical = _thresholds(_tile_levels(*few, arcs, few_tile))
    label = _label(hue, chroma, arcs, threshold, tile, target.mask, target.shrink)
    return Segmentation(hsv=colors.hsv, label=label, hues_deg=hues, chroma=typical)
