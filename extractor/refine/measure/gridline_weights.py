"""What a step of refinement needs beside its votes: whom to trust, what changed, and how far the markers moved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.gridlines import KNOWN, LENGTH, UX, UY, X, Y
from extractor.refine.synthesis.ink_levels import fill_monomials
from extractor.refine.synthesis.residual_kernel import (
    AA,
    AB,
    BB,
    BLUR,
    BLUR_CURVATURE,
    MISFIT,
    PIXELS,
    READ_AA,
    READ_BB,
    SHARE_A,
    SHARE_B,
    A,
    B,
)

SHORTEST_RARITY = 100  # one in so many gridlines is shorter than what is called a short edge
MIN_NOISE = 0.3  # grey levels; rounding alone makes 0.29
PRIOR_HIDDEN_PX = 1.0  # how far a marker beyond the pattern's known part may be drawn by nothing
MIN_INFORMATION_SHARE = (
    0.04  # of the usual information, below which a marker does not guide its neighbours' gridlines; at the
)
# pattern's rim, unless believed and known so well: there the map through those on one side knows less
RIM_DEVIATION_PX = 0.05
MIN_CLEAN_SHARE = 0.68  # of the gridlines look as the pattern does, where their noise is that of all
MIN_OFFSET_WEIGHT = 0.4  # of a gridline, for its places to be measured
MIN_MARKER_WEIGHT = 0.3  # of the gridlines around a marker, for it to be believed if its neighbours agree
# An error of contrast looks like one of blur: the integral of z g (N - 1/2) over that of (z g)^2 up to BAND, g the
# normal density and N its integral.
CONTRAST_TO_BLUR = 1.79


class ShiftGradients(NamedTuple):
    """Gradients of the log-likelihood by shifts of the gridlines' ends, times the noise's variance.

    Attributes:
        start, end: (E,) gray levels^2 / px, by a shift of the start and of the end along the normal (-uy, ux).
        level_shift: (E,) gray levels^2, the change of the levels of both sides together times the contrast; 0 where
            levels stay as they are.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    level_shift: NDArray[np.float64]


@compiled
def chord_midpoints(lines):  # type: ignore[no-untyped-def]
    """(E, 2) the middle of each gridline's chord."""
    out = np.empty((lines.shape[0], 2))
    for e in range(lines.shape[0]):
        half = 0.5 * lines[e, LENGTH]
        out[e, 0], out[e, 1] = lines[e, X] + half * lines[e, UX], lines[e, Y] + half * lines[e, UY]
    return out


@compiled
def shift_gradients(sums, contrasts, edge_cells, change, middle, frame):  # type: ignore[no-untyped-def]
    """The gradients by shifts of the gridlines' ends: of the residual less the part that new levels explain.

    Args:
        sums: (E, 24), as ``accumulate_residual_sums`` gives them.
        contrasts: (E, 3) gray levels.
        edge_cells: (E, 2) the drawn cells on both sides, -1 for none.
        change: ``LevelChange`` since the pattern was drawn.
        middle: (E, 2) px, the middles of the chords.
        frame: ``PolynomialFrame`` of the black polynomial.

    Returns:
        ``ShiftGradients``.
    """
    count = sums.shape[0]
    start, end, level_shift = np.zeros(count), np.zeros(count), np.zeros(count)
    terms = np.empty(change.black.shape[1])
    for e in range(count):
        if sums[e, AA] == 0.0:
            continue
        fill_monomials((middle[e, 0] - frame.x) / frame.scale, (middle[e, 1] - frame.y) / frame.scale, terms)
        for channel in range(3):
            both_sides = 0.0
            for k in range(terms.shape[0]):
                both_sides += 2.0 * terms[k] * change.black[channel, k]
            for side in range(2):
                if edge_cells[e, side] >= 0:
                    both_sides += change.cell[edge_cells[e, side], channel]
            level_shift[e] += contrasts[e, channel] * both_sides
        start[e] = sums[e, A] - level_shift[e] * sums[e, SHARE_A]
        end[e] = sums[e, B] - level_shift[e] * sums[e, SHARE_B]
    return ShiftGradients(start, end, level_shift)


