"""A marker and its ring of neighbours: the neighbours eliminated one after the other, for many markers at once.

Once around the marker, a neighbour is joined to the next one and to the marker, the first also to the last: while they
are eliminated in turn, nobody else is ever joined to the one whose turn it is.

``LANES`` markers stand side by side. In ``rows`` every neighbour but the last has ``NEIGHBOUR_ROWS`` rows of them:
its own
block as xx, xy, yy, then the blocks (2, 2) that join it to the next one, to the last one and to the middle. ``tail``
has the last one's own, to the middle, and the middle's own.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined, vectorized

LANES, NEIGHBOUR_ROWS, TAIL_ROWS = 32, 15, 10
MIDDLE = 7  # its first row in the tail


@vectorized
def _update_without_first(rows, tail):  # type: ignore[no-untyped-def]
    """Eliminate the first neighbours from those after them, from the last ones and from the middles.

    A direction without positive information is left out. All rows lie at constant distances, so that the compiler
    sees that lanes do not meet.
    """
    for k in range(LANES):
        xx, xy, yy = rows[k], rows[k + LANES], rows[k + 2 * LANES]
        ua, ub, va, vb = rows[k + 3 * LANES], rows[k + 4 * LANES], rows[k + 5 * LANES], rows[k + 6 * LANES]
        uc, ud, vc, vd = rows[k + 7 * LANES], rows[k + 8 * LANES], rows[k + 9 * LANES], rows[k + 10 * LANES]
        ue, uf, ve, vf = (
            rows[k + 11 * LANES],
            rows[k + 12 * LANES],
            rows[k + 13 * LANES],
            rows[k + 14 * LANES],
        )
        first = 1.0 / xx if xx > 0.0 else 0.0
        share = xy * first
        rest = yy - xy * share
        second = 1.0 / rest if rest > 0.0 else 0.0
        va, vb, vc = va - share * ua, vb - share * ub, vc - share * uc
        vd, ve, vf = vd - share * ud, ve - share * ue, vf - share * uf
        fa, fb, fc, fd, fe, ff = first * ua, first * ub, first * uc, first * ud, first * ue, first * uf
        ga, gb, gc, gd, ge, gf = second * va, second * vb, second * vc, second * vd, second * ve, second * vf
        n = k + NEIGHBOUR_ROWS * LANES
        rows[n] -= fa * ua + ga * va
        rows[n + LANES] -= fa * ub + ga * vb
        rows[n + 2 * LANES] -= fb * ub + gb * vb
        rows[n + 7 * LANES] -= fa * uc + ga * vc
        rows[n + 8 * LANES] -= fa * ud + ga * vd
        rows[n + 9 * LANES] -= fb * uc + gb * vc
        rows[n + 10 * LANES] -= fb * ud + gb * vd
        rows[n + 11 * LANES] -= fa * ue + ga * ve
        rows[n + 12 * LANES] -= fa * uf + ga * vf
        rows[n + 13 * LANES] -= fb * ue + gb * ve
        rows[n + 14 * LANES] -= fb * uf + gb * vf
        tail[k] -= fc * uc + gc * vc
        tail[k + LANES] -= fc * ud + gc * vd
        tail[k + 2 * LANES] -= fd * ud + gd * vd
        tail[k + 3 * LANES] -= fc * ue + gc * ve
        tail[k + 4 * LANES] -= fc * uf + gc * vf
        tail[k + 5 * LANES] -= fd * ue + gd * ve
        tail[k + 6 * LANES] -= fd * uf + gd * vf
        tail[k + 7 * LANES] -= fe * ue + ge * ve
        tail[k + 8 * LANES] -= fe * uf + ge * vf
        tail[k + 9 * LANES] -= ff * uf + gf * vf


@vectorized
def _update_without_last(tail):  # type: ignore[no-untyped-def]
    """Eliminate the last neighbours from the middles."""
    for k in range(LANES):
        xx, xy, yy = tail[k], tail[k + LANES], tail[k + 2 * LANES]
        ue, uf, ve, vf = tail[k + 3 * LANES], tail[k + 4 * LANES], tail[k + 5 * LANES], tail[k + 6 * LANES]
        first = 1.0 / xx if xx > 0.0 else 0.0
        share = xy * first
        rest = yy - xy * share
        second = 1.0 / rest if rest > 0.0 else 0.0
        ve, vf = ve - share * ue, vf - share * uf
        tail[k + 7 * LANES] -= first * ue * ue + second * ve * ve
        tail[k + 8 * LANES] -= first * ue * uf + second * ve * vf
        tail[k + 9 * LANES] -= first * uf * uf + second * vf * vf


@compiled
def eliminated_blocks(diagonal, beside, edges):  # type: ignore[no-untyped-def]
    """(E, 2, 3): what the block at each end of an edge loses as xx, xy, yy when the marker at the other is eliminated;
    and (M, 3) the blocks without what all their neighbours take."""
    lost, left = np.empty((edges.shape[0], 2, 3)), diagonal.copy()
    for e in range(edges.shape[0]):
        b0, b1, b2, b3 = beside[e, 0], beside[e, 1], beside[e, 2], beside[e, 3]
        for side in range(2):
            n, p = edges[e, side], edges[e, 1 - side]
            px, pxy, py = diagonal[p, 0], diagonal[p, 1], diagonal[p, 2]
            inverse = 1.0 / (px * py - pxy * pxy)
            xx = (py * b0 * b0 - 2 * pxy * b0 * b1 + px * b1 * b1) * inverse
            xy = (py * b0 * b2 - pxy * (b0 * b3 + b1 * b2) + px * b1 * b3) * inverse
            yy = (py * b2 * b2 - 2 * pxy * b2 * b3 + px * b3 * b3) * inverse
            lost[e, side, 0], lost[e, side, 1], lost[e, side, 2] = xx, xy, yy
            left[n, 0] -= xx
            left[n, 1] -= xy
            left[n, 2] -= yy
            b1, b2 = b2, b1
    return lost, left


@compiled
def neighbour_markers(beside, edges, spokes):  # type: ignore[no-untyped-def]
    """(M, 6): the marker at the other end of each edge, -1 where the edge tells nothing."""
    out = np.full(spokes.shape, -1, np.int32)
    for m in range(spokes.shape[0]):
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and (beside[e, 0] != 0.0 or beside[e, 3] != 0.0):
                out[m, k] = edges[e, 0] + edges[e, 1] - m
    return out


@compiled
def _fill_block(rows, at, e, forward, beside):  # type: ignore[no-untyped-def]
    """Write edge e's block into four rows, seen from its first marker if ``forward``."""
    rows[at], rows[at + 3 * LANES] = beside[e, 0], beside[e, 3]
    rows[at + LANES], rows[at + 2 * LANES] = beside[e, 1 if forward else 2], beside[e, 2 if forward else 1]


