"""The colors of an image as recognition sees them, and the hues that its inks have in this light."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled

HUES = 180  # OpenCV's 8-bit hue counts in steps of 2 degrees
HUE_REACH_DEG = 50.0  # a hue farther than this from its nominal one is not that ink: 60 would be ambiguous
MIN_CHROMA = 12  # below this, 8-bit hue is noise
OPENCV_HUE_DEG = 2.0
HUE_WIDTH_DEG = 40.0  # pixels farther from every center tell nothing about it
KMEANS_ROUNDS = 8
STRONG_QUANTILE = 0.98  # of the colored pixels are less saturated than what counts as strong
PALE_DIVISOR = 8  # times less chroma than that is pale


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


def nominal_hues_deg(palette: dict[str, str]) -> NDArray[np.float64]:
    """(3,) hues in degrees of the palette's red, green and blue."""
    inks = [[int(palette[c][i : i + 2], 16) for i in (5, 3, 1)] for c in ("red", "green", "blue")]
    hsv = cv2.cvtColor(np.array([inks], np.float32) / 255, cv2.COLOR_BGR2HSV)
    return hsv[0, :, 0].astype(np.float64)


@compiled
def _hsv_and_chroma(image):  # type: ignore[no-untyped-def]
    """(H, W, 3) uint8 OpenCV's HSV, to the bit, in less than half its time; and (H, W) uint8 each: the hue, and the
    chroma max - min of B, G, R, which is S V / 255."""
    height, width = image.shape[:2]
    hsv = np.empty((height, width, 3), np.uint8)
    hue, chroma = np.empty((height, width), np.uint8), np.empty((height, width), np.uint8)
    _fill_hsv_and_chroma(image.reshape(-1), hsv.reshape(-1), hue.reshape(-1), chroma.reshape(-1))
    return hsv, hue, chroma


@compiled
def _fill_hsv_and_chroma(bgr, hsv, hue, chroma):  # type: ignore[no-untyped-def]
    """``_hsv_and_chroma``, flat: in whole numbers of 32 bits, which lanes hold; quotients are rounded to 2^-12."""
    one, two, three, twelve = np.uint64(1), np.uint64(2), np.uint64(3), np.int32(12)
    half, rounds, unit = np.float32(0.5), np.int32(1 << 11), np.int32(1)
    for i in range(np.uint64(hue.shape[0])):
        at = three * np.uint64(i)
        b, g, r = np.int32(bgr[at]), np.int32(bgr[at + one]), np.int32(bgr[at + two])
        v = max(b, g, r)
        spread = np.int32(v - min(b, g, r))
        per_v = np.int32(np.float32(255 << 12) / np.float32(max(v, unit)) + half)
        per_spread = np.int32(np.float32(HUES * (1 << 12) / 6) / np.float32(max(spread, unit)) + half)
        s = np.int32(np.int32(spread * per_v) + rounds) >> twelve
        beyond = g - b if v == r else b - r + 2 * spread if v == g else r - g + 4 * spread
        h = np.int32(np.int32(np.int32(beyond) * per_spread) + rounds) >> twelve
        h = np.int32(h + HUES) if h < 0 else np.int32(h)
        hsv[at], hsv[at + one], hsv[at + two], hue[i] = h, s, v, h
        chroma[i] = np.int32(np.int32(np.int32(s * v) * np.int32(257)) + np.int32(1 << 15)) >> np.int32(16)


def to_colors(image: NDArray[np.uint8]) -> Colors:
    """HSV and chroma of an 8-bit BGR image."""
    return Colors(*_hsv_and_chroma(np.ascontiguousarray(image)))


@compiled
def hue_weights(hue, chroma):  # type: ignore[no-untyped-def]
    """(180,) the chroma of the pixels of each hue, summed over those that are not pale; zeros without any."""
    of_chroma, rest = np.zeros(256, np.int64), np.zeros(HUES, np.int64)
    lower = np.zeros((HUES, 256 // PALE_DIVISOR), np.int32)  # what may turn out to be pale, by hue and chroma
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
    limit, below, strong = STRONG_QUANTILE * of_chroma.sum(), 0, 0
    while strong < 255 and below + of_chroma[strong] < limit:
        below += of_chroma[strong]
        strong += 1
    for much in range(max(MIN_CHROMA, strong // PALE_DIVISOR), lower.shape[1]):
        for one in range(HUES):
            rest[one] += much * lower[one, much]
    return rest.astype(np.float64)


@compiled
def _hue_shifts(weight, nominal_deg):  # type: ignore[no-untyped-def]
    """Circular 3-means of a hue histogram, held within reach of the nominal hues; False when an ink has no pixels."""
    shift = np.zeros(3)
    for _ in range(KMEANS_ROUNDS):
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
    shift, found = _hue_shifts(weight, nominal_deg)
    return (nominal_deg + shift) % 360 if found else None


@compiled
def ink_of_hue(hues_deg):  # type: ignore[no-untyped-def]
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
