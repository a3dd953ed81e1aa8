"""Hue and chroma of an image, and the hues of its inks under the light of the image."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled

HUES = 180  # OpenCV's 8-bit hue counts in steps of 2 degrees
HUE_REACH_DEG = 50.0  # maximum shift of an ink's hue from its nominal hue; 60 would be ambiguous
MIN_CHROMA = 12  # gray levels; below it, 8-bit hue is noise
OPENCV_HUE_DEG = 2.0  # degrees per step of OpenCV's hue
HUE_WIDTH_DEG = 40.0  # pixels farther from every center do not count
KMEANS_ROUNDS = 8
STRONG_QUANTILE = 0.98  # share of the colored pixels with less chroma than a strong one
PALE_DIVISOR = 8  # a pale pixel has less than this fraction (1/8) of the strong chroma


@dataclass(frozen=True, eq=False)
class Colors:
    """The colors of an image.

    Attributes:
        hsv: (H, W, 3) uint8, OpenCV's scale: H 0..179 (2 degrees per step), S and V 0..255.
        hue: (H, W) uint8, the channel H.
        chroma: (H, W) uint8, max - min of B, G, R: 0 for black, gray and white in any light.
    """

    hsv: NDArray[np.uint8]
    hue: NDArray[np.uint8]
    chroma: NDArray[np.uint8]


def nominal_hues_deg(palette: dict[str, str]) -> NDArray[np.float64]:
    """(3,) float64 hues in degrees of the palette's red, green and blue ("#rrggbb")."""
    inks = [[int(palette[c][i : i + 2], 16) for i in (5, 3, 1)] for c in ("red", "green", "blue")]
    hsv = cv2.cvtColor(np.array([inks], np.float32) / 255, cv2.COLOR_BGR2HSV)
    return hsv[0, :, 0].astype(np.float64)


@compiled
def _hsv_and_chroma(image):  # type: ignore[no-untyped-def]
    """HSV (H, W, 3) uint8, equal to OpenCV's in every bit; hue (H, W) uint8; chroma (H, W) uint8, max - min of B, G, R.

    It takes less than half of OpenCV's time. The chroma is S V / 255.
    """
    height, width = image.shape[:2]
    hsv = np.empty((height, width, 3), np.uint8)
    hue, chroma = np.empty((height, width), np.uint8), np.empty((height, width), np.uint8)
    _fill_hsv_and_chroma(image.reshape(-1), hsv.reshape(-1), hue.reshape(-1), chroma.reshape(-1))
    return hsv, hue, chroma


@compiled
def _fill_hsv_and_chroma(bgr, hsv, hue, chroma):  # type: ignore[no-untyped-def]
    """``_hsv_and_chroma`` on flat arrays, in 32-bit integers for vectorization; quotients are rounded to 2^-12."""
    one, two, three, twelve = np.uint64(1), np.uint64(2), np.uint64(3), np.int32(12)
    half, rounds, unit = np.float32(0.5), np.int32(1 << 11), np.int32(1)
    for i in range(np.uint64(hue.shape[0])):
        first = three * np.uint64(i)
        b, g, r = np.int32(bgr[first]), np.int32(bgr[first + one]), np.int32(bgr[first + two])
        v = max(b, g, r)
        spread = np.int32(v - min(b, g, r))
        per_v = np.int32(np.float32(255 << 12) / np.float32(max(v, unit)) + half)
        per_spread = np.int32(np.float32(HUES * (1 << 12) / 6) / np.float32(max(spread, unit)) + half)
        s = np.int32(np.int32(spread * per_v) + rounds) >> twelve
        sixth = g - b if v == r else b - r + 2 * spread if v == g else r - g + 4 * spread
        h = np.int32(np.int32(np.int32(sixth) * per_spread) + rounds) >> twelve
        h = np.int32(h + HUES) if h < 0 else np.int32(h)
        hsv[first], hsv[first + one], hsv[first + two], hue[i] = h, s, v, h
        chroma[i] = np.int32(np.int32(np.int32(s * v) * np.int32(257)) + np.int32(1 << 15)) >> np.int32(16)


