"""How the slopes of gridlines depend on the markers of a layout, and what follows for their ends and their bending.

A gridline is the cubic between two markers with slopes against its chord (``gridlines``). The slopes come from the maps
at its ends, and the maps from the markers around. A marker that moves alone therefore bends the gridlines around it, at
the rim otherwise than inside, because the rim's markers have neighbours on one side only. The slopes are linear in the
markers:

    by tangents: l = d_a - c, a = d_b - c
    by second derivatives: l = -(2 k_a + k_b) / 6, a = (k_a + 2 k_b) / 6

l and a: the slopes at the start and at the end times the gridline's length. d and k: the map's first and second
derivatives along the edge, at its start (a) and end (b). c: the offset of the end less that of the start.

The steps of refinement end where the pulls of all gridlines on each marker cancel. Let B be the covariance of the pulls
by noise, and A how the pulls change with all markers, those that only bend a gridline included. The covariance of the
markers is then the sandwich C = A^-1 B A^-T (Huber, Proc. 5th Berkeley Symp. 1, 221, 1967), not the inverse of the
information J, which has only the ends of the gridlines.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import layout as native

CHORD = np.array([-1.0, 1.0])  # of the offsets of a gridline's start and end
# Of l and a in the products of the offset t (1 - t) (l (1 - t) - a t) with 1 - t and with t. Derived.
BENT_SUMS = np.array([[1 / 20, 1 / 30], [-1 / 30, -1 / 20]])
MEMBERS = 7  # a marker and its neighbours
INNER_MARKERS = 37  # whose covariances are compared with those of the outermost layers; chosen: three rings
COUPLING_ROUNDS = (
    3  # of the couplings by their covariances: the third changes them by less than 0.1 %. Chosen
)
MIN_SUM = 1e-6  # of a marker's block; derived: it only keeps a division from failing
SIDE_SUMS = (
    np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
)  # of products of straight lines along a gridline, by their ends


class SlopeWeights(NamedTuple):
    """The weights of the markers in the slopes of E gridlines, by tangents (first) and second derivatives (second).

    Attributes:
        ids: (E, K) marker ids; an id that is there twice has the sum of both weights.
        leave, arrive: (2, E, K) the weights in the slopes at the start and at the end, times the length.
    """

    ids: NDArray[np.int64]
    leave: NDArray[np.float64]
    arrive: NDArray[np.float64]


def slope_weights(
    stencil: NDArray[np.float64],
    ring_markers: NDArray[np.int32],
    edges: NDArray[np.int64],
    edge_vectors: NDArray[np.float64],
    is_curved: NDArray[np.bool_],
) -> SlopeWeights:
    """The weights; the arguments are ``derivative_stencil`` and others of ``Topology``.

    Second derivatives count as 0 at markers that are not ``is_curved`` (M,).
    """
    x, y = edge_vectors.T
    ids, first, second, chord = [], [], [], []
    for at in (0, 1):
        marker = edges[:, at]
        # a missing neighbour has no weight, whatever its id
        ring = np.where(ring_markers[marker] >= 0, ring_markers[marker], marker[:, None])
        ids.append(np.concatenate([ring, marker[:, None]], axis=1))
        weights = stencil[marker]
        first.append(_with_own(x[:, None] * weights[:, 0] + y[:, None] * weights[:, 1]))
        curved = np.stack([x * x, 2 * x * y, y * y], axis=1)
        second.append(_with_own(np.einsum("ed,edk->ek", curved, weights[:, 2:]) * is_curved[marker, None]))
        chord.append(np.zeros_like(first[at]))
        chord[at][:, -1] = CHORD[at]
    nothing, both_chords = np.zeros_like(first[0]), np.concatenate(chord, axis=1)
    leave = [
        np.concatenate([first[0], nothing], axis=1) - both_chords,
        np.concatenate([2 * second[0], second[1]], axis=1) / -6.0,
    ]
    arrive = [
        np.concatenate([nothing, first[1]], axis=1) - both_chords,
        np.concatenate([second[0], 2 * second[1]], axis=1) / 6.0,
    ]
    return SlopeWeights(np.concatenate(ids, axis=1), np.stack(leave), np.stack(arrive))


def end_couplings(slopes: SlopeWeights, edges: NDArray[np.int64]) -> NDArray[np.float64]:
    """How gridlines move with their ends, relative to straight lines between these.

    The offset from the chord, t (1 - t) (l (1 - t) - a t), is as a straight line (4 l - a) / 30 at the start and
    (l - 4 a) / 30 at the end.

    Returns:
        (E, 6) float64, three by tangents and three by second derivatives: the sum of the products with a straight line
        from 1 at the start to 0 at the end, when the start moves by 1, over that of a straight line; the same at the
        end; the mean of both when the other end moves.
    """
    moved = np.empty((2, len(edges), 2, 2))  # the straight line's ends, when an end of the edge moves
    for by in (0, 1):
        own = slopes.ids == edges[:, by, None]
        leave, arrive = ((weights * own).sum(axis=2) for weights in (slopes.leave, slopes.arrive))
        moved[..., 0, by] = (by == 0) + (4.0 * leave - arrive) / 30.0
        moved[..., 1, by] = (by == 1) + (leave - 4.0 * arrive) / 30.0
    products = SIDE_SUMS @ moved
    between = products[..., 0, 1] + products[..., 1, 0]
    couplings = 3.0 * np.stack([products[..., 0, 0], products[..., 1, 1], between], axis=2)
    return np.concatenate(list(couplings), axis=1)


class LayoutGridlines(NamedTuple):
    """The gridlines of M markers.

    Attributes:
        edges: (E, 2) marker ids. vectors: (E, 2) from start to end.
        is_seen: (E,) bool, a drawn cell is on a side of the gridline.
        spokes: (M, 6) the gridlines at each marker, -1 for none.
        is_inner: (M,) bool, both rings around the marker are complete.
    """

    edges: NDArray[np.int64]
    vectors: NDArray[np.float64]
    is_seen: NDArray[np.bool_]
    spokes: NDArray[np.int32]
    is_inner: NDArray[np.bool_]


def covariance_couplings(
    couplings: NDArray[np.float64], slopes: SlopeWeights, gridlines: LayoutGridlines
) -> NDArray[np.float64]:
    """The ``end_couplings`` (E, 6) with which the inverse of the information is the covariance of the outermost layers.

    Inside the pattern the inverse of the information is everywhere the same multiple of the sandwich, and all
    variances are scaled by the disagreement of the gridlines. At the rim the inverse is smaller, by a fifth of the
    variance. There, the couplings of the gridlines' own ends are divided by that. Both covariances are computed with
    equally strong gridlines, and with the markers beyond the neighbours held in place, which changes their ratio by
    1 %.
    """
    inner, rim = np.flatnonzero(gridlines.is_inner)[:INNER_MARKERS], np.flatnonzero(~gridlines.is_inner)
    if len(inner) == 0:
        return couplings
    found = couplings.copy()
    inside, outside = (_Neighbourhoods(which, slopes, gridlines) for which in (inner, rim))
    for way in (0, 1):
        own = found[:, 3 * way : 3 * way + 3]
        usual = np.einsum("rij,rji->r", inside.sandwich[way], np.linalg.inv(inside.inverse(own))).mean() / 2
        needed = outside.along_normals(outside.sandwich[way]) / usual
        for _ in range(COUPLING_ROUNDS):
            outside.scale_own_ends(own, outside.along_normals(outside.inverse(own)) / needed)
    return found


class _Neighbourhoods:
    """R markers, each with its neighbours: seven members, the marker first.

    Attributes:
        sandwich: (2, R, 2, 2) the covariances of the markers, by tangents and by second derivatives.
    """

    def __init__(self, which: NDArray[np.int64], slopes: SlopeWeights, gridlines: LayoutGridlines) -> None:
        edges, spokes = gridlines.edges, gridlines.spokes.astype(np.int64)
        own, known = spokes[which], spokes[which] >= 0
        others = np.where(known, edges[own].sum(axis=2) - which[:, None], -1)
        members = np.concatenate([which[:, None], others], axis=1)
        self._spokes, self._is_known = own, known
        self._lines = lines = np.where((members >= 0)[..., None], spokes[members], -1)  # (R, 7, 6)
        self._side = side = (edges[lines, 1] == members[..., None]).astype(np.int64)
        across = np.stack([-gridlines.vectors[:, 1], gridlines.vectors[:, 0]], axis=1)
        length = np.linalg.norm(across, axis=1)
        self._normals = normals = across / length[:, None]
        strength = np.where(lines >= 0, (length * gridlines.is_seen)[lines], 0.0)
        self._pulls = strength[..., None, None] * normals[lines][..., :, None] * normals[lines][..., None, :]
        other = edges[lines, 1 - side]
        self._own = np.broadcast_to(np.eye(MEMBERS)[:, None], (*lines.shape, MEMBERS))
        self._other = (other[..., None] == members[:, None, None]).astype(np.float64)
        straight = self._own / 3 + self._other / 6
        spread = self._system(straight)
        is_member = (slopes.ids[lines][..., None] == members[:, None, None, None]).astype(np.float64)
        by_end = np.einsum("se,swnk->wenk", BENT_SUMS, np.stack([slopes.leave, slopes.arrive]))
        self.sandwich = np.empty((2, len(which), 2, 2))
        for way in (0, 1):
            bent = (by_end[way, side, lines][..., None, :] @ is_member)[..., 0, :]
            response = np.linalg.inv(self._system(straight + bent))
            self.sandwich[way] = (response @ spread @ np.swapaxes(response, 1, 2))[:, :2, :2]

    def inverse(self, couplings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(R, 2, 2) the markers' blocks of the inverse of the information with couplings (E, 3)."""
        own = np.take_along_axis(couplings[self._lines], self._side[..., None], axis=3)
        between = couplings[self._lines, 2][..., None]
        blocks = self._system(own * self._own / 3 + between * self._other / 6)
        return np.asarray(np.linalg.inv(blocks)[:, :2, :2], np.float64)

    def along_normals(self, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """(R, 6) the variances along the normals of the markers' gridlines, of covariances (R, 2, 2)."""
        across = self._normals[self._spokes]
        return np.asarray(np.einsum("rki,rij,rkj->rk", across, covariance, across))

    def scale_own_ends(self, couplings: NDArray[np.float64], factor: NDArray[np.float64]) -> None:
        """Multiply the couplings (E, 3) of the gridlines' ends at the markers by factors (R, 6)."""
        known, side = self._is_known, self._side[:, 0]
        couplings[self._spokes[known], side[known]] *= factor[known]

    def _system(self, pulls: NDArray[np.float64]) -> NDArray[np.float64]:
        """(R, 14, 14) the sums over the gridlines of pulls (R, 7, 6, 7) of members on members."""
        blocks = np.einsum("rmkn,rmkij->rminj", pulls, self._pulls, optimize=True)
        size = 2 * MEMBERS
        return np.asarray(blocks.reshape(-1, size, size) + MIN_SUM * np.eye(size))


def scatter_bending(
    slopes: SlopeWeights,
    edges: NDArray[np.int64],
    edge_vectors: NDArray[np.float64],
    spokes: NDArray[np.int32],
) -> NDArray[np.float64]:
    """How independent scatter of the markers bends the gridlines, where cells keep straight sides.

    The b (``gridline_bending``) of a gridline is half of the difference of its slopes. The gridlines at a marker bend
    together, because their slopes come from the same markers, and move the marker by the b that suits all of them best.
    The variance is that of gridlines which bend each by itself and move it as much.

    Returns:
        (E, 3) float64, over the variance of the scatter: the variance of b by tangents, its covariance with the b by
        second derivatives, and the variance of the latter; means of both ends.
    """
    normals = np.stack([-edge_vectors[:, 1], edge_vectors[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    weights = 0.5 * (slopes.leave - slopes.arrive)
    at_markers: NDArray[np.float64] = native.scatter_bending(slopes.ids, weights, normals, spokes)
    return np.asarray(at_markers[edges].mean(axis=1))


def _with_own(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weights of differences from a marker to its ring (E, K), and that of the marker itself (E, K + 1)."""
    return np.concatenate([weights, -weights.sum(axis=1, keepdims=True)], axis=1)
