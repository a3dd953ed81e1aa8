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
PALE_SHARE = 8  # times less chroma than that is pale
DRY_RANK, DRY_SHARE = 0.95, 0.15  # tiles with less than this share of the chroma of that rank have no color


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
def _planes(hsv):  # type: ignore[no-untyped-def]
    """(H, W) uint8 each: the hue, and the chroma max - min of B, G, R, which is S V / 255."""
    height, width = hsv.shape[:2]
    flat = hsv.reshape(-1)
    hue, chroma = np.empty(height * width, np.uint8), np.empty(height * width, np.uint8)
    for i in range(height * width):
        hue[i] = flat[3 * i]
        chroma[i] = (
            np.int32(flat[3 * i + 1]) * np.int32(flat[3 * i + 2]) * np.int32(257) + np.int32(32768)
        ) >> 16
    return hue.reshape(height, width), chroma.reshape(height, width)


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
def hue_weights(hue, chroma):  # type: ignore[no-untyped-def]
    """(180,) the chroma of the pixels of each hue, summed over those that are not pale; zeros without any."""
    of_chroma, rest = np.zeros(256, np.int64), np.zeros(HUES, np.int64)
    lower = np.zeros((HUES, 256 // PALE_SHARE), np.int32)  # what may turn out to be pale, by hue and chroma
    for y in range(hue.shape[0]):
        for x in range(hue.shape[1]):
            much = chroma[y, x]
            if much < MIN_CHROMA:
                continue
            of_chroma[much] += 1
            if much < lower.shape[1]:
                lower[hue[y, x], much] += 1
            else:
                rest[hue[y, x]] += much
    limit, below, strong = STRONG_SHARE * of_chroma.sum(), 0, 0
    while strong < 255 and below + of_chroma[strong] < limit:
        below += of_chroma[strong]
        strong += 1
    for much in range(max(MIN_CHROMA, strong // PALE_SHARE), lower.shape[1]):
        for one in range(HUES):
            rest[one] += much * lower[one, much]
    return rest.astype(np.float64)


@compiled
def _arcs(ink_of_hue):  # type: ignore[no-untyped-def]
    """(3, 2) uint8: of each ink's hues, which lie side by side, the first and their number."""
    arcs = np.zeros((3, 2), np.uint8)
    for hue in range(HUES):
        ink = ink_of_hue[hue]
        if ink > 0:
            arcs[ink - 1, 1] += 1
            if ink_of_hue[hue - 1] != ink:
                arcs[ink - 1, 0] = hue
    return arcs


@compiled
def _within(hue, arc):  # type: ignore[no-untyped-def]
    """Whether a hue is among those of an arc."""
    first, count = arc
    past = np.uint8(hue - first) if hue >= first else np.uint8(hue + np.uint8(HUES) - first)
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
        hue: (H, W) uint8, the first of these.
        chroma: (H, W) uint8, max - min of B, G, R: 0 for black, grey and white in any light.
    """

    hsv: NDArray[np.uint8]
    hue: NDArray[np.uint8]
    chroma: NDArray[np.uint8]


def to_colors(image: NDArray[np.uint8]) -> Colors:
    """HSV and chroma of an 8-bit BGR image."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    return Colors(hsv, *_planes(hsv))  # type: ignore[arg-type]


def find_target(colors: Colors) -> Target:
    """Stage 1: flood the image from outside; what the flood cannot reach may be pattern.

    Tiles without color are water; closing seals the gaps between cells first, so that the flood stops at the
    pattern's rim while its black cells stay dry.
    """
    return Target(mask=_dry(_tile_chroma(colors.chroma, SHRINK)), shrink=SHRINK)


@compiled
def _dry(chroma):  # type: ignore[no-untyped-def]
    """(rows, columns) uint8, which tiles the flood does not reach."""
    counts = np.zeros(256, np.int64)
    for much in chroma.ravel():
        counts[much] += 1
    rank, below, strong = int(DRY_RANK * (chroma.size - 1)), counts[0], 0
    while below <= rank:
        strong += 1
        below += counts[strong]
    colored = (chroma > max(float(MIN_CHROMA), DRY_SHARE * strong)).astype(np.uint8)
    closed = _spread(_spread(colored, 1), 0)
    return 1 - _flooded(closed)


@compiled
def _spread(mask, value):  # type: ignore[no-untyped-def]
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


def find_hues(weight: NDArray[np.float64], nominal_deg: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """(3,) hues in degrees around which the image's saturated pixels gather, or None without such pixels.

    Circular 3-means from the nominal hues on the weights (180,) of hues in steps of 2 degrees. White balance and
    colored light move hues; a shift past ``HUE_REACH_DEG`` could rename the inks and is refused.
    """
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
    hue, chroma = colors.hue, colors.chroma
    tile = max(TILE_PX, min(chroma.shape) // 12 // SHRINK * SHRINK)
    few, few_tile = (hue, chroma), tile
    if chroma.size > SURVEY_PIXELS:
        few, few_tile = (_every_other(hue), _every_other(chroma)), tile // 2
    hues = find_hues(hue_weights(*few), nominal_deg)
    if hues is None:
        return None
    arcs = _arcs(_ink_of_hue(hues))
    threshold, typical = _thresholds(_tile_levels(*few, arcs, few_tile))
    label = _label(hue, chroma, arcs, threshold, tile, target.mask, target.shrink)
    return Segmentation(hsv=colors.hsv, label=label, hues_deg=hues, chroma=typical)
