"""Stage 2: which ink every pixel shows, with hues and levels found from the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.image.color import HUES, MIN_CHROMA, Colors, find_hues, hue_weights, ink_of_hue
from extractor.image.target_area import TARGET_TILE_PX, Target
from extractor.numeric.compilation import compiled

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
def _subsampled(plane):  # type: ignore[no-untyped-def]
    """Every other pixel of every other row."""
    out = np.empty(((plane.shape[0] + 1) // 2, (plane.shape[1] + 1) // 2), np.uint8)
    for y in range(out.shape[0]):
        row, line = plane[2 * y], out[y]
        for x in range(line.shape[0]):
            line[x] = row[2 * x]
    return out


@compiled
def _hue_ranges(inks):  # type: ignore[no-untyped-def]
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
def _is_in_hue_range(hue, first, count):  # type: ignore[no-untyped-def]
    """Whether a hue is among so many from the first one on."""
    past = np.uint8(int(hue) - int(first)) if hue >= first else np.uint8(int(hue) + HUES - int(first))
    return past < count


@compiled
def _tile_max_chroma(hue, chroma, arcs, tile):  # type: ignore[no-untyped-def]
    """(3, rows, columns) the largest chroma of each ink in every tile; 0 where it is below ``MIN_CHROMA``."""
    height, width = hue.shape
    rows, columns = (height + tile - 1) // tile, (width + tile - 1) // tile
    level, strongest = np.zeros((3, rows, columns), np.float32), np.empty(width, np.uint8)
    hues, chromas = hue.reshape(-1), chroma.reshape(-1)
    for row in range(rows):
        for ink in range(3):
            strongest[:] = 0
            for y in range(row * tile, min((row + 1) * tile, height)):
                _update_strongest(hues, chromas, y * width, arcs[ink, 0], arcs[ink, 1], strongest)
            for column in range(columns):
                largest = np.uint8(0)
                for x in range(column * tile, min((column + 1) * tile, width)):
                    largest = max(largest, strongest[x])
                if largest >= MIN_CHROMA:
                    level[ink, row, column] = largest
    return level


@compiled
def _update_strongest(hues, chromas, begin, first, count, strongest):  # type: ignore[no-untyped-def]
    """Let ``strongest`` be the larger of itself and the chroma of the pixels from ``begin`` on whose hue is among so
    many from the first one on."""
    begin = np.uint64(begin)  # whose sum with another is not negative, so no index is wrapped around
    for x in range(np.uint64(strongest.shape[0])):
        much = chromas[begin + x] if _is_in_hue_range(hues[begin + x], first, count) else np.uint8(0)
        strongest[x] = max(strongest[x], much)


@compiled
def _tile_thresholds(level):  # type: ignore[no-untyped-def]
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
def _label_pixels(hue, chroma, arcs, threshold, tile, target, shrink):  # type: ignore[no-untyped-def]
    """(H, W) uint8: each pixel's ink where its chroma exceeds the tile's threshold, inside the target area."""
    height, width = chroma.shape
    label = np.empty((height, width), np.uint8)
    hues, chromas, labels = hue.reshape(-1), chroma.reshape(-1), label.reshape(-1)
    limit = np.empty(4 * width, np.uint8)  # of a row's pixels: of the three inks, and whether they are inside
    for y in range(height):
        if y % shrink == 0:
            _fill_upsampled_row(target[y // shrink], shrink, limit[3 * width :])
        if y % tile == 0:
            for ink in range(3):
                _fill_upsampled_row(threshold[ink, y // tile], tile, limit[ink * width : (ink + 1) * width])
        _fill_row_labels(hues, chromas, y * width, width, arcs, limit, labels)
    return label


@compiled
def _fill_upsampled_row(tiles, size, row):  # type: ignore[no-untyped-def]
    """Write what each tile has into the ``size`` pixels of a row that it covers."""
    for column in range(tiles.shape[0]):
        for x in range(column * size, min((column + 1) * size, row.shape[0])):
            row[x] = tiles[column]


@compiled
def _fill_row_labels(hues, chromas, begin, width, arcs, limit, out):  # type: ignore[no-untyped-def]
    """One row of ``_label_pixels``, which begins there."""
    # numbers, no rows of arrays: what is written could change those, as far as a compiler knows
    red, reds, green, greens = arcs[0, 0], arcs[0, 1], arcs[1, 0], arcs[1, 1]
    blue, blues = arcs[2, 0], arcs[2, 1]
    begin, width = np.uint64(begin), np.uint64(width)
    two_widths, three_widths = np.uint64(2) * width, np.uint64(3) * width
    for x in range(width):
        hue, chroma = hues[begin + x], chromas[begin + x]
        one = np.uint8(_is_in_hue_range(hue, red, reds) & (chroma > limit[x]))
        two = np.uint8(_is_in_hue_range(hue, green, greens) & (chroma > limit[width + x]))
        three = np.uint8(_is_in_hue_range(hue, blue, blues) & (chroma > limit[two_widths + x]))
        inside = limit[three_widths + x]
        out[begin + x] = np.uint8(inside * np.uint8(one + np.uint8(2) * two + np.uint8(3) * three))


def segment(colors: Colors, target: Target, nominal_deg: NDArray[np.float64]) -> Segmentation | None:
    """Stage 2: label every pixel of the target area with its ink; None when one of the three inks is absent."""
    hue, chroma = colors.hue, colors.chroma
    tile = max(TILE_PX, min(chroma.shape) // 12 // TARGET_TILE_PX * TARGET_TILE_PX)
    few, few_tile = (hue, chroma), tile
    if chroma.size > SURVEY_PIXELS:
        few, few_tile = (_subsampled(hue), _subsampled(chroma)), tile // 2
    hues = find_hues(hue_weights(*few), nominal_deg)
    if hues is None:
        return None
    arcs = _hue_ranges(ink_of_hue(hues))
    threshold, typical = _tile_thresholds(_tile_max_chroma(*few, arcs, few_tile))
    label = _label_pixels(hue, chroma, arcs, threshold, tile, target.mask, target.tile_px)
    return Segmentation(hsv=colors.hsv, label=label, hues_deg=hues, chroma=typical)
