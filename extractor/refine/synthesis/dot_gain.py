"""Cells that look larger than they are, all of them alike: their inks ran out, or the camera's response is no line.

Every gridline then lies off towards the black beside it. Around a marker where colored and black cells take turns this
cancels; at the pattern's rim it does not: an acute corner there moves outward by several times as much.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.residual_kernel import AA, AB, AC, AD, BB, BC, BD, MISFIT, C, D

MIN_GRIDLINES, MAX_GRIDLINES = 40, 250  # gridlines that do not show it, and that do
MIN_DOT_GAIN = 0.1  # of the blur, which drawings, compression and glare may feign
MIN_SINE = 0.2  # of a corner: a sharper one is moved no farther


@compiled
def measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma):  # type: ignore[no-untyped-def]
    """By how much the sides of all cells have moved outward, px; 0 where it is little, or few gridlines are seen.

    That is the median of what these show, by their sums (E, 24) and votes (E,) for moving their starts and ends.
    ``sigma`` is the blur, px.
    """
    seen, count = np.flatnonzero(sums[:, AA] > 0.0), 0
    some = seen[:: max(seen.shape[0] // MAX_GRIDLINES, 1)]
    off = np.empty(some.shape[0])
    for e in some:
        outward = _outward_sign(contrasts, edge_cells, e)
        if outward != 0.0:
            gradient = gradients.start[e] + gradients.end[e]
            off[count] = outward * gradient / (sums[e, AA] + 2.0 * sums[e, AB] + sums[e, BB])
            count += 1
    swelling = np.median(off[:count]) if count > MIN_GRIDLINES else 0.0
    return swelling if abs(swelling) > MIN_DOT_GAIN * sigma else 0.0


@compiled
def update_without_dot_gain(sums, gradients, contrasts, edge_cells, swelling):  # type: ignore[no-untyped-def]
    """(E,) px, by how much gridlines lie off towards their normal for that; it is taken out of their sums and votes, in
    place."""
    aside = np.zeros(sums.shape[0])
    if swelling == 0.0:
        return aside
    for e in range(sums.shape[0]):
        if sums[e, AA] == 0.0:
            continue
        off = swelling * _outward_sign(contrasts, edge_cells, e)
        by_a, by_b = sums[e, AA] + sums[e, AB], sums[e, AB] + sums[e, BB]
        sums[e, MISFIT] -= off * (2.0 * (gradients.start[e] + gradients.end[e]) - off * (by_a + by_b))
        gradients.start[e] -= off * by_a
        gradients.end[e] -= off * by_b
        sums[e, C] -= off * (sums[e, AC] + sums[e, BC])
        sums[e, D] -= off * (sums[e, AD] + sums[e, BD])
        aside[e] = off
    return aside


@compiled
def _outward_sign(contrasts, edge_cells, e):  # type: ignore[no-untyped-def]
    """1 where black lies on the side of a gridline's normal, -1 where it lies on the other, 0 where on neither."""
    if edge_cells[e, 0] >= 0 and edge_cells[e, 1] >= 0:
        return 0.0
    return 1.0 if contrasts[e, 0] + contrasts[e, 1] + contrasts[e, 2] > 0.0 else -1.0


@compiled
def _unit_vector(xy, m, n):  # type: ignore[no-untyped-def]
    """The unit vector from one marker to another."""
    x, y = xy[n, 0] - xy[m, 0], xy[n, 1] - xy[m, 1]
    length = np.sqrt(x * x + y * y)
    return x / length, y / length


@compiled
def markers_without_dot_gain(xy, cells, swelling):  # type: ignore[no-untyped-def]
    """(M, 2) markers that were put at the means of the corners of swollen cells (K, 3)."""
    inward, count = np.zeros_like(xy), np.zeros(xy.shape[0])
    for i in range(cells.shape[0]):
        for k in range(3):
            m = cells[i, k]
            ax, ay = _unit_vector(xy, m, cells[i, (k + 1) % 3])
            bx, by = _unit_vector(xy, m, cells[i, (k + 2) % 3])
            sine = abs(ax * by - ay * bx)
            if np.isfinite(sine):
                inward[m, 0] += swelling * (ax + bx) / max(sine, MIN_SINE)
                inward[m, 1] += swelling * (ay + by) / max(sine, MIN_SINE)
                count[m] += 1.0
    return xy + inward / np.maximum(count, 1.0).reshape(-1, 1)
