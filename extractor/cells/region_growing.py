"""Stage 4: the adaptive growing algorithm (AGA, the article's eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.cells.seeds import MOMENT_TERMS, Seeds
from extractor.image.color import HUES
from extractor.image.ink_segmentation import Segmentation
from extractor.numeric.compilation import compiled, vectorized_no_refcount

GROW_THRESHOLD = 0.15  # of eq. 3 over OpenCV's 8-bit HSV, as in the article
BORDER = -1  # region number of the frame around the image


@dataclass(frozen=True, eq=False)
class Regions:
    """Stage 4.

    Attributes:
        region_map: (H, W) int32, the region of each pixel, counted from 1; 0 for none.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        seed: (N, 2) int32, x and y of the pixel about which the moments are taken.
        moments: (N, 10) float64, sums of 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy over the region's pixels.
    """

    region_map: NDArray[np.int32]
    ink: NDArray[np.uint8]
    seed: NDArray[np.int32]
    moments: NDArray[np.float64]


@vectorized_no_refcount
def _fill_moments(x_of, y_of, count, x0, y0, moments, region):  # type: ignore[no-untyped-def]
    """Write a region's moments about (x0, y0); all sums are integers, so that their order does not matter."""
    m1, m2, m3, m4, m5, m6, m7, m8, m9 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(np.uint64(count)):
        x, y = float(x_of[i] - x0), float(y_of[i] - y0)
        xx, xy, yy = x * x, x * y, y * y
        m1 += x
        m2 += y
        m3 += xx
        m4 += xy
        m5 += yy
        m6 += xx * x
        m7 += xx * y
        m8 += x * yy
        m9 += yy * y
    for k, value in enumerate((float(count), m1, m2, m3, m4, m5, m6, m7, m8, m9)):
        moments[region, k] = value


@compiled
def _grow(hsv, label, seed_xy, seed_ink, limit_px, threshold):  # type: ignore[no-untyped-def]
    """Grow every seed in waves of 4-neighbours; a wave is compared with the mean of all waves before it.

    Returns the region map with a frame of ``BORDER`` one pixel wide, and the moments.
    """
    height, width = label.shape
    framed_width = width + 2
    owner = np.full((height + 2, framed_width), BORDER, np.int32)
    owner[1:-1, 1:-1] = 0
    owners, labels, colors = owner.reshape(-1), label.reshape(-1), hsv.reshape(-1)
    queue = np.empty(limit_px + 2, np.int32)  # indices of pixels in the image
    framed = np.empty(limit_px + 2, np.int32)  # indices of the same pixels in the framed map
    moments = np.zeros((seed_xy.shape[0], MOMENT_TERMS))
    limit2 = threshold * threshold
    half, one, two = HUES // 2, np.uint64(1), np.uint64(2)
    for region in range(seed_xy.shape[0]):
        sx, sy, ink = seed_xy[region, 0], seed_xy[region, 1], seed_ink[region]
        first, start = sy * width + sx, (sy + 1) * framed_width + sx + 1
        if owners[start] != 0:
            continue
        queue[0], framed[0] = first, start
        owners[start] = region + 1
        h0 = float(colors[3 * first])
        sum_h, sum_s, sum_v = 0.0, float(colors[3 * first + 1]), float(colors[3 * first + 2])
        mean_h, mean_s, mean_v = h0, sum_s, sum_v
        begin, end = 0, 1
        while begin < end and end <= limit_px:
            wave_end = end
            for i in range(begin, wave_end):
                for side in range(4):
                    row_step = framed_width if side == 2 else -framed_width
                    step = 1 if side == 0 else -1 if side == 1 else row_step
                    to = np.uint64(framed[i] + step)
                    if owners[to] != 0:
                        continue
                    step = 1 if side == 0 else -1 if side == 1 else width if side == 2 else -width
                    pixel = np.uint64(queue[i] + step)
                    if end > limit_px or (labels[pixel] != ink and labels[pixel] != 0):
                        continue
                    at = np.uint64(3) * pixel
                    h, s, v = float(colors[at]), float(colors[at + one]), float(colors[at + two])
                    # hue is circular: the difference is unwrapped to the nearer side of the mean
                    dh = h - mean_h
                    dh += HUES if dh < -half else -HUES if dh >= half else 0.0
                    ds, dv = s - mean_s, v - mean_v
                    scale = (mean_h + dh) * mean_h + s * mean_s + v * mean_v
                    is_similar = dh * dh + ds * ds + dv * dv < limit2 * scale
                    # a rejected pixel is overwritten: in noise, a branch would be unpredictable
                    queue[end], framed[end] = pixel, to
                    owners[to] = region + 1 if is_similar else 0
                    end += is_similar
                    dh0 = h - h0
                    dh0 += HUES if dh0 < -half else -HUES if dh0 >= half else 0.0
                    sum_h += dh0 if is_similar else 0.0
                    sum_s += s if is_similar else 0.0
                    sum_v += v if is_similar else 0.0
            begin = wave_end
            mean_h = h0 + sum_h / end
            mean_h += HUES if mean_h < 0.0 else -HUES if mean_h >= HUES else 0.0
            mean_s = sum_s / end
            mean_v = sum_v / end
        if end > limit_px:
            continue  # a leak or the background: no cell is that large
        _update_to_coordinates(queue, framed, end, width)
        _fill_moments(queue, framed, end, sx, sy, moments, region)
    return owner, moments


@vectorized_no_refcount
def _update_to_coordinates(queue, framed, count, width):  # type: ignore[no-untyped-def]
    """Replace each pixel's indices by its x and y; their difference is the number of frame pixels before it."""
    for i in range(np.uint64(count)):
        y = (framed[i] - queue[i] - width - 3) >> 1
        queue[i], framed[i] = queue[i] - y * width, y


def grow(segmentation: Segmentation, seeds: Seeds) -> Regions:
    """Stage 4 (AGA): add 4-neighbours to each seed while eq. 3 stays below 0.15, with the mean updated after each wave.

    Eq. 3 uses OpenCV's 8-bit HSV (H 0..179, S and V 0..255). Differences and means of hue are circular;
    ``P . mean = 0`` (black) rejects the pixel instead of dividing. A region never enters another ink's domain.
    """
    limit_px = segmentation.label.size // 6
    owner, moments = _grow(
        segmentation.hsv, segmentation.label, seeds.xy, seeds.ink, limit_px, GROW_THRESHOLD
    )
    owner = owner[1:-1, 1:-1]
    return Regions(region_map=owner, ink=seeds.ink, seed=seeds.xy, moments=moments)
