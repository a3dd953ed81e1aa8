"""Gradients by shifts of the gridlines, the gridlines' weights by their misfit, and the markers after a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.gridlines import KNOWN, UX, UY
from extractor.refine.synthesis.residual_kernel import (
    A_BLUR,
    AA,
    AB,
    B_BLUR,
    BB,
    BLUR,
    BLUR_CURVATURE,
    C_BLUR,
    D_BLUR,
    MISFIT,
    PIXELS,
    READ_AA,
    READ_BB,
    A,
    B,
    C,
    D,
)

SHORTEST_RARITY = 100  # one in so many gridlines is shorter than a short edge
MIN_NOISE = 0.3  # gray levels; rounding alone makes 0.29
PRIOR_HIDDEN_PX = 1.0  # prior deviation of a hidden marker from its prediction
# A marker with less than this share of the median information does not guide its neighbours' gridlines. At the rim, a
# marker with enough weight and a smaller deviation than this does: the map of markers on one side only is less precise.
MIN_INFORMATION_SHARE = 0.04
RIM_DEVIATION_PX = 0.05
MIN_CLEAN_SHARE = 0.68  # of the gridlines with weight 1, from which on the noise is that of all gridlines
MIN_OFFSET_WEIGHT = 0.4  # of a gridline, for its offsets to be measured
MIN_MARKER_WEIGHT = 0.3  # mean weight of the gridlines at a marker, for the marker to count
MIN_SIGMA_PX = 0.4  # blur with the pixel; the bare pixel has 0.29
MAX_BLUR_CHANGE = 0.3  # of the blur, in one step


class GridlineWeights(NamedTuple):
    """The weights of the gridlines.

    Attributes:
        weight: (E,) 0 to 1.
        median_misfit: gray levels^2, NaN where nothing was read.
        noise: gray levels, NaN where nothing was read.
    """

    weight: NDArray[np.float64]
    median_misfit: float
    noise: float


class ShiftGradients(NamedTuple):
    """Gradients of the log-likelihood by shifts of the gridlines' ends, times the noise's variance.

    Attributes:
        start, end: (E,) gray levels^2 / px, by a shift of the start and of the end along the normal (-uy, ux).
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]


@compiled
def gridline_misfits(sums, gradients, values, min_places):  # type: ignore[no-untyped-def]
    """The misfit of the gridlines: the mean squared residual once their ends are moved.

    Args:
        sums: (E, 24). gradients: ``ShiftGradients``.
        values: of each place, 3 for a pixel and 1 for a sample along the contrast.
        min_places: a gridline with no more places has no misfit.

    Returns:
        (E,) gray levels^2; NaN where there is none.
    """
    out = np.full(sums.shape[0], np.nan)
    for e in range(sums.shape[0]):
        if sums[e, PIXELS] <= min_places:
            continue
        aa, ab, bb = sums[e, AA], sums[e, AB], sums[e, BB]
        determinant = max(aa * bb - ab * ab, 1e-9 * (aa + bb) ** 2 + 1e-12)
        start, end = gradients.start[e], gradients.end[e]
        explained = (bb * start**2 - 2 * ab * start * end + aa * end**2) / determinant
        out[e] = max(sums[e, MISFIT] - explained, 0.0) / (values * sums[e, PIXELS] - 2)
    return out


@compiled
def misfit_weights(sums, misfit, median_misfit, tolerance, values, default_weight):  # type: ignore[no-untyped-def]
    """The weights of gridlines by their misfit.

    Args:
        sums: (E, 24). misfit: (E,) gray levels^2, NaN for none.
        median_misfit: gray levels^2, of gridlines that look like the pattern.
        tolerance: (E,) gray levels^2, a misfit that does not lower the weight.
        values: of each place.
        default_weight: of gridlines that were read but have no misfit.

    Returns:
        (E,) 0 to 1; 1 where the misfit is below the tolerance or explained by chance.
    """
    weight = np.zeros(sums.shape[0])
    for e in range(sums.shape[0]):
        if np.isfinite(misfit[e]):
            by_chance = median_misfit * (1.25 + 5 * np.sqrt(2 / (values * sums[e, PIXELS] - 2)))
            limit = max(by_chance, tolerance[e])
            weight[e] = min(1.0, limit / max(misfit[e], 1e-12)) ** 2
        else:
            weight[e] = default_weight if sums[e, AA] > 0.0 else 0.0
    return weight


