"""Stage 2: the ink of every pixel, by hues and levels found in the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.image.color import HUES, MIN_CHROMA, Colors, find_hues, hue_weights, ink_of_hue
from extractor.image.target_area import TARGET_TILE_PX, Target
from extractor.numeric.compilation import compiled

LEVEL_SHARE = 0.4  # a pixel shows an ink when its chroma exceeds this share of the ink's local level
MIN_LEVEL_SHARE = 0.15  # of an ink's typical level, the lowest local level
TILE_PX = 32  # side of the smallest tiles in which levels are local
SURVEY_PIXELS = 20_000  # in larger images, hues and levels come from every other pixel of every other row


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
    """(3, 2) uint8: the first hue of each ink's contiguous range and the number of hues in the range."""
    ranges = np.zeros((3, 2), np.uint8)
    for hue in range(HUES):
        ink = inks[hue]
        if ink > 0:
            ranges[ink - 1, 1] += 1
            if inks[hue - 1] != ink:
                ranges[ink - 1, 0] = hue
    return ranges


@compiled
def _is_in_hue_range(hue, first, count):  # type: ignore[no-untyped-def]
    """Whether a hue is among the ``count`` hues from ``first`` on, modulo 180."""
    offset = np.uint8(int(hue) - int(first)) if hue >= first else np.uint8(int(hue) + HUES - int(first))
    return offset < count


@compiled
def _tile_max_chroma(hue, chroma, ranges, tile):  # type: ignore[no-untyped-def]
    """(3, rows, columns) float32, the largest chroma of each ink in every tile; 0 where it is below ``MIN_CHROMA``."""
    height, width = hue.shape
    rows, columns = (height + tile - 1) // tile, (width + tile - 1) // tile
    level, strongest = np.zeros((3, rows, columns), np.float32), np.empty(width, np.uint8)
    hues, chromas = hue.reshape(-1), chroma.reshape(-1)
    for row in range(rows):
        for ink in range(3):
            strongest[:] = 0
            for y in range(row * tile, min((row + 1) * tile, height)):
                _update_strongest(hues, chromas, y * width, ranges[ink, 0], ranges[ink, 1], strongest)
            for column in range(columns):
                largest = np.uint8(0)
                for x in range(column * tile, min((column + 1) * tile, width)):
                    largest = max(largest, strongest[x])
                if largest >= MIN_CHROMA:
                    level[ink, row, column] = largest
    return level


@compiled
def _update_strongest(hues, chromas, begin, first, count, strongest):  # type: ignore[no-untyped-def]
    """Raise ``strongest`` (W,) to the chroma of the pixels from index ``begin`` on whose hue is in the range."""
    begin = np.uint64(
        begin
    )  # unsigned sums are never negative, so the compiler omits the wrap-around of indices
    for x in range(np.uint64(strongest.shape[0])):
        level = chromas[begin + x] if _is_in_hue_range(hues[begin + x], first, count) else np.uint8(0)
        strongest[x] = max(strongest[x], level)


@compiled
def _tile_thresholds(level):  # type: ignore[no-untyped-def]
    """(3, rows, columns) uint8, the minimum chroma of an ink's pixels in each tile; (3,) the upper quartile of the
    ink's levels in all tiles.

    A tile's local level is the mean, over the tile and its neighbours, of the largest level around each of these.
    """
    _, rows, columns = level.shape
    threshold, typical = np.empty(level.shape, np.uint8), np.zeros(3)
    dilated = np.empty((rows, columns), np.float32)
    for ink in range(3):
        found = np.sort(level[ink].ravel()[level[ink].ravel() > 0.0])
        if found.shape[0] > 0:
            typical[ink] = found[3 * found.shape[0] // 4]
        for row in range(rows):
            for column in range(columns):
                largest = np.float32(0.0)
                for y in range(max(row - 1, 0), min(row + 2, rows)):
                    for x in range(max(column - 1, 0), min(column + 2, columns)):
                        largest = max(largest, level[ink, y, x])
                dilated[row, column] = largest
        for row in range(rows):
            for column in range(columns):
                total, count = 0.0, 0
                for y in range(max(row - 1, 0), min(row + 2, rows)):
                    for x in range(max(column - 1, 0), min(column + 2, columns)):
                        total += dilated[y, x]
                        count += 1
                local = LEVEL_SHARE * max(total / count, MIN_LEVEL_SHARE * typical[ink])
                threshold[ink, row, column] = np.uint8(min(max(local, MIN_CHROMA), 255))
    return threshold, typical


@compiled
def _label_pixels(hue, chroma, ranges, threshold, tile, target, target_tile):  # type: ignore[no-untyped-def]
    """(H, W) uint8: each pixel's ink where its chroma exceeds the tile's threshold, inside the target area."""
    height, width = chroma.shape
    label = np.empty((height, width), np.uint8)
    hues, chromas, labels = hue.reshape(-1), chroma.reshape(-1), label.reshape(-1)
    limit = np.empty(
        4 * width, np.uint8
    )  # of a row's pixels: the three inks' thresholds, 1 in the target area
    for y in range(height):
        if y % target_tile == 0:
            _fill_upsampled_row(target[y // target_tile], target_tile, limit[3 * width :])
        if y % tile == 0:
            for ink in range(3):
                _fill_upsampled_row(threshold[ink, y // tile], tile, limit[ink * width : (ink + 1) * width])
        _fill_row_labels(hues, chromas, y * width, width, ranges, limit, labels)
    return label


@compiled
def _fill_upsampled_row(tiles, size, row):  # type: ignore[no-untyped-def]
    """Write each tile's value into the ``size`` pixels of a row that the tile covers."""
    for column in range(tiles.shape[0]):
        for x in range(column * size, min((column + 1) * size, row.shape[0])):
            row[x] = tiles[column]


@compiled
def _fill_row_labels(hues, chromas, begin, width, ranges, limit, out):  # type: ignore[no-untyped-def]
    """Write one row of ``_label_pixels``, whose first pixel has the index ``begin``."""
    # scalars: the compiler must assume that a write to ``out`` changes any array
    red, reds, green, greens = ranges[0, 0], ranges[0, 1], ranges[1, 0], ranges[1, 1]
    blue, blues = ranges[2, 0], ranges[2, 1]
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
    """Stage 2: label every pixel of the target area with its ink; None when one of the three inks is absent.

    Args:
        nominal_deg: (3,) hues of red, green and blue in the palette, degrees.
    """
    hue, chroma = colors.hue, colors.chroma
    tile = max(TILE_PX, min(chroma.shape) // 12 // TARGET_TILE_PX * TARGET_TILE_PX)
    survey_hue, survey_chroma, survey_tile = hue, chroma, tile
    if chroma.size > SURVEY_PIXELS:
        survey_hue, survey_chroma, survey_tile = _subsampled(hue), _subsampled(chroma), tile // 2
    hues = find_hues(hue_weights(survey_hue, survey_chroma), nominal_deg)
    if hues is None:
        return None
    ranges = _hue_ranges(ink_of_hue(hues))
    threshold, typical = _tile_thresholds(_tile_max_chroma(survey_hue, survey_chroma, ranges, survey_tile))
    label = _label_pixels(hue, chroma, ranges, threshold, tile, target.mask, target.tile_px)
    return Segmentation(hsv=colors.hsv, label=label, hues_deg=hues, chroma=typical)
