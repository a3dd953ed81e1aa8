"""Stages 1 and 2: the target area, and which ink every pixel shows, with hues and levels found from the image."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .engine import compiled

HUES = 180  # OpenCV's 8-bit hue counts in steps of 2 degrees
HUE_REACH_DEG = 50.0  # a hue farther than this from its nominal one is not that ink: 60 would be ambiguous
LEVEL_SHARE = 0.4  # a pixel shows an ink when its chroma exceeds this share of that ink's local level
TILE_PX = 32
SHRINK = 8  # pixels per side of a tile of the target area
SURVEY_PIXELS = 20_000  # every other pixel of every other row of larger images tells the hues and levels
MIN_CHROMA = 12  # below this, 8-bit hue is noise
OPENCV_HUE_DEG = 2.0
HUE_WIDTH_DEG = 40.0  # pixels farther from every center tell nothing about it
ROUNDS = 8
STRONG_SHARE = 0.98  # of the colored pixels are less saturated than what counts as strong


@dataclass(frozen=True, eq=False)
class Target:
    """Stage 1. ``mask`` (h, w) bool: pixels that may belong to the pattern, at 1/``shrink`` of the image's scale."""

    mask: NDArray[np.uint8]
    shrink: int


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


def nominal_hues_deg(palette: dict[str, str]) -> NDArray[np.float64]:
    """(3,) hues in degrees of the palette's red, green and blue."""
    inks = [[int(palette[c][i : i + 2], 16) for i in (5, 3, 1)] for c in ("red", "green", "blue")]
    hsv = cv2.cvtColor(np.array([inks], np.float32) / 255, cv2.COLOR_BGR2HSV)
    return hsv[0, :, 0].astype(np.float64)


@compiled
def _chroma(hsv):  # type: ignore[no-untyped-def]
    """(H, W) uint8: max - min of B, G, R, which is S V / 255."""
    height, width = hsv.shape[:2]
    flat = hsv.reshape(-1)
    out = np.empty(height * width, np.uint8)
    for i in range(height * width):
        out[i] = (
            np.int32(flat[3 * i + 1]) * np.int32(flat[3 * i + 2]) * np.int32(257) + np.int32(32768)
        ) >> 16
    return out.reshape(height, width)


@compiled
def _survey(hsv, chroma, step):  # type: ignore[no-untyped-def]
    """Histogram (180 hues, 256 chromas) over every ``step``-th pixel of every ``step``-th row."""
    histogram = np.zeros((HUES, 256), np.int32)
    for y in range(0, hsv.shape[0], step):
        for x in range(0, hsv.shape[1], step):
            if chroma[y, x] >= MIN_CHROMA:
                histogram[hsv[y, x, 0], chroma[y, x]] += 1
    return histogram


