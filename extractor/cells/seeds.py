"""Stage 3: the pixel domains of the inks, one seed for each, and the domains' moments."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.ink_segmentation import Segmentation
from extractor.numeric.compilation import compiled, inlined_no_refcount

MIN_DOMAIN_PX = 4  # px^2
MIN_CLUTTERED_PX = 12  # px^2, of a domain in a cluttered image: a cell with edges of 5 px
# Area of a domain in a cluttered image, relative to the root of the determinant of its pixels' covariance: a triangle
# has 10.4, an ellipse 12.6, ragged shapes have less.
MIN_SOLIDITY = 8.0
NO_DOMAIN_LIMIT = 1 << 62
SAFE_AREA_PX = 20  # px^2, a cell with edges of 7 px
MAX_SMALL_SHARE = 1 / 6  # of domains below SAFE_AREA_PX
MOMENT_TERMS = 10  # 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy about the seed


class SeedPoints(NamedTuple):
    """The seeds of N domains.

    Attributes:
        xy: (N, 2) int32, the pixel of the domain nearest to its center.
        center: (N, 2) float64, the domain's geometric center, px.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
    """

    xy: NDArray[np.int32]
    center: NDArray[np.float64]
    ink: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Seeds:
    """Stage 3: one seed per domain, computed at its first use.

    Attributes:
        area_px: (N,) int64, the domain's area, px^2.
        runs: (R, 4) int32, the domains' horizontal runs: y, first x, last x, ink.
        domain: (R,) int32, the domain of each run.
        cluttered: there were more domains than any pattern explains; only those that may be cells are kept.
    """

    area_px: NDArray[np.int64]
    runs: NDArray[np.int32]
    domain: NDArray[np.int32]
    cluttered: bool = False

    @property
    def xy(self) -> NDArray[np.int32]:
        """(N, 2) int32, x and y of the seed."""
        return self.points.xy

    @property
    def center(self) -> NDArray[np.float64]:
        """(N, 2) float64, the domain's geometric center, px."""
        return self.points.center

    @property
    def ink(self) -> NDArray[np.uint8]:
        """(N,) uint8, 1 red, 2 green, 3 blue."""
        return self.points.ink

    @cached_property
    def points(self) -> SeedPoints:
        """The seeds."""
        return _seed_points(self.runs, self.domain, self.area_px)  # type: ignore[no-any-return]


@compiled
def _count_runs(label):  # type: ignore[no-untyped-def]
    """The number of horizontal runs of one ink in ``label`` (H, W)."""
    count = 0
    for y in range(label.shape[0]):
        row = label[y]
        count += row[0] != 0
        for x in range(1, label.shape[1]):
            count += (row[x] != row[x - 1]) & (row[x] != 0)
    return count


@inlined_no_refcount
def _update_and_find_root(parent, i):  # type: ignore[no-untyped-def]
    """The first run of the domain of run i; halves the path to it in ``parent`` (R,)."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@compiled
def _find_runs(label):  # type: ignore[no-untyped-def]
    """The horizontal runs of one ink, connected with the adjacent runs of their ink in the row above (4-neighbours).

    Returns (R, 4) int32, y, first x, last x and ink; and (R,) int32, an earlier run of the domain of each run, or the
    run itself.
    """
    height, width = label.shape
    runs = np.empty((_count_runs(label) + 1, 4), np.int32)
    begin = np.empty(
        width + 1, np.int32
    )  # the begins of a row's stretches of equal label, with or without ink
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
        other, own = above, i
        while runs[other, 0] == y - 1 and runs[other, 1] <= end:
            if runs[other, 3] == ink:
                if own == i:
                    own = parent[other]
                elif own != parent[other]:
                    a, b = _update_and_find_root(parent, own), _update_and_find_root(parent, other)
                    parent[max(a, b)] = min(a, b)
            other += 1
        parent[i] = own
    return runs[:count], parent


@compiled
def _find_domains(runs, parent, max_domains):  # type: ignore[no-untyped-def]
    """Select the domains that are large enough, or, of more than ``max_domains``, those that may be cells.

    Returns their runs, (R,) int32 the domain of each run, the domains' areas, and whether there were more domains.
    """
    domain, area = np.empty(runs.shape[0], np.int32), np.zeros(runs.shape[0], np.int64)
    count = 0
    for i in range(runs.shape[0]):
        first, d = parent[i] == i, domain[parent[i]]
        d = count if first else d  # without a branch, which would be unpredictable
        domain[i] = d
        count += first
        area[d] += runs[i, 2] - runs[i, 1] + 1
    area = area[:count]
    cluttered = np.count_nonzero(area >= MIN_DOMAIN_PX) > max_domains
    runs, domain, area = _select_domains(
        runs, domain, area, area >= (MIN_CLUTTERED_PX if cluttered else MIN_DOMAIN_PX)
    )
    if cluttered:
        runs, domain, area = _select_domains(
            runs, domain, area, area >= MIN_SOLIDITY * _covariance_root(runs, domain, area)
        )
    return runs, domain, area, cluttered


@compiled
def _select_domains(runs, domain, area, keep):  # type: ignore[no-untyped-def]
    """The runs of the domains to ``keep`` (D,), the renumbered domain of each, and the domains' areas."""
    number, few, own = np.empty(area.shape[0], np.int32), 0, 0
    for d in range(area.shape[0]):
        number[d] = few
        few += keep[d]
    if few == area.shape[0]:
        return runs, domain, area
    some, of = np.empty_like(runs), np.empty_like(domain)
    for i in range(domain.shape[0]):
        d = domain[i]
        # a run not kept is overwritten: a branch would be unpredictable
        some[own, 0], some[own, 1], some[own, 2], some[own, 3] = (
            runs[i, 0],
            runs[i, 1],
            runs[i, 2],
            runs[i, 3],
        )
        of[own] = number[d]
        own += keep[d]
    return some[:own], of[:own], area[keep]


