"""When steps by synthesis end: what still moves, what another step costs, and what is left where there is none."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined_no_refcount

TYPICAL_EDGE_PX = 10.0
MAX_LINEAR_BLUR = 0.06  # of an edge; what is more blurred answers less simply to a shift
REMAINING_SHARE, MAX_REMAINING_SHARE = (
    1.0,
    0.5,
)  # of a step, per blur, that another step would still correct; and at most
# Where blur is wide a step leaves as much of a usual one as the square of blur over edge, times
WIDE_BLUR_REMAINDER = 20.0
MAX_DIRTY_WEIGHT = (
    0.72  # mean trust in the gridlines at markers that move, below which it is dirt that moves them,
)
# where this share of all markers is hidden: their gridlines are trusted by less than
MIN_COVERED_SHARE, MAX_COVERED_WEIGHT = 0.04, 0.3
MEAN_OVER_MEDIAN = 1.44  # a mean of squares against their median


def step_effort(size_px: float, share: float | None = None) -> float:
    """What a step costs, 1 for everything with edges of ``TYPICAL_EDGE_PX``: from everything, or around a share of
    it."""
    pixels = min((size_px / TYPICAL_EDGE_PX) ** 2, 4.0)
    return 0.45 + 0.55 * pixels if share is None else 0.25 + 0.6 * share * pixels


@compiled
def unconverged_markers(  # type: ignore[no-untyped-def]
    measured, drawn, strides, near, sigma, resolved, enough, few, many, most, explained, use, spokes, edges
):
    """(M,) bool, the markers to draw anew; how many move or are beside those that do, none where no more than
    ``max_moving_share``
    (a share of all) move; and whether it is dirt that moves them.

    Those move that are more than ``near``, a share of the blur ``sigma``, and ``converged_deviations`` deviations
    from where they are
    drawn; but no marker with a gridline of which the blur is more than the share ``resolved``: what is so small is
    hardly read better from elsewhere. With them go those beside them, unless these are more than twice
    ``max_partial_share``, but no
    more than that move. Where it is dirt that moves them, once these are more than ``max_partial_share``, only those
    go that move
    the farthest, at most the share ``max_partial_share_in_dirt``, and once these are more than twice as many, none,
    if the drawing has
    ``explained`` the image elsewhere.
    """
    count = drawn.shape[0]
    far, found = np.zeros(count), 0
    for m in range(count):
        if not strides[m] > enough:
            continue
        edge = _shortest_gridline(m, drawn, spokes, edges)
        least = near * min(sigma, (MAX_LINEAR_BLUR * edge) ** 2 / sigma)
        dx, dy = measured[m, 0] - drawn[m, 0], measured[m, 1] - drawn[m, 1]
        if dx * dx + dy * dy > least * least and not sigma > resolved * edge:
            far[m] = dx * dx + dy * dy
            found += 1
    if found <= few * count:
        return np.zeros(count, np.bool_), 0, False
    moving = far > 0.0
    out, dirty = moving.copy(), _is_moved_by_dirt(moving, use, spokes)
    add_neighbours(moving, edges, out)
    touched = np.sum(out)
    if touched <= many * count or (found > many * count and not dirty):
        return out, touched, dirty
    if dirty and touched > 2 * many * count:
        return (np.zeros(count, np.bool_), 0, dirty) if explained else (out, touched, dirty)
    if dirty:
        rest = max(count - int(most * count), 1)
        return far > np.partition(far, rest - 1)[rest - 1], touched, dirty
    return moving if touched > 2 * many * count else out, touched, dirty


@inlined_no_refcount
def _shortest_gridline(m, xy, spokes, edges):  # type: ignore[no-untyped-def]
    """The length of the shortest gridline at a marker, px; infinite where none is known."""
    square = np.inf
    for k in range(spokes.shape[1]):
        e = spokes[m, k]
        if e >= 0:
            dx, dy = xy[edges[e, 0], 0] - xy[edges[e, 1], 0], xy[edges[e, 0], 1] - xy[edges[e, 1], 1]
            own = dx * dx + dy * dy
            square = own if own < square else square
    return np.sqrt(square)


@compiled
def _is_moved_by_dirt(moving, use, spokes):  # type: ignore[no-untyped-def]
    """Whether the gridlines (E,) at the markers that are ``moving`` (M,) are little trusted, and those at some markers
    hardly at all."""
    total, count, hidden = 0.0, 0, 0
    for m in range(spokes.shape[0]):
        own, known = 0.0, 0
        for e in spokes[m]:
            if e >= 0:
                own += use[e]
                known += 1
        hidden += own < MAX_COVERED_WEIGHT * known
        if moving[m]:
            total += own
            count += known
    return total < MAX_DIRTY_WEIGHT * count and hidden > MIN_COVERED_SHARE * spokes.shape[0]


@compiled
def bent_share(bend, limit):  # type: ignore[no-untyped-def]
    """The share of gridlines that bend (E, 2) by more than a limit, px."""
    many = 0
    for e in range(bend.shape[0]):
        many += max(abs(bend[e, 0]), abs(bend[e, 1])) > limit
    return many / bend.shape[0]


@compiled
def median_deviation(diagonal):  # type: ignore[no-untyped-def]
    """The markers' median standard deviation, px, by their blocks of the information (M, 3), all others known."""
    return np.sqrt(2.0 / np.median(diagonal[:, 0] + diagonal[:, 2]))


@compiled
def convergence_covariance(shift, sigma, slow):  # type: ignore[no-untyped-def]
    """(M, 2, 2) px^2, what the last step may have left of a ``shift`` (M, 2) from where the markers are drawn: the
    drawing answers to shifts of the size of the blur as it would to smaller ones. A share ``slow`` of a usual one is
    left in any case."""
    out, square = np.zeros((shift.shape[0], 2, 2)), np.empty(shift.shape[0])
    for m in range(shift.shape[0]):
        x, y = shift[m, 0], shift[m, 1]
        square[m] = x * x + y * y
        share = min(REMAINING_SHARE * np.sqrt(square[m]) / sigma, MAX_REMAINING_SHARE)
        out[m, 0, 0], out[m, 1, 1] = (share * x) ** 2, (share * y) ** 2
        out[m, 0, 1] = out[m, 1, 0] = share * share * x * y
    if slow > 0.0:
        usual = 0.5 * min(slow, 1.0) ** 2 * MEAN_OVER_MEDIAN * np.nanmedian(square)
        out[:, 0, 0] += usual
        out[:, 1, 1] += usual
    return out


@compiled
def add_neighbours(which, edges, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (M,) the markers with a gridline to one of ``gridlines`` (M,)."""
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        out[a] |= which[b]
        out[b] |= which[a]


@compiled
def groups_with_any(which, groups):  # type: ignore[no-untyped-def]
    """(G,) bool, the groups (G, n) of markers with one of ``gridlines`` (M,) among them."""
    out = np.zeros(groups.shape[0], np.bool_)
    for g in range(groups.shape[0]):
        for k in range(groups.shape[1]):
            out[g] |= which[groups[g, k]]
    return out