def to_colors(image: NDArray[np.uint8]) -> Colors:
    """HSV and chroma of a BGR image (H, W, 3) uint8."""
    return Colors(*_hsv_and_chroma(np.ascontiguousarray(image)))


@compiled
def hue_weights(hue, chroma):  # type: ignore[no-untyped-def]
    """(180,) float64, the sum of the chroma of all pixels of each hue that are not pale."""
    chroma_counts, weights = np.zeros(256, np.int64), np.zeros(HUES, np.int64)
    low_counts = np.zeros((HUES, 256 // PALE_DIVISOR), np.int32)  # pixels that may be pale, by hue and chroma
    for y in range(hue.shape[0]):
        for x in range(hue.shape[1]):
            level = chroma[y, x]
            if level < MIN_CHROMA:
                continue
            chroma_counts[level] += 1
            if level < low_counts.shape[1]:
                low_counts[hue[y, x], level] += 1
            else:
                weights[hue[y, x]] += level
    limit, below, strong = STRONG_QUANTILE * chroma_counts.sum(), 0, 0
    while strong < 255 and below + chroma_counts[strong] < limit:
        below += chroma_counts[strong]
        strong += 1
    for level in range(max(MIN_CHROMA, strong // PALE_DIVISOR), low_counts.shape[1]):
        for one in range(HUES):
            weights[one] += level * low_counts[one, level]
    return weights.astype(np.float64)


@compiled
def _hue_shifts(weight, nominal_deg):  # type: ignore[no-untyped-def]
    """Circular 3-means of a hue histogram (180,), limited to ``HUE_REACH_DEG`` around the nominal hues (3,).

    Returns:
        (3,) shifts in degrees, and whether every ink has pixels.
    """
    shift = np.zeros(3)
    for _ in range(KMEANS_ROUNDS):
        total, moment = np.zeros(3), np.zeros(3)
        for hue in range(HUES):
            if weight[hue] == 0.0:
                continue
            smallest, nearest = 360.0, 0
            for ink in range(3):
                difference = hue * OPENCV_HUE_DEG - nominal_deg[ink] - shift[ink]
                difference -= 360.0 * np.floor(difference / 360.0 + 0.5)
                if abs(difference) < abs(smallest):
                    smallest, nearest = difference, ink
            if abs(smallest) < HUE_WIDTH_DEG:
                total[nearest] += weight[hue]
                moment[nearest] += weight[hue] * smallest
        for ink in range(3):
            if total[ink] == 0.0:
                return shift, False
            moved = shift[ink] + moment[ink] / total[ink]
            shift[ink] = min(max(moved, -HUE_REACH_DEG), HUE_REACH_DEG)
    return shift, True


def find_hues(weight: NDArray[np.float64], nominal_deg: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """(3,) float64, the hues of the inks in the image, degrees; None where an ink has no pixels.

    The method is circular 3-means, started from the nominal hues (3,), on the weights (180,) of hues in steps of
    2 degrees. White balance and colored light shift hues; shifts end at ``HUE_REACH_DEG``, so that no ink is taken for
    another.
    """
    if not weight.any():
        return None
    shift, found = _hue_shifts(weight, nominal_deg)
    return (nominal_deg + shift) % 360 if found else None


@compiled
def ink_of_hue(hues_deg):  # type: ignore[no-untyped-def]
    """(180,) uint8: the ink (1, 2, 3) with the nearest of the hues (3,), 0 where all are 60 degrees or more away."""
    ink_of_hue = np.zeros(HUES, np.uint8)
    for hue in range(HUES):
        smallest = 60.0
        for ink in range(3):
            difference = hue * OPENCV_HUE_DEG - hues_deg[ink]
            difference = abs(difference - 360.0 * np.floor(difference / 360.0 + 0.5))
            if difference < smallest:
                smallest = difference
                ink_of_hue[hue] = ink + 1
    return ink_of_hue
