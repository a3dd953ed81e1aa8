"""Elimination of a marker's neighbours, one after the other, for many markers at once.

Going round the marker, a neighbour is joined to the next one and to the marker; the first one also to the last. So the
neighbour that is eliminated next is never joined to any other.

``LANES`` markers stand side by side. In ``rows`` every neighbour but the last has ``NEIGHBOUR_ROWS`` rows: its own
block as xx, xy, yy, then the blocks (2, 2) that join it to the next neighbour, to the last one and to the middle.
``tail`` has the last neighbour's own block, its block to the middle, and the middle's own block.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined, vectorized

LANES, NEIGHBOUR_ROWS, TAIL_ROWS = 32, 15, 10
MIDDLE = 7  # first row of the middle in the tail


class EliminationBlocks(NamedTuple):
    """The information matrix, prepared for the elimination of the markers around each marker.

    Attributes:
        off_diagonal: (E, 4) 1/px^2, as in ``Information``.
        losses: (E, 2, 3) 1/px^2, what the block at each end of an edge loses as xx, xy, yy when the marker at the other
            end is eliminated.
        remainders: (M, 3) 1/px^2, the markers' blocks less the losses by all of their neighbours.
        edges: (E, 2), spokes: (M, 6) as in ``Topology``.
        neighbours: (M, 6) the marker at the other end of each spoke, -1 where that edge has no information.
    """

    off_diagonal: NDArray[np.float64]
    losses: NDArray[np.float64]
    remainders: NDArray[np.float64]
    edges: NDArray[np.int32]
    spokes: NDArray[np.int32]
    neighbours: NDArray[np.int32]


class RingBuffers(NamedTuple):
    """Memory for the elimination of the rings around ``LANES`` markers.

    Attributes:
        markers, edges, blocks: (6,), (6,) and (6, 3) the neighbours of one marker, the edges to them, and their blocks.
        rows, tail: the blocks of all lanes, as the module describes them.
    """

    markers: NDArray[np.int64]
    edges: NDArray[np.int64]
    blocks: NDArray[np.float64]
    rows: NDArray[np.float64]
    tail: NDArray[np.float64]


@compiled
def allocate_ring_buffers():  # type: ignore[no-untyped-def]
    """``RingBuffers`` without content."""
    # rows beyond those of five neighbours are written when the fifth is eliminated, and not read
    rows, tail = np.empty(6 * NEIGHBOUR_ROWS * LANES), np.empty(TAIL_ROWS * LANES)
    return RingBuffers(np.empty(6, np.int64), np.empty(6, np.int64), np.empty((6, 3)), rows, tail)


@vectorized
def _update_without_first(rows, tail):  # type: ignore[no-untyped-def]
    """Eliminate the first neighbours from those after them, from the last ones and from the middles.

    A direction without positive information is left out. All rows lie at constant distances, so that the compiler
    sees that lanes do not overlap.
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
def prepare_elimination(diagonal, off_diagonal, edges, spokes):  # type: ignore[no-untyped-def]
    """``EliminationBlocks`` of an information matrix; all markers of ``edges`` must have a positive definite block."""
    losses, remainders = np.empty((edges.shape[0], 2, 3)), diagonal.copy()
    for e in range(edges.shape[0]):
        b0, b1 = off_diagonal[e, 0], off_diagonal[e, 1]
        b2, b3 = off_diagonal[e, 2], off_diagonal[e, 3]
        for side in range(2):
            n, p = edges[e, side], edges[e, 1 - side]
            px, pxy, py = diagonal[p, 0], diagonal[p, 1], diagonal[p, 2]
            inverse = 1.0 / (px * py - pxy * pxy)
            xx = (py * b0 * b0 - 2 * pxy * b0 * b1 + px * b1 * b1) * inverse
            xy = (py * b0 * b2 - pxy * (b0 * b3 + b1 * b2) + px * b1 * b3) * inverse
            yy = (py * b2 * b2 - 2 * pxy * b2 * b3 + px * b3 * b3) * inverse
            losses[e, side, 0], losses[e, side, 1], losses[e, side, 2] = xx, xy, yy
            remainders[n, 0] -= xx
            remainders[n, 1] -= xy
            remainders[n, 2] -= yy
            b1, b2 = b2, b1
    neighbours = _neighbour_markers(off_diagonal, edges, spokes)
    return EliminationBlocks(off_diagonal, losses, remainders, edges, spokes, neighbours)


