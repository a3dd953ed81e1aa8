"""Stages 3 and 4: one seed per domain of an ink, and the adaptive growing algorithm (AGA, the article's eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .color import HUES
from .engine import compiled, vectorized
from .segmentation import Segmentation

GROW_THRESHOLD = 0.15  # the article's, for eq. 3 over OpenCV's 8-bit HSV
MIN_DOMAIN_PX = 4
# In a crowd, a cell has edges of 5 px at least, and of its area no less than a convex shape has for the spread of its
# pixels (the root of their covariance's determinant): a triangle 10.4 times, an ellipse 12.6 times.
MIN_CROWDED_PX = 12
MIN_SOLIDITY = 8.0
NO_CROWD = 1 << 62
SAFE_AREA_PX = 20  # a cell with edges of 7 px
MAX_SMALL = 0.1  # of the domains
MOMENTS = 10  # 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy about the seed


@dataclass(frozen=True, eq=False)
class Seeds:
    """Stage 3: one seed per domain.

    Attributes:
        xy: (N, 2) int32, the pixel to grow from.
        center: (N, 2) float64, the domain's geometric center.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        area_px: (N,) int64, the domain's area.
        runs: (R, 4) int32, the horizontal runs of one ink: y, first x, last x, ink.
        domain: (R,) int32, the domain that a run belongs to, -1 where it is clutter.
        crowded: there were more domains than any pattern explains, and of those only what a cell could be is left.
    """

    xy: NDArray[np.int32]
    center: NDArray[np.float64]
    ink: NDArray[np.uint8]
    area_px: NDArray[np.int64]
    runs: NDArray[np.int32]
    domain: NDArray[np.int32]
    crowded: bool = False


@dataclass(frozen=True, eq=False)
class Regions:
    """Stage 4.

    Attributes:
        owner: (H, W) int32, the region that a pixel belongs to, counted from 1; 0 is none.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        seed: (N, 2) int32, the pixel about which the moments are taken.
        moments: (N, 10) float64: sums of 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy over the region's pixels.
        domain_px: (N,) int64, the area of the domain that the seed stood for.
    """

    owner: NDArray[np.int32]
    ink: NDArray[np.uint8]
    seed: NDArray[np.int32]
    moments: NDArray[np.float64]
    domain_px: NDArray[np.int64]


@compiled
def _count_runs(label):  # type: ignore[no-untyped-def]
    """How many horizontal runs of one ink there are."""
    count = 0
    for y in range(label.shape[0]):
        row = label[y]
        count += row[0] != 0
        for x in range(1, label.shape[1]):
            count += (row[x] != row[x - 1]) & (row[x] != 0)
    return count


@compiled
def _root(parent, i):  # type: ignore[no-untyped-def]
    """The first run of the domain that run i belongs to; the path to it is halved on the way."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@compiled
def _runs(label):  # type: ignore[no-untyped-def]
    """Horizontal runs of one ink, each joined with the touching runs of its ink in the row above (4-neighbours).

    Returns (R, 4) int32 of y, first x, last x, ink, and (R,) int32 an earlier run of each run's domain, or itself.
    """
    height, width = label.shape
    runs = np.empty((_count_runs(label) + 1, 4), np.int32)
    begin = np.empty(width + 1, np.int32)  # where the stretches of a row begin, those without ink among them
    count = 0
    for y in range(height):
        row = label[y]
        begin[0], stretches, before = 0, np.uint64(1), row[0]
        for x in range(1, width):
            begin[stretches] = x
            stretches += np.uint64(row[x] != before)
            before = row[x]
        begin[stretches] = width
        for n in range(np.int64(stretches)):
            ink = row[begin[n]]
            runs[count, 0], runs[count, 1], runs[count, 2], runs[count, 3] = (
                y,
                begin[n],
                begin[n + 1] - 1,
                ink,
            )
            count += ink != 0
    parent = np.arange(count).astype(np.int32)
    above = 0
    for i in range(count):
        y, start, end, ink = runs[i, 0], runs[i, 1], runs[i, 2], runs[i, 3]
        while runs[above, 0] < y - 1 or (runs[above, 0] == y - 1 and runs[above, 2] < start):
            above += 1
        other = above
        while runs[other, 0] == y - 1 and runs[other, 1] <= end:
            if runs[other, 3] == ink:
                a, b = _root(parent, i), _root(parent, other)
                parent[max(a, b)] = min(a, b)
            other += 1
    return runs[:count], parent


