"""What blur brings into the middles of cells from their neighbours: taken out of the levels, or put back.

A level is the mean of a disc in the middle of its cell. Each of the three neighbours has a share in that, by how far
the disc lies from the side between them, in units of the blur.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.refine.synthesis.ink_levels import BLACK, InkLevels, cell_radii, disc_radius

MAX_BLEED = 0.1  # of a neighbour in a cell's mean that can be made good
MIN_BLEED = 0.002  # of a neighbour, which makes no difference;
MIN_BLEED_CHANGE = 0.0003  # nor does so much more or less


@compiled
def bleed_shares(xy, cells, sigma, assumed):  # type: ignore[no-untyped-def]
    """(K,) what the blur ``sigma`` makes of each neighbour in a cell's mean, as ``cell_means`` takes it with another
    blur ``assumed``, NaN where the cell is not known; and the median of that."""
    inscribed = _inscribed_radii(xy, cells)
    out = np.empty(cells.shape[0])
    for i in range(cells.shape[0]):
        out[i] = _bleed_share(inscribed[i], assumed, sigma)
    return out, np.nanmedian(out)


@compiled
def _inscribed_radii(xy, cells):  # type: ignore[no-untyped-def]
    """(K,) the radius of each cell's inscribed circle, NaN where the cell is not known."""
    out = np.empty(cells.shape[0])
    for i in range(cells.shape[0]):
        out[i] = cell_radii(xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]], 0.0)[0]
    return out


@inlined_no_refcount
def _bleed_share(inscribed, assumed, sigma):  # type: ignore[no-untyped-def]
    """What a blur makes of each neighbour in the mean of one cell's disc, which is taken with another blur assumed."""
    radius = disc_radius(inscribed, assumed)
    # a disc's pixels have a quarter of its radius squared for their variance in one direction
    return 0.5 * math.erfc(inscribed / np.sqrt(2.0 * (sigma * sigma + 0.25 * radius * radius)))


def remove_bleed(
    levels: InkLevels, color: NDArray[np.int32], share: NDArray[np.float64], usual: float
) -> InkLevels:
    """The levels that means show in which each neighbour has a ``share`` (K,), ``median_misfit`` where it is not known.

    A colored cell has three black neighbours, a black one a red, a green and a blue one. So the means differ by
    (1 - 3 b) of the levels less b of their sum over the inks, which is 1 - 6 b of what it seems.
    """
    cell, slope, black = _remove_bleed(levels.cell, levels.slope, levels.black, color, share, usual)
    return levels._replace(cell=cell, slope=slope, black=black)


@compiled
def _remove_bleed(cell, slope, black, color, share, usual):  # type: ignore[no-untyped-def]
    cell, slope, black = cell.copy(), slope.copy(), black.copy()
    total, own = np.zeros(3), np.empty(cell.shape[0])
    usual = min(usual, MAX_BLEED)
    for ink in range(BLACK):
        for channel in range(3):
            count = 0
            for i in range(cell.shape[0]):
                if color[i] == ink:
                    own[count] = cell[i, channel]
                    count += 1
            if count > 0:
                total[channel] += np.median(own[:count]) / (1.0 - 6.0 * usual)
    for i in range(cell.shape[0]):
        bleeding = min(max(share[i] if np.isfinite(share[i]) else usual, -MAX_BLEED), MAX_BLEED)
        for channel in range(3):
            cell[i, channel] = (cell[i, channel] + bleeding * total[channel]) / (1.0 - 3.0 * bleeding)
            slope[i, channel, 0] /= 1.0 - 3.0 * bleeding
            slope[i, channel, 1] /= 1.0 - 3.0 * bleeding
    for channel in range(3):
        black[channel, 0] -= usual * total[channel]
    return cell, slope, black


def adapt_levels_to_blur(
    levels: InkLevels, xy: NDArray[np.float64], mesh: Topology, drawn: float, sigma: float
) -> InkLevels:
    """The levels that the cells' middles would have shown, had the blur not been ``drawn`` but ``sigma``, px."""
    inks = levels.cell, levels.slope, levels.black
    differ, cell, slope, black = _adapt_levels_to_blur(*inks, mesh.cell_color, xy, mesh.cells, drawn, sigma)
    return levels._replace(cell=cell, slope=slope, black=black) if differ else levels


@compiled
def _adapt_levels_to_blur(cell, slope, black, color, xy, cells, drawn, sigma):  # type: ignore[no-untyped-def]
    """Whether that is so much that it matters, and the cells' levels, slopes and the black's polynomial."""
    inscribed = _inscribed_radii(xy, cells)
    size = np.nanmedian(inscribed)
    usual, more = _bleed_share(size, 0.0, drawn), _bleed_share(size, 0.0, sigma)
    if max(usual, more) < MIN_BLEED or abs(more - usual) < MIN_BLEED_CHANGE:
        return False, cell, slope, black
    left, change = 1.0 - 6.0 * min(usual, MAX_BLEED), np.empty(cells.shape[0])
    for i in range(cells.shape[0]):
        change[i] = (_bleed_share(inscribed[i], 0.0, sigma) - _bleed_share(inscribed[i], 0.0, drawn)) / left
    return (True, *_remove_bleed(cell, slope, black, color, change, (more - usual) / left))