@compiled
def median_of_misfits(misfit):  # type: ignore[no-untyped-def]
    """gray levels^2, the median of the misfits (E,) that are not NaN; NaN without any."""
    known = misfit[np.isfinite(misfit)]
    return max(np.median(known), MIN_NOISE**2) if known.shape[0] > 0 else np.nan


@compiled
def _noise_from_misfits(misfit, weight, median_misfit):  # type: ignore[no-untyped-def]
    """The noise in gray levels, from the gridlines' misfits (E,), their weights (E,) and the median misfit; NaN where
    that is NaN."""
    clean = misfit[weight == 1.0]
    if 0 < clean.shape[0] < MIN_CLEAN_SHARE * np.count_nonzero(np.isfinite(misfit)):  # dirt is not noise
        return np.sqrt(max(np.median(clean), MIN_NOISE**2))
    return np.sqrt(median_misfit)


@compiled
def weigh_gridlines(sums, gradients, tolerance, values, min_places, default_weight):  # type: ignore[no-untyped-def]
    """The weights of gridlines, 1 for those that look like the pattern once their ends are moved.

    Args: as in ``gridline_misfits`` and ``misfit_weights``.

    Returns:
        ``GridlineWeights``.
    """
    misfit = gridline_misfits(sums, gradients, values, min_places)
    median_misfit = median_of_misfits(misfit)
    weight = misfit_weights(sums, misfit, median_misfit, tolerance, values, default_weight)
    return GridlineWeights(weight, median_misfit, _noise_from_misfits(misfit, weight, median_misfit))


@compiled
def _is_well_weighted(weight, spokes, m):  # type: ignore[no-untyped-def]
    """Whether the gridlines at marker m have enough weight (E,)."""
    total, count = 0.0, 0
    for k in range(spokes.shape[1]):
        e = spokes[m, k]
        if e >= 0:
            total += weight[e]
            count += 1
    return total > MIN_MARKER_WEIGHT * count