@compiled
def _domains(runs, parent, crowd):  # type: ignore[no-untyped-def]
    """(R,) int32 the domain of each run, -1 where that is too small, or there are more than ``crowd`` and it is none a
    cell could be; the areas of the others; and whether there are more."""
    domain, area = np.empty(runs.shape[0], np.int32), np.zeros(runs.shape[0], np.int64)
    count = 0
    for i in range(runs.shape[0]):
        if parent[i] == i:
            domain[i] = count
            count += 1
        else:
            domain[i] = domain[parent[i]]
        area[domain[i]] += runs[i, 2] - runs[i, 1] + 1
    area = area[:count]
    crowded = np.count_nonzero(area >= MIN_DOMAIN_PX) > crowd
    area = _keep(domain, area, area >= (MIN_CROWDED_PX if crowded else MIN_DOMAIN_PX))
    if crowded:
        area = _keep(domain, area, area >= MIN_SOLIDITY * _spread(runs, domain, area))
    return domain, area, crowded


@compiled
def _keep(domain, area, keep):  # type: ignore[no-untyped-def]
    """Number the domains to keep anew, in place, with -1 for the others; their areas."""
    number = np.where(keep, np.cumsum(keep) - 1, -1)
    for i in range(domain.shape[0]):
        if domain[i] >= 0:
            domain[i] = number[domain[i]]
    return area[keep]


@compiled
def _spread(runs, domain, area):  # type: ignore[no-untyped-def]
    """(D,) the root of the determinant of the covariance of each domain's pixels, px^2."""
    sums = np.zeros((area.shape[0], 5))
    for i in range(domain.shape[0]):
        d = domain[i]
        if d < 0:
            continue
        y, length = runs[i, 0], runs[i, 2] - runs[i, 1] + 1
        x = 0.5 * (runs[i, 1] + runs[i, 2])
        sums[d, 0] += length * x
        sums[d, 1] += length * y
        sums[d, 2] += length * (x * x + (length * length - 1) / 12.0)
        sums[d, 3] += length * x * y
        sums[d, 4] += length * y * y
    out = np.empty(area.shape[0])
    for d in range(area.shape[0]):
        x, y = sums[d, 0] / area[d], sums[d, 1] / area[d]
        # a pixel is a square, not a point: it adds 1/12 to each variance
        xx, yy = sums[d, 2] / area[d] - x * x + 1.0 / 12.0, sums[d, 4] / area[d] - y * y + 1.0 / 12.0
        xy = sums[d, 3] / area[d] - x * y
        out[d] = np.sqrt(max(xx * yy - xy * xy, 0.0))
    return out


@compiled
def _seeds(runs, domain, area):  # type: ignore[no-untyped-def]
    """Per domain: the pixel of it nearest to its geometric center, that center, its ink and its area."""
    count = area.shape[0]
    ink, center = np.empty(count, np.uint8), np.zeros((count, 2))
    for i in range(runs.shape[0]):
        d = domain[i]
        if d >= 0:
            length = runs[i, 2] - runs[i, 1] + 1
            ink[d] = runs[i, 3]
            center[d, 0] += 0.5 * length * (runs[i, 1] + runs[i, 2])
            center[d, 1] += length * runs[i, 0]
    middle, best = np.empty(count, np.int64), np.full(count, np.inf)
    for d in range(count):
        center[d, 0] /= area[d]
        center[d, 1] /= area[d]
        middle[d] = round(center[d, 0])
    xy = np.zeros((count, 2), np.int32)
    for i in range(runs.shape[0]):
        d = domain[i]
        if d < 0:
            continue
        x = min(max(middle[d], runs[i, 1]), runs[i, 2])
        distance = (x - center[d, 0]) ** 2 + (runs[i, 0] - center[d, 1]) ** 2
        if distance < best[d]:
            best[d] = distance
            xy[d, 0] = x
            xy[d, 1] = runs[i, 0]
    return xy, center, ink, area


def find_seeds(segmentation: Segmentation, crowd: int = NO_CROWD) -> Seeds:
    """Stage 3: one seed per domain; domains of fewer than ``MIN_DOMAIN_PX`` pixels are clutter.

    The seed is the geometric center, or the domain's pixel nearest to it where the domain is not convex.

    Args:
        crowd: where there are more domains than this, small and ragged ones are clutter, too: an image of noise has
            many times more than any pattern.
    """
    runs, parent = _runs(segmentation.label)
    domain, area, crowded = _domains(runs, parent, crowd)
    xy, center, ink, area_px = _seeds(runs, domain, area)
    return Seeds(xy, center, ink, area_px, runs, domain, crowded)


@compiled
def domain_moments(runs, domain, seed_xy):  # type: ignore[no-untyped-def]
    """(N, 10) the moments of whole domains, as ``Regions`` has them of what has grown."""
    out = np.zeros((seed_xy.shape[0], MOMENTS))
    for i in range(runs.shape[0]):
        d = domain[i]
        if d < 0:
            continue
        row, y = out[d], float(runs[i, 0] - seed_xy[d, 1])
        for k in range(runs[i, 1], runs[i, 2] + 1):
            x = float(k - seed_xy[d, 0])
            xx, xy, yy = x * x, x * y, y * y
            row[0] += 1.0
            row[1] += x
            row[2] += y
            row[3] += xx
            row[4] += xy
            row[5] += yy
            row[6] += xx * x
            row[7] += xx * y
            row[8] += x * yy
            row[9] += yy * y
    return out