@inlined
def fill_ring(m, k, lost, left, beside, edges, spokes, others, ring, spoke, own, rows, tail):  # type: ignore[no-untyped-def]
    """Write the neighbours of marker m, and what joins them to each other and to it, into lane k."""
    count = 0
    for i in range(spokes.shape[1]):
        n, e = others[m, i], spokes[m, i]
        if n >= 0:
            side = 1 if edges[e, 0] == m else 0
            ring[count], spoke[count] = n, e
            for c in range(3):
                own[count, c] = left[n, c] + lost[e, side, c]
            count += 1
    last = count - 1
    for i in range(count if count > 2 else last):
        j = i + 1 if i < last else 0
        e = -1
        for c in range(spokes.shape[1]):
            if others[ring[i], c] == ring[j]:
                e = spokes[ring[i], c]
        if e < 0:
            continue
        side = 0 if edges[e, 0] == ring[i] else 1
        for c in range(3):
            own[i, c] += lost[e, side, c]
            own[j, c] += lost[e, 1 - side, c]
        if j == 0:
            _fill_block(rows, 7 * LANES + k, e, side == 1, beside)
        else:
            _fill_block(
                rows, (NEIGHBOUR_ROWS * i + (7 if j == last else 3)) * LANES + k, e, side == 0, beside
            )
    for i in range(last):
        for c in range(3):
            rows[(NEIGHBOUR_ROWS * i + c) * LANES + k] = own[i, c]
        _fill_block(rows, (NEIGHBOUR_ROWS * i + 11) * LANES + k, spoke[i], edges[spoke[i], 1] == m, beside)
    if count > 0:
        for c in range(3):
            tail[c * LANES + k] = own[last, c]
        _fill_block(tail, 3 * LANES + k, spoke[last], edges[spoke[last], 1] == m, beside)


@compiled
def update_without_ring(rows, tail):  # type: ignore[no-untyped-def]
    """What is left of the middles' own blocks, in place."""
    for i in range(5):
        _update_without_first(rows[NEIGHBOUR_ROWS * i * LANES :], tail)
    _update_without_last(tail)