@compiled
def _tile_levels(hsv, chroma, ink_of_hue, tile, step):  # type: ignore[no-untyped-def]
    """(3, rows, columns) the largest chroma of each ink in every tile; 0 where it is below ``MIN_CHROMA``."""
    rows = (hsv.shape[0] + tile - 1) // tile
    columns = (hsv.shape[1] + tile - 1) // tile
    level = np.zeros((3, rows, columns), np.float32)
    strongest = np.zeros((columns, 4), np.uint8)
    for row in range(rows):
        strongest[:] = 0
        for y in range(row * tile, min((row + 1) * tile, hsv.shape[0]), step):
            line, colors = chroma[y], hsv[y]
            for column in range(columns):
                largest = strongest[column]
                for x in range(column * tile, min((column + 1) * tile, hsv.shape[1]), step):
                    ink = ink_of_hue[colors[x, 0]]
                    largest[ink] = max(largest[ink], line[x])
        for column in range(columns):
            for ink in range(3):
                if strongest[column, ink + 1] >= MIN_CHROMA:
                    level[ink, row, column] = strongest[column, ink + 1]
    return level


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
def _label(hsv, chroma, ink_of_hue, threshold, tile, target, shrink):  # type: ignore[no-untyped-def]
    """(H, W) uint8: each pixel's ink where its chroma exceeds the tile's threshold, inside the target area."""
    height, width = chroma.shape
    columns = threshold.shape[2]
    label = np.zeros((height, width), np.uint8)
    # what a hue must exceed in each tile of a row of tiles; without an ink it cannot
    limit = np.empty((columns, HUES), np.uint8)
    for y in range(height):
        if y % tile == 0:
            for column in range(columns):
                for hue in range(HUES):
                    ink = ink_of_hue[hue]
                    limit[column, hue] = threshold[ink - 1, y // tile, column] if ink > 0 else 255
        row, colors, out = chroma[y], hsv[y], label[y]
        for start in range(0, width, shrink):
            if target[y // shrink, start // shrink] == 0:
                continue
            least = limit[start // tile]
            for x in range(start, min(start + shrink, width)):
                hue = colors[x, 0]
                out[x] = ink_of_hue[hue] * (row[x] > least[hue])
    return label


@compiled
def _tile_chroma(chroma, shrink):  # type: ignore[no-untyped-def]
    """The largest chroma in every tile of ``shrink`` pixels."""
    height, width = chroma.shape
    rows, columns = (height + shrink - 1) // shrink, (width + shrink - 1) // shrink
    largest = np.zeros((rows, columns), np.uint8)
    strongest = np.empty(width, np.uint8)
    for row in range(rows):
        strongest[:] = 0
        for y in range(row * shrink, min((row + 1) * shrink, height)):
            np.maximum(strongest, chroma[y], strongest)
        for column in range(columns):
            for x in range(column * shrink, min((column + 1) * shrink, width)):
                largest[row, column] = max(largest[row, column], strongest[x])
    return largest


@dataclass(frozen=True, eq=False)
class Colors:
    """The image as the stages see it.

    Attributes:
        hsv: (H, W, 3) uint8, OpenCV's scale: H 0..179 (2 degrees a step), S and V 0..255.
        chroma: (H, W) uint8, max - min of B, G, R: 0 for black, grey and white in any light.
    """

    hsv: NDArray[np.uint8]
    chroma: NDArray[np.uint8]


def to_colors(image: NDArray[np.uint8]) -> Colors:
    """HSV and chroma of an 8-bit BGR image."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    return Colors(hsv=hsv, chroma=_chroma(hsv))  # type: ignore[arg-type]


def find_target(colors: Colors) -> Target:
    """Stage 1: flood the image from outside; what the flood cannot reach may be pattern.

    Tiles without color are water; closing seals the gaps between cells first, so that the flood stops at the
    pattern's rim while its black cells stay dry.
    """
    chroma = _tile_chroma(colors.chroma, SHRINK)
    strong_at = int(0.95 * (chroma.size - 1))
    strong = np.partition(chroma, strong_at, axis=None)[strong_at]
    threshold = max(MIN_CHROMA, 0.15 * float(strong))
    dry = cv2.morphologyEx((chroma > threshold).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    water = cv2.copyMakeBorder(dry, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(water, None, (0, 0), 2)
    return Target(mask=(water[1:-1, 1:-1] != 2).astype(np.uint8), shrink=SHRINK)


@compiled
def _centers(weight, nominal_deg):  # type: ignore[no-untyped-def]
    """Circular 3-means of a hue histogram, held within reach of the nominal hues; False when an ink has no pixels."""
    shift = np.zeros(3)
    for _ in range(ROUNDS):
        total, moment = np.zeros(3), np.zeros(3)
        for hue in range(HUES):
            if weight[hue] == 0.0:
                continue
            best, nearest = 360.0, 0
            for ink in range(3):
                away = hue * OPENCV_HUE_DEG - nominal_deg[ink] - shift[ink]
                away -= 360.0 * np.floor(away / 360.0 + 0.5)
                if abs(away) < abs(best):
                    best, nearest = away, ink
            if abs(best) < HUE_WIDTH_DEG:
                total[nearest] += weight[hue]
                moment[nearest] += weight[hue] * best
        for ink in range(3):
            if total[ink] == 0.0:
                return shift, False
            moved = shift[ink] + moment[ink] / total[ink]
            shift[ink] = min(max(moved, -HUE_REACH_DEG), HUE_REACH_DEG)
    return shift, True


@compiled
def _hue_weights(histogram):  # type: ignore[no-untyped-def]
    """(180,) the chroma of the pixels of each hue, summed over those that are not pale; zeros without any."""
    of_chroma = np.zeros(256, np.int64)
    for hue in range(HUES):
        of_chroma += histogram[hue]
    of_chroma[:MIN_CHROMA] = 0
    limit, below, strong = STRONG_SHARE * of_chroma.sum(), 0, 0
    while strong < 255 and below + of_chroma[strong] < limit:
        below += of_chroma[strong]
        strong += 1
    weight = np.zeros(HUES)
    for hue in range(HUES):
        total, row = np.int64(0), histogram[hue]
        for chroma in range(max(MIN_CHROMA, strong // 8), 256):
            total += np.int64(chroma) * row[chroma]
        weight[hue] = total
    return weight


def find_hues(histogram: NDArray[np.int32], nominal_deg: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """(3,) hues in degrees around which the image's saturated pixels gather, or None without such pixels.

    Circular 3-means from the nominal hues on the chroma-weighted histogram. White balance and colored light move
    hues; a shift past ``HUE_REACH_DEG`` could rename the inks and is refused.
    """
    weight = _hue_weights(histogram)
    if not weight.any():
        return None
    shift, found = _centers(weight, nominal_deg)
    return (nominal_deg + shift) % 360 if found else None


@compiled
def _ink_of_hue(hues_deg):  # type: ignore[no-untyped-def]
    """(180,) uint8: the ink (1, 2, 3) whose hue is the nearest, 0 where all are far."""
    ink_of_hue = np.zeros(HUES, np.uint8)
    for hue in range(HUES):
        nearest = 60.0
        for ink in range(3):
            away = hue * OPENCV_HUE_DEG - hues_deg[ink]
            away = abs(away - 360.0 * np.floor(away / 360.0 + 0.5))
            if away < nearest:
                nearest = away
                ink_of_hue[hue] = ink + 1
    return ink_of_hue


def segment(colors: Colors, target: Target, nominal_deg: NDArray[np.float64]) -> Segmentation | None:
    """Stage 2: label every pixel of the target area with its ink; None when one of the three inks is absent."""
    hsv, chroma = colors.hsv, colors.chroma
    step = 2 if chroma.size > SURVEY_PIXELS else 1
    hues = find_hues(_survey(hsv, chroma, step), nominal_deg)
    if hues is None:
        return None
    ink_of_hue = _ink_of_hue(hues)
    tile = max(TILE_PX, min(chroma.shape) // 12 // SHRINK * SHRINK)
    threshold, typical = _thresholds(_tile_levels(hsv, chroma, ink_of_hue, tile, step))
    label = _label(hsv, chroma, ink_of_hue, threshold, tile, target.mask, target.shrink)
    return Segmentation(hsv=hsv, label=label, hues_deg=hues, chroma=typical)