@compiled
def gridline_misfits(sums, gradients, values, least):  # type: ignore[no-untyped-def]
    """(E,) the mean squared residual of gridlines once they are moved, a place; NaN where there are no more than
    ``min_places`` places, each of which adds so many ``values``."""
    out = np.full(sums.shape[0], np.nan)
    for e in range(sums.shape[0]):
        if sums[e, PIXELS] <= least:
            continue
        aa, ab, bb = sums[e, AA], sums[e, AB], sums[e, BB]
        determinant = max(aa * bb - ab * ab, 1e-9 * (aa + bb) ** 2 + 1e-12)
        start, end = gradients.start[e], gradients.end[e]
        explained = (bb * start**2 - 2 * ab * start * end + aa * end**2) / determinant
        out[e] = max(sums[e, MISFIT] - explained, 0.0) / (values * sums[e, PIXELS] - 2)
    return out


@compiled
def misfit_weights(sums, misfit, usual, pardon, values, unjudged):  # type: ignore[no-untyped-def]
    """(E,) weights, 1 for gridlines whose ``misfit`` (E,) is not more than the ``median_misfit`` one may be by
    chance, or their
    ``pardon`` (E,); ``default_weight`` for what was read but has none."""
    use = np.zeros(sums.shape[0])
    for e in range(sums.shape[0]):
        if np.isfinite(misfit[e]):
            limit = max(usual * (1.25 + 5 * np.sqrt(2 / (values * sums[e, PIXELS] - 2))), pardon[e])
            use[e] = min(1.0, limit / max(misfit[e], 1e-12)) ** 2
        else:
            use[e] = unjudged if sums[e, AA] > 0.0 else 0.0
    return use


@compiled
def median_of_misfits(misfit):  # type: ignore[no-untyped-def]
    """The median of those that were judged; NaN where none was."""
    judged = misfit[np.isfinite(misfit)]
    return max(np.median(judged), MIN_NOISE**2) if judged.shape[0] > 0 else np.nan


@compiled
def _noise_from_misfits(misfit, use, usual):  # type: ignore[no-untyped-def]
    """The noise by the gridlines' misfit (E,), the ``median_misfit`` one, and how far they are in ``weight`` (E,);
    NaN where none
    was judged."""
    sound = misfit[use == 1.0]
    if (
        0 < sound.shape[0] < MIN_CLEAN_SHARE * np.count_nonzero(np.isfinite(misfit))
    ):  # what is dirty is no noise
        return np.sqrt(max(np.median(sound), MIN_NOISE**2))
    return np.sqrt(usual)


@compiled
def weigh_gridlines(sums, gradients, pardon, values, least, unjudged):  # type: ignore[no-untyped-def]
    """(E,) weights, 1 for gridlines that look as the pattern does once they are moved; their usual misfit, and
    the noise (NaN where nothing was read).

    Each of a gridline's places adds so many ``values``; one with no more than ``min_places`` places gets
    ``default_weight``; a
    misfit of less than its ``pardon`` (E,) is always forgiven.
    """
    misfit = gridline_misfits(sums, gradients, values, least)
    usual = median_of_misfits(misfit)
    use = misfit_weights(sums, misfit, usual, pardon, values, unjudged)
    return use, usual, _noise_from_misfits(misfit, use, usual)


@compiled
def _is_well_weighted(use, spokes, m):  # type: ignore[no-untyped-def]
    """Whether enough of the gridlines that end at a marker are trusted."""
    total, count = 0.0, 0
    for k in range(spokes.shape[1]):
        e = spokes[m, k]
        if e >= 0:
            total += use[e]
            count += 1
    return total > MIN_MARKER_WEIGHT * count


@compiled
def well_weighted_markers(use, spokes):  # type: ignore[no-untyped-def]
    """(M,) bool: enough of the gridlines that end there are trusted."""
    out = np.zeros(spokes.shape[0], np.bool_)
    for m in range(spokes.shape[0]):
        out[m] = _is_well_weighted(use, spokes, m)
    return out


