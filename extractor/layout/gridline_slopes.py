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

    def curved_at(self, edges: NDArray[np.int64], is_curved: NDArray[np.bool_]) -> SlopeWeights:
        """The weights where second derivatives count as 0 at markers that are not ``is_curved`` (M,)."""
        share = np.repeat(is_curved[edges].astype(np.float64), self.ids.shape[1] // 2, axis=1)
        shares = np.stack([np.ones_like(share), share])
        return SlopeWeights(self.ids, self.leave * shares, self.arrive * shares)


def slope_weights(
    stencil: NDArray[np.float64],
    ring_markers: NDArray[np.int32],
    edges: NDArray[np.int64],
    edge_vectors: NDArray[np.float64],
) -> SlopeWeights:
    """The weights; the arguments are ``derivative_stencil`` and others of ``Topology``."""
    x, y = edge_vectors.T
    count, width = len(edges), ring_markers.shape[1] + 1
    along = np.zeros((count, 2, 5))  # the first and the second derivative along the edge, of x, y, xx, xy, yy
    along[:, 0, :2] = edge_vectors
    along[:, 1, 2:] = np.stack([x * x, 2 * x * y, y * y], axis=1)
    ids = np.empty((count, 2 * width), np.int64)
    leave, arrive = np.zeros((2, 2, count, 2 * width))
    for at, block in enumerate((slice(0, width), slice(width, None))):
        marker = edges[:, at, None]
        ring = ring_markers[edges[:, at]]
        # a missing neighbour has no weight, whatever its id
        ids[:, block] = np.concatenate([np.where(ring >= 0, ring, marker), marker], axis=1)
        of_ring = np.moveaxis(along @ np.swapaxes(stencil[edges[:, at]], 1, 2), 1, 0)
        first, second = np.concatenate([of_ring, -of_ring.sum(axis=2, keepdims=True)], axis=2)
        (leave, arrive)[at][0, :, block] = first
        leave[1, :, block] = second * ((2.0, 1.0)[at] / -6.0)
        arrive[1, :, block] = second * ((1.0, 2.0)[at] / 6.0)
    for slopes in (leave, arrive):
        slopes[0, :, [width - 1, -1]] -= CHORD[:, None]
    return SlopeWeights(ids, leave, arrive)


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
    return native.covariance_couplings(couplings, slopes, gridlines)


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
