"""The Fisher information matrix of the markers, its sparse solution and the diagonal blocks of its inverse.

A marker's block adds up all gridlines that end there. Along a gridline the derivatives are weighted by 1 - t and t; the
sums over its pixels are measured. Near a marker the gridlines share their pixels (`shared_pixels.hpp`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import solve as native


class Information(NamedTuple):
    """Blocks of the information matrix, 1/px^2.

    Attributes:
        diagonal: (M, 3) xx, xy, yy of every marker.
        off_diagonal: (E, 4) xx, xy, yx, yy from an edge's smaller to its larger marker.
    """

    diagonal: NDArray[np.float64]
    off_diagonal: NDArray[np.float64]


def solve_shifts(
    diagonal: NDArray[np.float64],
    off_diagonal: NDArray[np.float64],
    edges: NDArray[np.int32],
    right: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The shifts of the markers, by conjugate gradients preconditioned with the diagonal blocks.

    The descent ends early where the whole matrix is not positive definite.

    Args:
        diagonal: (M, 3) 1/px^2, positive definite blocks.
        off_diagonal: (E, 4) 1/px^2.
        edges: (E, 2) the markers that each off-diagonal block joins.
        right: (M, 2) 1/px, the gradient.

    Returns:
        (M, 2) px.
    """
    blocks, right = (
        (np.ascontiguousarray(diagonal), np.ascontiguousarray(off_diagonal)),
        np.ascontiguousarray(right),
    )
    return native.solve_shifts(*blocks, edges, right, right)


def covariances(
    diagonal: NDArray[np.float64],
    off_diagonal: NDArray[np.float64],
    edges: NDArray[np.int32],
    spokes: NDArray[np.int32],
    min_information: float,
    selected: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """The markers' covariances: diagonal blocks of the inverse, from each marker and its neighbours.

    The markers beyond the neighbours are eliminated one by one, as if they were not connected to each other, then the
    neighbours.

    Args:
        diagonal, off_diagonal: (M, 3) and (E, 4) 1/px^2, as in ``Information``.
        edges, spokes: (E, 2) and (M, 6), as in ``Topology``.
        min_information: 1/px^2, below which a marker counts as unknown.
        selected: (M,) bool, the markers to compute.

    Returns:
        (M, 2, 2) px^2, NaN where nothing is known and where not selected.
    """
    blocks = np.ascontiguousarray(diagonal), np.ascontiguousarray(off_diagonal)
    return native.covariances(*blocks, edges, spokes, min_information, selected)