@compiled
def short_edges(xy, edges, rare, usual):  # type: ignore[no-untyped-def]
    """The lengths in px that all gridlines exceed but for one in ``rare``, and but for one in ``median_misfit``,
    which are
    fewer; 0 without any."""
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
    least, some = count // rare, count // usual
    short = np.partition(length[:count], some)[: some + 1]
    return np.sqrt(np.partition(short, least)[least]), np.sqrt(short[some])


@compiled
def median_edge(xy, edges):  # type: ignore[no-untyped-def]
    """The median length of the gridlines, px; 1 without any."""
    return max(short_edges(xy, edges, 2, 2)[1], 1.0)


@compiled
def blur_change(sums, aside, use, before, now, sigma):  # type: ignore[no-untyped-def]
    """By how much the gridlines' pixels say that the blur is larger, their contrasts (E, 3) corrected to ``now``.

    What lies ``dot_gain_offset`` (E,), px, of where it is drawn looks more blurred, by half the square of that over
    the blur.
    """
    curvature, pull = 0.0, 0.0
    for e in range(sums.shape[0]):
        if use[e] == 0.0:
            continue
        strength, change = 1e-9, 0.0
        for channel in range(3):
            strength += before[e, channel] ** 2
            change += before[e, channel] * (now[e, channel] - before[e, channel])
        weight = use[e] * sums[e, BLUR_CURVATURE]
        curvature += weight
        pull += use[e] * sums[e, BLUR] + CONTRAST_TO_BLUR * sigma * weight * change / strength
        pull -= weight * 0.5 * aside[e] ** 2 / sigma
    return pull / curvature if curvature > 0.0 else 0.0


@compiled
def least_information(sums, use, lines, edges, variance, count):  # type: ignore[no-untyped-def]
    """(M,) 1/px^2, the least information about a marker in any direction, were its gridlines' bending known."""
    xx, cross, yy = np.zeros(count), np.zeros(count), np.zeros(count)
    for e in range(edges.shape[0]):
        nx, ny, weight = -lines[e, UY], lines[e, UX], use[e] * lines[e, KNOWN] / variance
        for side in range(2):
            m, value = edges[e, side], weight * (sums[e, READ_AA] if side == 0 else sums[e, READ_BB])
            xx[m] += value * nx * nx
            cross[m] += value * nx * ny
            yy[m] += value * ny * ny
    return 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + cross**2)


@compiled
def normalized_step_lengths(step, diagonal, beyond):  # type: ignore[no-untyped-def]
    """(M,) how far each marker stepped in standard deviations with all others known; 0 for those ``beyond``."""
    out = np.zeros(step.shape[0])
    for m in range(step.shape[0]):
        xx, cross, yy = diagonal[m, 0], diagonal[m, 1], diagonal[m, 2]
        dx, dy = step[m, 0], step[m, 1]
        if not beyond[m]:
            out[m] = np.sqrt(max(dx * dx * xx + 2 * dx * dy * cross + dy * dy * yy, 0.0))
    return out


@compiled
def markers_after_shift(xy, shift, least, use, spokes):  # type: ignore[no-untyped-def]
    """(M, 2) the markers after a step, and the same with NaN where the image hardly shows them (``min_places``, as
    ``least_information``
    gives it)."""
    count = xy.shape[0]
    measured, guiding = np.empty((count, 2)), np.empty((count, 2))
    seen = least[least > 3 * PRIOR_HIDDEN_PX**-2]
    limit = MIN_INFORMATION_SHARE * np.median(seen) if seen.shape[0] > 0 else np.inf
    for m in range(count):
        measured[m, 0], measured[m, 1] = xy[m, 0] + shift[m, 0], xy[m, 1] + shift[m, 1]
        weak = least[m] < limit
        if weak and spokes[m, spokes.shape[1] - 1] < 0 and least[m] > RIM_DEVIATION_PX**-2:
            weak = not _is_well_weighted(use, spokes, m)
        guiding[m, 0] = np.nan if weak else measured[m, 0]
        guiding[m, 1] = np.nan if weak else measured[m, 1]
    return measured, guiding


@compiled
def pattern_box(xy, margin, width, height):  # type: ignore[no-untyped-def]
    """(4,) x from, y from, x to, y to: the pattern's part of the image."""
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
