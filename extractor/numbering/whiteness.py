"""Measures the inks, and the brightness and whiteness of predicted places.

The brightness is the sum of the channels, relative to that of the inks around. In light of any color, each channel of
white is about as strong as in the ink with most of that channel; colored dirt has a weaker channel. The whiteness is
the weakest of these ratios, 0 for colored places.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.localmap.cell_prediction import KnownCells
from extractor.numeric.bilinear_batch import (
    BATCH_POINTS,
    COLOR,
    INSIDE,
    RADIUS,
    X,
    Y,
    allocate_sample_buffers,
    fill_patch_means,
)
from extractor.numeric.compilation import compiled

MIN_CHANNEL_BALANCE = 0.4  # of the weakest ratio to the strongest, for places that are not colored


class InkColors(NamedTuple):
    """The inks in the image.

    Attributes:
        colors: (4, 3) float64, median BGR of red, green and blue in rows 1 to 3; 0 for an absent ink.
        strongest: (3,) float64, the maximum of each channel.
    """

    colors: NDArray[np.float64]
    strongest: NDArray[np.float64]


class PlaceColors(NamedTuple):
    """The colors of P predicted places.

    Attributes:
        brightness: (P,) float64, relative to the inks.
        whiteness: (P,) float64, 0 for colored places.
        color: (P, 3) float64, BGR, 0 outside the image.
    """

    brightness: NDArray[np.float64]
    whiteness: NDArray[np.float64]
    color: NDArray[np.float64]


@compiled
def measure_inks(image, center, area, ink, known, basis):  # type: ignore[no-untyped-def]
    """Measure the levels of known cells and the inks.

    Args:
        image: (H, W, 3) uint8 BGR.
        center: (N, 2) px; area: (N,) px^2; ink: (N,) uint8, the cells of the image.
        known: (K,) int64 and basis: (K, 2, 2), by ``lattice_bases``.

    Returns:
        ``KnownCells`` and ``InkColors``.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    radius, level = np.empty(known.shape[0]), np.full(known.shape[0], np.nan)
    colors, count = np.empty((4, 3, known.shape[0])), np.zeros(4, np.int64)
    buffers = allocate_sample_buffers()
    patches = buffers.patches
    for first in range(0, known.shape[0], BATCH_POINTS):
        here = min(known.shape[0] - first, BATCH_POINTS)
        for n in range(here):
            i = known[first + n]
            radius[first + n] = 0.1 * np.sqrt(area[i])
            patches[X + n], patches[Y + n], patches[RADIUS + n] = (
                center[i, 0],
                center[i, 1],
                radius[first + n],
            )
        fill_patch_means(flat, height, width, here, buffers)
        for n in range(here):
            if patches[INSIDE + n] > 0.0:
                own, total = ink[known[first + n]], 0.0
                for channel in range(3):
                    value = patches[COLOR + channel * BATCH_POINTS + n]
                    colors[own, channel, count[own]] = value
                    total += value
                count[own] += 1
                level[first + n] = total
    inks, strongest = np.zeros((4, 3)), np.zeros(3)
    for channel in range(3):
        for c in range(1, 4):
            if count[c] > 0:
                inks[c, channel] = np.median(colors[c, channel, : count[c]])
                strongest[channel] = max(strongest[channel], inks[c, channel])
    return KnownCells(known, basis, radius, level), InkColors(inks, strongest)


@compiled
def measure_whiteness(image, means, strongest, is_far):  # type: ignore[no-untyped-def]
    """``PlaceColors`` of predicted places.

    Far from the next cell a prediction may hit a colored cell: there the brightness is the whiteness.

    Args:
        image: (H, W, 3) uint8 BGR.
        means: (P, 4) of ``PredictedPlaces``. strongest: (3,) of ``InkColors``.
        is_far: no known cell touches the places.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    count = means.shape[0]
    ratio, white, color = np.zeros(count), np.zeros(count), np.zeros((count, 3))
    buffers = allocate_sample_buffers()
    patches = buffers.patches
    for first in range(0, count, BATCH_POINTS):
        here = min(count - first, BATCH_POINTS)
        for n in range(here):
            patches[X + n], patches[Y + n] = means[first + n, 0], means[first + n, 1]
            patches[RADIUS + n] = means[first + n, 2]
        fill_patch_means(flat, height, width, here, buffers)
        for n in range(here):
            level, own = means[first + n, 3], color[first + n]
            ratio[first + n], white[first + n] = _fill_patch_color(patches, n, level, strongest, is_far, own)
    return PlaceColors(ratio, white, color)


@compiled
def _fill_patch_color(patches, n, level, strongest, is_far, color):  # type: ignore[no-untyped-def]
    """The brightness of patch n relative to the inks around, and its whiteness; writes its ``color`` (3,)."""
    if not patches[INSIDE + n] > 0.0:
        return 0.0, 0.0
    total, weakest, most = 0.0, np.inf, 0.0
    for channel in range(3):
        color[channel] = patches[COLOR + channel * BATCH_POINTS + n]
        share = color[channel] / max(strongest[channel], 1.0)
        total, weakest, most = total + color[channel], min(weakest, share), max(most, share)
    white = weakest if weakest > MIN_CHANNEL_BALANCE * most else 0.0
    return white if is_far else total / max(level, 1.0), white
