"""Bleed: the blur brings the neighbours' levels into a cell's middle. Levels with the bleed removed, or adapted.

A level is the mean of a disc in the middle of the cell. Each of the three neighbours has a share in that mean, which
depends on the distance from the disc to the side between the cells, in units of the blur.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.refine.synthesis.ink_levels import BLACK, InkLevels, cell_radii, disc_radius

MAX_BLEED = 0.1  # share of a neighbour in a cell's mean, the most that is corrected


@compiled
def bleed_shares(xy, cells, sigma, assumed_sigma):  # type: ignore[no-untyped-def]
    """The share of each neighbour in the means of the cells.

    Args:
        xy: (M, 2) px, the markers. cells: (K, 3) marker ids.
        sigma: px, the blur. assumed_sigma: px, the blur that ``cell_means`` was called with.

    Returns:
        (K,) the shares, NaN where a corner is unknown; and their median.
    """
    inscribed = _inscribed_radii(xy, cells)
    out = np.empty(cells.shape[0])
    for i in range(cells.shape[0]):
        out[i] = _bleed_share(inscribed[i], assumed_sigma, sigma)
    return out, np.nanmedian(out)


@compiled
def _inscribed_radii(xy, cells):  # type: ignore[no-untyped-def]
    """(K,) px, the radii of the cells' inscribed circles, NaN where a corner is unknown."""
    out = np.empty(cells.shape[0])
    for i in range(cells.shape[0]):
        out[i] = cell_radii(xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]], 0.0)[0]
    return out


@inlined_no_refcount
def _bleed_share(inscribed, assumed_sigma, sigma):  # type: ignore[no-untyped-def]
    """The share of each neighbour in the mean of a disc; the disc's size follows from the assumed blur, px."""
    radius = disc_radius(inscribed, assumed_sigma)
    # the pixels of a disc have the variance radius^2 / 4 in one direction
    return 0.5 * math.erfc(inscribed / np.sqrt(2.0 * (sigma * sigma + 0.25 * radius * radius)))


def remove_bleed(
    levels: InkLevels, color: NDArray[np.int32], share: NDArray[np.float64], median_share: float
) -> InkLevels:
    """The levels without bleed.

    A colored cell has three black neighbours, a black cell has a red, a green and a blue one. Over black, the mean of a
    colored cell is therefore (1 - 3 b) of its level less b times the sum of the three inks' levels. The sum of the
    means is 1 - 6 b of that sum.

    Args:
        levels: with bleed.
        color: (K,) the cells' inks.
        share: (K,) b, the share of each neighbour; ``median_share`` stands for NaN.
    """
    return InkLevels(*_remove_bleed(levels, color, share, median_share))


@compiled
def _remove_bleed(levels, color, share, median_share):  # type: ignore[no-untyped-def]
    cell, slope, black = levels.cell.copy(), levels.slope.copy(), levels.black.copy()
    total, own = np.zeros(3), np.empty(cell.shape[0])
    median_share = min(median_share, MAX_BLEED)
    for ink in range(BLACK):
        for channel in range(3):
            count = 0
            for i in range(cell.shape[0]):
                if color[i] == ink:
                    own[count] = cell[i, channel]
                    count += 1
            if count > 0:
                total[channel] += np.median(own[:count]) / (1.0 - 6.0 * median_share)
    for i in range(cell.shape[0]):
        b = min(max(share[i] if np.isfinite(share[i]) else median_share, -MAX_BLEED), MAX_BLEED)
        for channel in range(3):
            cell[i, channel] = (cell[i, channel] + b * total[channel]) / (1.0 - 3.0 * b)
            slope[i, channel, 0] /= 1.0 - 3.0 * b
            slope[i, channel, 1] /= 1.0 - 3.0 * b
    for channel in range(3):
        black[channel, 0] -= median_share * total[channel]
    return InkLevels(cell, slope, black, levels.is_outlier)


@compiled
def levels_at_blur(levels, xy, cells, color, drawn_sigma, sigma):  # type: ignore[no-untyped-def]
    """``InkLevels`` that the cells' middles show with the blur ``sigma`` instead of ``drawn_sigma``, px.

    Args:
        levels: ``InkLevels`` that they show with ``drawn_sigma``.
        xy: (M, 2) px, the markers.
        cells, color: as ``cells`` and ``cell_color`` in ``Topology``.
    """
    inscribed = _inscribed_radii(xy, cells)
    size = np.nanmedian(inscribed)
    before, after = _bleed_share(size, 0.0, drawn_sigma), _bleed_share(size, 0.0, sigma)
    remainder, change = 1.0 - 6.0 * min(before, MAX_BLEED), np.empty(cells.shape[0])
    for i in range(cells.shape[0]):
        own_before = _bleed_share(inscribed[i], 0.0, drawn_sigma)
        change[i] = (_bleed_share(inscribed[i], 0.0, sigma) - own_before) / remainder
    return _remove_bleed(levels, color, change, (after - before) / remainder)
