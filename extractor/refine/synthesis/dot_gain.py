"""Dot gain: all cells look larger than they are, by the same width, as inks run out or the camera is not linear.

Every gridline then lies off towards the black beside the gridline. Around a marker where colored and black cells
alternate this cancels. At the pattern's rim it does not: an acute corner there moves outward by several widths.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.residual_kernel import AA, AB, AC, AD, BB, BC, BD, MISFIT, C, D

MIN_GRIDLINES, MAX_GRIDLINES = 40, 250  # gridlines that the dot gain is measured from
MIN_DOT_GAIN = 0.1  # in units of the blur; drawings, compression and glare look like less
MIN_SINE = 0.2  # of the angle of a corner; a sharper corner moves no farther


@compiled
def measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma):  # type: ignore[no-untyped-def]
    """The dot gain: the median shift outward of the sides of cells at the pattern's rim.

    Args:
        sums: (E, 24), as ``accumulate_residual_sums`` gives them.
        gradients: ``ShiftGradients``.
        contrasts: (E, 3) gray levels.
        edge_cells: (E, 2) the drawn cells on both sides, -1 for none.
        sigma: px, the blur.

    Returns:
        px; 0 where the shift is small, or few gridlines were read.
    """
    read, count = np.flatnonzero(sums[:, AA] > 0.0), 0
    some = read[:: max(read.shape[0] // MAX_GRIDLINES, 1)]
    off = np.empty(some.shape[0])
    for e in some:
        outward = _outward_sign(contrasts, edge_cells, e)
        if outward != 0.0:
            gradient = gradients.start[e] + gradients.end[e]
            off[count] = outward * gradient / (sums[e, AA] + 2.0 * sums[e, AB] + sums[e, BB])
            count += 1
    dot_gain = np.median(off[:count]) if count > MIN_GRIDLINES else 0.0
    return dot_gain if abs(dot_gain) > MIN_DOT_GAIN * sigma else 0.0


@compiled
def update_without_dot_gain(sums, gradients, contrasts, edge_cells, dot_gain):  # type: ignore[no-untyped-def]
    """Remove a dot gain, px, from the gridlines' sums (E, 24) and gradients, in place.

    Returns:
        (E,) px, the shift of each gridline along its normal by the dot gain.
    """
    shift = np.zeros(sums.shape[0])
    if dot_gain == 0.0:
        return shift
    for e in range(sums.shape[0]):
        if sums[e, AA] == 0.0:
            continue
        off = dot_gain * _outward_sign(contrasts, edge_cells, e)
        by_a, by_b = sums[e, AA] + sums[e, AB], sums[e, AB] + sums[e, BB]
        sums[e, MISFIT] -= off * (2.0 * (gradients.start[e] + gradients.end[e]) - off * (by_a + by_b))
        gradients.start[e] -= off * by_a
        gradients.end[e] -= off * by_b
        sums[e, C] -= off * (sums[e, AC] + sums[e, BC])
        sums[e, D] -= off * (sums[e, AD] + sums[e, BD])
        shift[e] = off
    return shift


@compiled
def _outward_sign(contrasts, edge_cells, e):  # type: ignore[no-untyped-def]
    """1 where black lies on the side of gridline e's normal, -1 where on the other side, 0 where on neither."""
    if edge_cells[e, 0] >= 0 and edge_cells[e, 1] >= 0:
        return 0.0
    return 1.0 if contrasts[e, 0] + contrasts[e, 1] + contrasts[e, 2] > 0.0 else -1.0


@compiled
def _unit_vector(xy, m, n):  # type: ignore[no-untyped-def]
    """x and y of the unit vector from marker m to marker n."""
    x, y = xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1]
    length = np.sqrt(x * x + y * y)
    return x / length, y / length


@compiled
def markers_without_dot_gain(xy, cells, dot_gain):  # type: ignore[no-untyped-def]
    """(M, 2) px: markers ``xy``, which are means of the corners of the enlarged cells (K, 3), moved back inward."""
    inward, count = np.zeros_like(xy), np.zeros(xy.shape[0])
    for i in range(cells.shape[0]):
        for k in range(3):
            m = cells[i, k]
            ax, ay = _unit_vector(xy, m, cells[i, (k + 1) % 3])
            bx, by = _unit_vector(xy, m, cells[i, (k + 2) % 3])
            sine = abs(ax * by - ay * bx)
            if np.isfinite(sine):
                inward[m, 0] += dot_gain * (ax + bx) / max(sine, MIN_SINE)
                inward[m, 1] += dot_gain * (ay + by) / max(sine, MIN_SINE)
                count[m] += 1.0
    return xy + inward / np.maximum(count, 1.0).reshape(-1, 1)