def large_enough(seeds: Seeds) -> bool:
    """Whether at most a few of the domains are too small to be recognised safely."""
    return len(seeds.ink) > 0 and float(np.mean(seeds.area_px < SAFE_AREA_PX)) < MAX_SMALL


@vectorized
def _add_moments(x_of, y_of, x0, y0, out):  # type: ignore[no-untyped-def]
    """Write the moments of pixels about (x0, y0); whole numbers all, so that their order does not matter."""
    m1, m2, m3, m4, m5, m6, m7, m8, m9 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(x_of.shape[0]):
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
    out[0], out[1], out[2], out[3], out[4] = x_of.shape[0], m1, m2, m3, m4
    out[5], out[6], out[7], out[8], out[9] = m5, m6, m7, m8, m9


@compiled
def _grow(hsv, label, seed_xy, seed_ink, limit_px, threshold):  # type: ignore[no-untyped-def]
    """Grow every seed in waves of 4-neighbours; a wave is judged against the mean of all waves before it."""
    height, width = label.shape
    owner = np.zeros((height, width), np.int32)
    owners, labels, colors = owner.reshape(-1), label.reshape(-1), hsv.reshape(-1)
    across = np.empty(limit_px + 2, np.int32)  # a queue of pixels: their x
    down = np.empty(limit_px + 2, np.int32)  # and y
    moments = np.zeros((seed_xy.shape[0], MOMENTS))
    limit2 = threshold * threshold
    half = HUES // 2
    for region in range(seed_xy.shape[0]):
        sx, sy, ink = seed_xy[region, 0], seed_xy[region, 1], seed_ink[region]
        first = sy * width + sx
        if owners[first] != 0:
            continue
        across[0], down[0] = sx, sy
        owners[first] = region + 1
        h0 = float(colors[3 * first])
        sum_h, sum_s, sum_v = 0.0, float(colors[3 * first + 1]), float(colors[3 * first + 2])
        mean_h, mean_s, mean_v = h0, sum_s, sum_v
        begin, end = 0, 1
        while begin < end and end <= limit_px:
            wave_end = end
            for i in range(begin, wave_end):
                x, y = across[i], down[i]
                for side in range(4):
                    nx = x + (1 if side == 0 else -1 if side == 1 else 0)
                    ny = y + (1 if side == 2 else -1 if side == 3 else 0)
                    if nx < 0 or ny < 0 or nx == width or ny == height:
                        continue
                    to = ny * width + nx
                    if owners[to] != 0 or end > limit_px or (labels[to] != ink and labels[to] != 0):
                        continue
                    h, s, v = float(colors[3 * to]), float(colors[3 * to + 1]), float(colors[3 * to + 2])
                    # circular: the pixel's hue is unwrapped to the side of the mean on which it lies
                    dh = h - mean_h
                    dh += HUES if dh < -half else -HUES if dh >= half else 0.0
                    ds, dv = s - mean_s, v - mean_v
                    scale = (mean_h + dh) * mean_h + s * mean_s + v * mean_v
                    if dh * dh + ds * ds + dv * dv >= limit2 * scale:
                        continue
                    owners[to] = region + 1
                    across[end], down[end] = nx, ny
                    end += 1
                    away = h - h0
                    sum_h += away + (HUES if away < -half else -HUES if away >= half else 0.0)
                    sum_s += s
                    sum_v += v
            begin = wave_end
            mean_h = (h0 + sum_h / end) % HUES
            mean_s = sum_s / end
            mean_v = sum_v / end
        if end > limit_px:
            continue  # a leak or a background: no cell is that large
        _add_moments(across[:end], down[:end], sx, sy, moments[region])
    return owner, moments


def grow(segmentation: Segmentation, seeds: Seeds) -> Regions:
    """Stage 4 (AGA): from each seed, add 4-neighbours while eq. 3 stays below 0.15 and update the mean as it grows.

    Eq. 3 is taken over OpenCV's 8-bit HSV (H 0..179, S and V 0..255). Differences and means of hue are circular;
    ``P . mean = 0`` (black) rejects the pixel instead of dividing. A region never enters another ink's domain.
    """
    limit_px = segmentation.label.size // 6
    owner, moments = _grow(
        segmentation.hsv, segmentation.label, seeds.xy, seeds.ink, limit_px, GROW_THRESHOLD
    )
    return Regions(owner=owner, ink=seeds.ink, seed=seeds.xy, moments=moments, domain_px=seeds.area_px)