@compiled
def _neighbour_markers(off_diagonal, edges, spokes):  # type: ignore[no-untyped-def]
    """(M, 6): the marker at the other end of each edge, -1 where the edge has no information."""
    out = np.full(spokes.shape, -1, np.int32)
    for m in range(spokes.shape[0]):
        for k in range(spokes.shape[1]):
            e = spokes[m, k]
            if e >= 0 and (off_diagonal[e, 0] != 0.0 or off_diagonal[e, 3] != 0.0):
                out[m, k] = edges[e, 0] + edges[e, 1] - m
    return out


@compiled
def _fill_block(rows, at, e, forward, off_diagonal):  # type: ignore[no-untyped-def]
    """Write edge e's block into four rows, from its first to its second marker if ``forward``."""
    rows[at], rows[at + 3 * LANES] = off_diagonal[e, 0], off_diagonal[e, 3]
    rows[at + LANES] = off_diagonal[e, 1 if forward else 2]
    rows[at + 2 * LANES] = off_diagonal[e, 2 if forward else 1]


@inlined
def fill_ring(m, lane, matrix, ring):  # type: ignore[no-untyped-def]
    """Write the neighbours of marker m, and the blocks that join them to each other and to the marker, into a lane.

    Args:
        m: the marker.
        lane: 0 to ``LANES`` - 1.
        matrix: ``EliminationBlocks``.
        ring: ``RingBuffers``, written; the lane must hold zeros.
    """
    off_diagonal, losses, remainders = matrix.off_diagonal, matrix.losses, matrix.remainders
    edges, spokes, neighbours = matrix.edges, matrix.spokes, matrix.neighbours
    markers, ring_edges, blocks, rows, tail = ring.markers, ring.edges, ring.blocks, ring.rows, ring.tail
    count = 0
    for i in range(spokes.shape[1]):
        n, e = neighbours[m, i], spokes[m, i]
        if n >= 0:
            side = 1 if edges[e, 0] == m else 0
            markers[count], ring_edges[count] = n, e
            for c in range(3):
                blocks[count, c] = remainders[n, c] + losses[e, side, c]
            count += 1
    last = count - 1
    for i in range(count if count > 2 else last):
        j = i + 1 if i < last else 0
        e = -1
        for c in range(spokes.shape[1]):
            if neighbours[markers[i], c] == markers[j]:
                e = spokes[markers[i], c]
        if e < 0:
            continue
        side = 0 if edges[e, 0] == markers[i] else 1
        for c in range(3):
            blocks[i, c] += losses[e, side, c]
            blocks[j, c] += losses[e, 1 - side, c]
        if j == 0:
            _fill_block(rows, 7 * LANES + lane, e, side == 1, off_diagonal)
        else:
            first_row = NEIGHBOUR_ROWS * i + (7 if j == last else 3)
            _fill_block(rows, first_row * LANES + lane, e, side == 0, off_diagonal)
    for i in range(last):
        for c in range(3):
            rows[(NEIGHBOUR_ROWS * i + c) * LANES + lane] = blocks[i, c]
        e = ring_edges[i]
        _fill_block(rows, (NEIGHBOUR_ROWS * i + 11) * LANES + lane, e, edges[e, 1] == m, off_diagonal)
    if count > 0:
        for c in range(3):
            tail[c * LANES + lane] = blocks[last, c]
        e = ring_edges[last]
        _fill_block(tail, 3 * LANES + lane, e, edges[e, 1] == m, off_diagonal)


@compiled
def update_without_ring(rows, tail):  # type: ignore[no-untyped-def]
    """Eliminate all neighbours of all lanes; the middles' own blocks remain in ``tail``."""
    for i in range(5):
        _update_without_first(rows[NEIGHBOUR_ROWS * i * LANES :], tail)
    _update_without_last(tail)