@compiled
def well_weighted_markers(weight, spokes):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers whose gridlines have enough weight (E,)."""
    out = np.zeros(spokes.shape[0], np.bool_)
    for m in range(spokes.shape[0]):
        out[m] = _is_well_weighted(weight, spokes, m)
    return out


@compiled
def short_edges(xy, edges, rarity, other_rarity):  # type: ignore[no-untyped-def]
    """Two lengths, px, that all edges exceed but for one in ``rarity``, and but for one in ``other_rarity``.

    ``other_rarity`` is not greater than ``rarity``. 0 and 0 without any known edge.
    """
    length, count = np.empty(edges.shape[0]), 0
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        dx, dy = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
        own = dx * dx + dy * dy
        if np.isfinite(own):
            length[count] = own
            count += 1
    if count == 0:
        return 0.0, 0.0
    few, some = count // rarity, count // other_rarity
    short = np.partition(length[:count], some)[: some + 1]
    return np.sqrt(np.partition(short, few)[few]), np.sqrt(short[some])


@compiled
def median_edge(xy, edges):  # type: ignore[no-untyped-def]
    """The median length of the edges (E, 2), px; 1 without any."""
    return max(short_edges(xy, edges, 2, 2)[1], 1.0)


@compiled
def blur_change(sums, gridline_weight):  # type: ignore[no-untyped-def]
    """The change of the blur, px, that the gridlines' pixels ask for, once the ends of each gridline are moved.

    ``sums`` (E, 24); ``gridline_weight`` (E,) 0 to 1.
    """
    curvature, pull = 0.0, 0.0
    for e in range(sums.shape[0]):
        if gridline_weight[e] == 0.0 or sums[e, AA] == 0.0:
            continue
        aa, ab, bb, az, bz = sums[e, AA], sums[e, AB], sums[e, BB], sums[e, A_BLUR], sums[e, B_BLUR]
        determinant = max(aa * bb - ab * ab, 1e-9 * (aa + bb) ** 2 + 1e-12)
        by_a, by_b = (bb * az - ab * bz) / determinant, (aa * bz - ab * az) / determinant
        curvature += gridline_weight[e] * (sums[e, BLUR_CURVATURE] - by_a * az - by_b * bz)
        pull += gridline_weight[e] * (sums[e, BLUR] - by_a * sums[e, A] - by_b * sums[e, B])
    return pull / curvature if curvature > 0.0 else 0.0


@compiled
def blur_after_step(sigma, change):  # type: ignore[no-untyped-def]
    """The blur, px, where gridlines show a ``change``, px, of the drawn blur ``sigma``, px."""
    return max(sigma + min(max(change, -MAX_BLUR_CHANGE * sigma), MAX_BLUR_CHANGE * sigma), MIN_SIGMA_PX)


@compiled
def update_for_blur(sums, gradients, change):  # type: ignore[no-untyped-def]
    """Take a change of the blur, px, out of the sums (E, 24) and the ``ShiftGradients``, in place."""
    for e in range(sums.shape[0]):
        gradients.start[e] -= change * sums[e, A_BLUR]
        gradients.end[e] -= change * sums[e, B_BLUR]
        sums[e, C] -= change * sums[e, C_BLUR]
        sums[e, D] -= change * sums[e, D_BLUR]
        sums[e, MISFIT] -= change * (2.0 * sums[e, BLUR] - change * sums[e, BLUR_CURVATURE])


@compiled
def least_information(sums, weight, lines, edges, variance, count):  # type: ignore[no-untyped-def]
    """(M,) 1/px^2, the information about each of ``count`` markers in its worst direction, with bending taken as known.

    ``sums`` (E, 24), ``weight`` (E,), ``lines`` (E, 8), ``edges`` (E, 2); ``variance`` of the noise, gray levels^2.
    """
    xx, cross, yy = np.zeros(count), np.zeros(count), np.zeros(count)
    for e in range(edges.shape[0]):
        nx, ny, factor = -lines[e, UY], lines[e, UX], weight[e] * lines[e, KNOWN] / variance
        for side in range(2):
            m, value = edges[e, side], factor * (sums[e, READ_AA] if side == 0 else sums[e, READ_BB])
            xx[m] += value * nx * nx
            cross[m] += value * nx * ny
            yy[m] += value * ny * ny
    return 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + cross**2)


@compiled
def markers_after_shift(xy, shift, information, weight, spokes):  # type: ignore[no-untyped-def]
    """The markers after a step.

    Args:
        xy: (M, 2) px. shift: (M, 2) px.
        information: (M,) 1/px^2, as ``least_information`` gives it.
        weight: (E,) 0 to 1. spokes: as in ``Topology``.

    Returns:
        (M, 2) px, the markers; the same with NaN for markers with little information.
    """
    count = xy.shape[0]
    measured, reliable = np.empty((count, 2)), np.empty((count, 2))
    informed = information[information > 3 * PRIOR_HIDDEN_PX**-2]
    limit = MIN_INFORMATION_SHARE * np.median(informed) if informed.shape[0] > 0 else np.inf
    for m in range(count):
        measured[m, 0], measured[m, 1] = xy[m, 0] + shift[m, 0], xy[m, 1] + shift[m, 1]
        weak = information[m] < limit
        if weak and spokes[m, spokes.shape[1] - 1] < 0 and information[m] > RIM_DEVIATION_PX**-2:
            weak = not _is_well_weighted(weight, spokes, m)
        reliable[m, 0] = np.nan if weak else measured[m, 0]
        reliable[m, 1] = np.nan if weak else measured[m, 1]
    return measured, reliable


@compiled
def pattern_box(xy, margin, width, height):  # type: ignore[no-untyped-def]
    """(4,) px, x from, y from, x to, y to: the part of the image with the pattern and a margin, px.

    ``xy`` (M, 2) px, NaN where unknown; zeros where no marker is known.
    """
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for m in range(xy.shape[0]):
        if np.isfinite(xy[m, 0]):
            for axis in range(2):
                low[axis], high[axis] = min(low[axis], xy[m, axis]), max(high[axis], xy[m, axis])
    box, size = np.zeros(4, np.int64), (width, height)
    if low[0] <= high[0]:
        for axis in range(2):
            box[axis] = int(min(max(np.floor(low[axis] - margin), 0.0), size[axis]))
            box[2 + axis] = int(min(max(np.ceil(high[axis] + margin) + 1, 0.0), size[axis]))
    return box
