"""The disagreement of the gridlines that meet at markers, and the variance that it shows.

A marker has two unknowns and up to six gridlines. Where noise alone moves gridlines, the squared distances between each
gridline's own place and the place that the solved markers give it add up to the degrees of freedom. Halos, clipping,
ink edges that lie beside each other, dirt and compression make them larger. The ratio, of the picture and of the
gridlines around each, multiplies the variance of the noise (the Birge ratio; Birge, Phys. Rev. 40, 207, 1932).
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled
from extractor.refine.solve.fisher_information import GridlineSystem
from extractor.refine.synthesis.gridlines import KNOWN, UX, UY
from extractor.refine.synthesis.residual_kernel import AA, AB, BB

TAIL_FREEDOM = 6.0  # degrees of freedom of the t distribution by which gridlines count for their picture
PICTURE_FREEDOM = 20.0  # by which the picture's ratio counts beside that of the gridlines around
ROUNDS = 4  # of the picture's ratio
MIN_FREEDOM = 0.1  # of a gridline
MAX_SQUARE = 1e6  # of a distance over its deviation
MIN_RATIO = 1e-3  # of variances


@compiled
def ends_at_gridline(vector, lines, edges, e):  # type: ignore[no-untyped-def]
    """The components of a vector (M, 2) along the normal of gridline e at its start and at its end."""
    nx, ny, a, b = -lines[e, UY], lines[e, UX], edges[e, 0], edges[e, 1]
    return nx * vector[a, 0] + ny * vector[a, 1], nx * vector[b, 0] + ny * vector[b, 1]


@compiled
def _squared_distances(system, gradients, shift):  # type: ignore[no-untyped-def]
    """(E,) squared distances of the gridlines' own places from those that the shifts (M, 2) give them, in units of the
    noise; 0 for gridlines without weight."""
    sums, lines, edges, out = system.sums, system.lines, system.edges, np.zeros(len(system.edges))
    for e in range(len(edges)):
        aa, ab, bb = sums[e, AA], sums[e, AB], sums[e, BB]
        determinant, weight = aa * bb - ab * ab, system.weight[e] * lines[e, KNOWN]
        if weight == 0.0 or not determinant > 1e-6 * aa * bb:
            continue
        start, end = ends_at_gridline(shift, lines, edges, e)
        left_a = gradients.start[e] - aa * start - ab * end
        left_b = gradients.end[e] - ab * start - bb * end
        square = (bb * left_a**2 - 2.0 * ab * left_a * left_b + aa * left_b**2) / determinant
        out[e] = min(weight * square / system.variance, MAX_SQUARE)
    return out


@compiled
def _degrees_of_freedom(system):  # type: ignore[no-untyped-def]
    """(E,) two of each gridline with weight, less the shares of its ends in the two unknowns of each marker."""
    sums, lines, edges, weight = system.sums, system.lines, system.edges, system.weight
    blocks, out = np.zeros((len(system.spokes), 3)), np.zeros(len(edges))
    for e in range(len(edges)):
        nx, ny, known = -lines[e, UY], lines[e, UX], weight[e] * lines[e, KNOWN]
        for side in range(2):
            m, value = edges[e, side], known * (sums[e, AA] if side == 0 else sums[e, BB])
            blocks[m, 0] += value * nx * nx
            blocks[m, 1] += value * nx * ny
            blocks[m, 2] += value * ny * ny
    for e in range(len(edges)):
        nx, ny, known = -lines[e, UY], lines[e, UX], weight[e] * lines[e, KNOWN]
        aa, ab, bb = sums[e, AA], sums[e, AB], sums[e, BB]
        if known == 0.0 or not aa * bb - ab * ab > 1e-6 * aa * bb:
            continue
        freedom = 2.0
        for side in range(2):
            m, value = edges[e, side], known * (aa if side == 0 else bb)
            xx, cross, yy = blocks[m, 0], blocks[m, 1], blocks[m, 2]
            determinant = xx * yy - cross * cross
            share = (yy * nx * nx - 2.0 * cross * nx * ny + xx * ny * ny) * value / max(determinant, 1e-12)
            freedom -= min(share, 1.0)
        out[e] = max(freedom, MIN_FREEDOM)
    return out


@compiled
def _ratio_of_picture(square, freedom):  # type: ignore[no-untyped-def]
    """The squared distances (E,) over the degrees of freedom (E,); large ones count less; and (E,) how much each
    counts."""
    ratio, count = 1.0, np.ones(len(square))
    for _ in range(ROUNDS):
        above, below = 0.0, 0.0
        for e in range(len(square)):
            count[e] = (TAIL_FREEDOM + freedom[e]) / (TAIL_FREEDOM + square[e] / ratio)
            above += count[e] * square[e]
            below += freedom[e]
        if not (above > 0.0 and below > 0.0):
            break
        ratio = above / below
    return ratio, count


@compiled
def variance_ratios(system, gradients, shift):  # type: ignore[no-untyped-def]
    """The ratio of the variance along each gridline to that of noise, by the disagreement of the gridlines around.

    Args:
        system: ``GridlineSystem``, bending eliminated from its sums.
        gradients: ``ShiftGradients``, likewise.
        shift: (M, 2) px, the solution.

    Returns:
        (E,).
    """
    edges = system.edges
    square, freedom = _squared_distances(system, gradients, shift), _degrees_of_freedom(system)
    ratio, count = _ratio_of_picture(square, freedom)
    at_square, at_freedom = np.zeros(len(system.spokes)), np.zeros(len(system.spokes))
    for e in range(len(edges)):
        for side in range(2):
            at_square[edges[e, side]] += count[e] * square[e]
            at_freedom[edges[e, side]] += freedom[e]
    out = np.empty(len(edges))
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        own_square = PICTURE_FREEDOM * ratio + at_square[a] + at_square[b] - count[e] * square[e]
        own_freedom = PICTURE_FREEDOM + at_freedom[a] + at_freedom[b] - freedom[e]
        out[e] = max(own_square / own_freedom, MIN_RATIO)
    return out


@compiled
def with_weight(system, weight):  # type: ignore[no-untyped-def]
    """The ``GridlineSystem`` with other weights (E,)."""
    lines, contrasts, edges, spokes = system.lines, system.contrasts, system.edges, system.spokes
    return GridlineSystem(system.sums, weight, lines, contrasts, edges, spokes, system.sigma, system.variance)