@compiled
def _covariance_root(runs, domain, area):  # type: ignore[no-untyped-def]
    """(D,) float64, px^2, the root of the determinant of the covariance of each domain's pixels."""
    sums = np.zeros((area.shape[0], 5))
    for i in range(domain.shape[0]):
        d, y, length = domain[i], runs[i, 0], runs[i, 2] - runs[i, 1] + 1
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
def _seed_points(runs, domain, area):  # type: ignore[no-untyped-def]
    """``SeedPoints`` of the domains."""
    count = area.shape[0]
    ink, center = np.empty(count, np.uint8), np.zeros((count, 2))
    for i in range(runs.shape[0]):
        d, length = domain[i], runs[i, 2] - runs[i, 1] + 1
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
        x = min(max(middle[d], runs[i, 1]), runs[i, 2])
        distance = (x - center[d, 0]) ** 2 + (runs[i, 0] - center[d, 1]) ** 2
        if distance < best[d]:
            best[d] = distance
            xy[d, 0] = x
            xy[d, 1] = runs[i, 0]
    return SeedPoints(xy, center, ink)


def find_seeds(segmentation: Segmentation, max_domains: int = NO_DOMAIN_LIMIT) -> Seeds:
    """Stage 3: one seed per domain; domains of fewer than ``MIN_DOMAIN_PX`` pixels are ignored.

    The seed is the domain's pixel nearest to its geometric center.

    Args:
        segmentation: the ink of every pixel.
        max_domains: of more domains than this, small and ragged ones are ignored, too: an image of noise has many times
            more domains than any pattern.
    """
    runs, parent = _find_runs(segmentation.label)
    runs, domain, area_px, cluttered = _find_domains(runs, parent, max_domains)
    return Seeds(area_px, runs, domain, cluttered)


@compiled
def domain_moments(runs, domain, seed_xy):  # type: ignore[no-untyped-def]
    """(N, 10) float64, the moments of domains about their seeds, as ``Regions.moments`` of grown regions.

    Each run is added at once, by its middle and length. All numbers are exact: multiples of 1/8.
    """
    out = np.zeros((seed_xy.shape[0], MOMENT_TERMS))
    for i in range(runs.shape[0]):
        d = domain[i]
        y, length = float(runs[i, 0] - seed_xy[d, 1]), float(runs[i, 2] - runs[i, 1] + 1)
        middle = 0.5 * float(runs[i, 1] + runs[i, 2]) - float(seed_xy[d, 0])
        spread = length * (length * length - 1.0) / 12.0  # sum of squares about the middle
        x = length * middle
        xx = x * middle + spread
        out[d, 0] += length
        out[d, 1] += x
        out[d, 2] += length * y
        out[d, 3] += xx
        out[d, 4] += x * y
        out[d, 5] += length * y * y
        out[d, 6] += middle * (x * middle + 3.0 * spread)
        out[d, 7] += xx * y
        out[d, 8] += x * y * y
        out[d, 9] += length * y * y * y
    return out


def has_large_domains(seeds: Seeds) -> bool:
    """Whether only few domains are too small for safe recognition."""
    return len(seeds.area_px) > 0 and float(np.mean(seeds.area_px < SAFE_AREA_PX)) < MAX_SMALL_SHARE
