"""When steps by synthesis end: which markers still move, the cost of another step, and the remaining error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined_no_refcount

TYPICAL_EDGE_PX = 10.0  # edge for which a step has the effort 1
MAX_LINEAR_BLUR = 0.06  # of an edge; with more blur the drawing responds to a shift less linearly
REMAINING_SHARE = 1.0  # of a step, per blur, that another step would still correct
MAX_REMAINING_SHARE = 0.5  # of a step, at most
# Where blur is wide a step leaves as much of a usual one as the square of blur over edge, times
WIDE_BLUR_REMAINDER = 20.0
MAX_DIRTY_WEIGHT = 0.72  # mean weight of the gridlines at moving markers, below which dirt moves them,
# if at this share of all markers the gridlines have less than that weight, so that the markers are covered.
MIN_COVERED_SHARE, MAX_COVERED_WEIGHT = 0.04, 0.3
MEAN_OVER_MEDIAN = 1.44  # of squares


class ConvergenceRule(NamedTuple):
    """When a marker counts as moving, and how many markers another step may draw again.

    Attributes:
        converged_blur_share: the least step of a moving marker, as a share of the blur.
        sigma: the blur, px.
        converged_deviations: the least step of a moving marker, in standard deviations.
        max_moving_share: share of all markers that may still move at the end.
        max_partial_share: share of all markers; twice as many with their neighbours may be drawn again.
        max_partial_share_in_dirt: share of all markers that may be drawn again where dirt moves them.
        explained: the drawing explains the image elsewhere.
    """

    converged_blur_share: float
    sigma: float
    converged_deviations: float
    max_moving_share: float
    max_partial_share: float
    max_partial_share_in_dirt: float
    explained: bool


class UnconvergedMarkers(NamedTuple):
    """The markers that another step should move.

    Attributes:
        redrawn: (M,) bool, the markers to draw again.
        moving: number of moving markers; 0 where no more than ``max_moving_share`` of all move.
        by_dirt: dirt moves them.
    """

    redrawn: NDArray[np.bool_]
    moving: int
    by_dirt: bool


def step_effort(size_px: float, share: float | None = None) -> float:
    """The cost of a step in units of a step from everything with edges of ``TYPICAL_EDGE_PX``.

    Args:
        size_px: the usual edge, px.
        share: of the markers that are drawn again; None for a step from everything.
    """
    pixels = min((size_px / TYPICAL_EDGE_PX) ** 2, 4.0)
    return 0.45 + 0.55 * pixels if share is None else 0.25 + 0.6 * share * pixels


@compiled
def unconverged_markers(measured, drawn, normalized_steps, rule, weight, spokes, edges):  # type: ignore[no-untyped-def]
    """The markers that another step should move.

    A marker moves if its distance from where it is drawn exceeds ``converged_blur_share`` of the blur (less between
    short gridlines) and ``converged_deviations``. Its neighbours are drawn again with it, unless they are together more
    than twice ``max_partial_share`` and no more than that share move. Where dirt moves more than ``max_partial_share``
    with their neighbours, only the ``max_partial_share_in_dirt`` that move the farthest are drawn again; where these
    are more than twice that share, none if the drawing explains the image elsewhere, else all.

    Args:
        measured, drawn: (M, 2) px, where the markers are measured and drawn.
        normalized_steps: (M,) the last step in standard deviations.
        rule: ``ConvergenceRule``.
        weight: (E,) 0 to 1, of the gridlines.
        spokes, edges: (M, 6) and (E, 2), as in ``Topology``.

    Returns:
        ``UnconvergedMarkers``.
    """
    count = drawn.shape[0]
    max_partial = rule.max_partial_share * count
    square, found = np.zeros(count), 0
    for m in range(count):
        if not normalized_steps[m] > rule.converged_deviations:
            continue
        edge = _shortest_gridline(m, drawn, spokes, edges)
        least = rule.converged_blur_share * min(rule.sigma, (MAX_LINEAR_BLUR * edge) ** 2 / rule.sigma)
        dx, dy = measured[m, 0] - drawn[m, 0], measured[m, 1] - drawn[m, 1]
        if dx * dx + dy * dy > least * least:
            square[m] = dx * dx + dy * dy
            found += 1
    if found <= rule.max_moving_share * count:
        return UnconvergedMarkers(np.zeros(count, np.bool_), 0, False)
    moving = square > 0.0
    redrawn, dirty = moving.copy(), _is_moved_by_dirt(moving, weight, spokes)
    add_neighbours(moving, edges, redrawn)
    touched = int(np.count_nonzero(redrawn))
    if touched <= max_partial or (found > max_partial and not dirty):
        return UnconvergedMarkers(redrawn, found, dirty)
    if dirty and touched > 2 * max_partial:
        if rule.explained:
            return UnconvergedMarkers(np.zeros(count, np.bool_), 0, dirty)
        return UnconvergedMarkers(redrawn, found, dirty)
    if dirty:
        rest = max(count - int(rule.max_partial_share_in_dirt * count), 1)
        return UnconvergedMarkers(square > np.partition(square, rest - 1)[rest - 1], found, dirty)
    return UnconvergedMarkers(moving if touched > 2 * max_partial else redrawn, found, dirty)


@inlined_no_refcount
def _shortest_gridline(m, xy, spokes, edges):  # type: ignore[no-untyped-def]
    """The length of the shortest gridline at marker m, px; infinite where none is known."""
    square = np.inf
    for k in range(spokes.shape[1]):
        e = spokes[m, k]
        if e >= 0:
            dx, dy = xy[edges[e, 0], 0] - xy[edges[e, 1], 0], xy[edges[e, 0], 1] - xy[edges[e, 1], 1]
            own = dx * dx + dy * dy
            square = own if own < square else square
    return np.sqrt(square)


@compiled
def _is_moved_by_dirt(moving, weight, spokes):  # type: ignore[no-untyped-def]
    """Whether the gridlines at ``moving`` markers (M,) have little weight (E,), and those at some markers nearly
    none."""
    total, count, covered = 0.0, 0, 0
    for m in range(spokes.shape[0]):
        own, known = 0.0, 0
        for e in spokes[m]:
            if e >= 0:
                own += weight[e]
                known += 1
        covered += own < MAX_COVERED_WEIGHT * known
        if moving[m]:
            total += own
            count += known
    return total < MAX_DIRTY_WEIGHT * count and covered > MIN_COVERED_SHARE * spokes.shape[0]


@compiled
def bent_share(bend, limit):  # type: ignore[no-untyped-def]
    """The share of gridlines whose bending (E, 2), px, exceeds a limit, px."""
    count = 0
    for e in range(bend.shape[0]):
        count += max(abs(bend[e, 0]), abs(bend[e, 1])) > limit
    return count / bend.shape[0]


@compiled
def median_deviation(diagonal):  # type: ignore[no-untyped-def]
    """The markers' median standard deviation, px, given all other markers.

    ``diagonal``: (M, 3) 1/px^2, as in ``Information``.
    """
    return np.sqrt(2.0 / np.median(diagonal[:, 0] + diagonal[:, 2]))


@compiled
def convergence_covariance(shift, sigma, remaining_share):  # type: ignore[no-untyped-def]
    """The covariance of the error that the last step left.

    The drawing responds less than linearly to shifts of the size of the blur.

    Args:
        shift: (M, 2) px, the last step.
        sigma: the blur, px.
        remaining_share: share of a usual step that is left in any case.

    Returns:
        (M, 2, 2) px^2.
    """
    out, square = np.zeros((shift.shape[0], 2, 2)), np.empty(shift.shape[0])
    for m in range(shift.shape[0]):
        x, y = shift[m, 0], shift[m, 1]
        square[m] = x * x + y * y
        share = min(REMAINING_SHARE * np.sqrt(square[m]) / sigma, MAX_REMAINING_SHARE)
        out[m, 0, 0], out[m, 1, 1] = (share * x) ** 2, (share * y) ** 2
        out[m, 0, 1] = out[m, 1, 0] = share * share * x * y
    if remaining_share > 0.0:
        variance = 0.5 * min(remaining_share, 1.0) ** 2 * MEAN_OVER_MEDIAN * np.nanmedian(square)
        out[:, 0, 0] += variance
        out[:, 1, 1] += variance
    return out


@compiled
def add_neighbours(selected, edges, out):  # type: ignore[no-untyped-def]
    """Add the markers with a gridline to a selected one (M,) bool to ``out`` (M,) bool."""
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        out[a] |= selected[b]
        out[b] |= selected[a]


@compiled
def groups_with_any(selected, groups):  # type: ignore[no-untyped-def]
    """(G,) bool, the groups (G, n) of markers that contain a selected one (M,) bool."""
    out = np.zeros(groups.shape[0], np.bool_)
    for g in range(groups.shape[0]):
        for k in range(groups.shape[1]):
            out[g] |= selected[groups[g, k]]
    return out
