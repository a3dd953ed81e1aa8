"""Between numbering and refinement: every marker's place, agreed upon by the cells that meet there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .gradients import gradients
from .numbering import Numbering
from .tables import Lattice

MAX_CORNER_MISFIT = 0.2  # between a triangle's corner and where the cell's neighbours put it, in edges
MAX_SPREAD = 0.3  # how far a corner may lie from the mean of its marker's, in edges
# Where most cells are sharp enough for triangles, one without is damaged and its edges are not the pattern's, unless
# it is only cut off by the image's border.
SHARP_SHARE = 0.6
BORDER_PX = 3.0
PREDICTED_WEIGHT = 0.05  # of a corner that the neighbours' centers put there, beside one of a fitted triangle


@dataclass(frozen=True, eq=False)
class Places:
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the mean of the corners, NaN where there is none or they disagree.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN where there is none.
        cells: (C, 3) int32, marker ids of the numbered cells' corners.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    cells: NDArray[np.int32]


def place(cells: Cells, numbering: Numbering, lattice: Lattice, size: tuple[int, int]) -> Places:
    """Merge the corners of each marker (eqs. 4 and 5: at most one red, green and blue, no farther apart than L).

    A cell's corners are those of its triangle where that lies as its neighbours say, else where they say. A marker
    whose triangles lie apart has a wrong one among them and is lost.

    Args:
        size: width and height of the image.
    """
    slope = gradients(cells.center_px, numbering.cell, lattice)
    here = np.flatnonzero(np.isfinite(slope[:, 0, 0]))
    ids = lattice.corner_ids[numbering.cell[here]]
    arms = lattice.marker_mm[ids] - lattice.center_mm[numbering.cell[here], None]
    predicted = cells.center_px[here, None] + np.einsum("nij,nkj->nki", slope[here], arms)
    edge = np.linalg.norm(predicted - np.roll(predicted, 1, axis=1), axis=2).mean(axis=1)
    corner, fitted = _matched(cells.corner_px[here], predicted, edge, numbering.mirrored)
    weight = np.repeat(np.where(fitted, 1.0, PREDICTED_WEIGHT), 3)
    count = len(lattice.marker_mm)
    xy, around = _means(ids.reshape(-1), corner.reshape(-1, 2), np.repeat(edge, 3), weight, count)
    apart = np.linalg.norm(corner - xy[ids], axis=2) > MAX_SPREAD * around[ids]
    xy[ids[apart & fitted[:, None]]] = np.nan
    whole = np.isfinite(xy[ids, 0]).all(axis=1)
    if fitted.mean() > SHARP_SHARE:
        limit = np.array(size) - 1 - BORDER_PX
        cut = ((predicted < BORDER_PX) | (predicted > limit)).any(axis=(1, 2))
        whole &= fitted | cut
    return Places(xy_px=xy, edge_px=around, cells=ids[whole])


def _matched(
    corner: NDArray[np.float64], predicted: NDArray[np.float64], edge: NDArray[np.float64], mirrored: bool
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(N, 3, 2) the triangles' corners as corners 0, 1, 2 of the cell, and where a triangle matched at all.

    Clockwise in the image the cell's corners run 0, 2, 1, seen from the back 0, 1, 2.
    """
    turned = corner if mirrored else corner[:, ::-1]
    options = np.stack([np.roll(turned, shift, axis=1) for shift in range(3)], axis=1)
    apart = options - predicted[:, None]
    misfit = np.hypot(apart[..., 0], apart[..., 1]).max(axis=2)
    best = np.where(np.isfinite(misfit), misfit, np.inf).argmin(axis=1)
    row = np.arange(len(corner))
    fitted = misfit[row, best] < MAX_CORNER_MISFIT * edge
    return np.where(fitted[:, None, None], options[row, best], predicted), fitted


def _means(
    ids: NDArray[np.int32],
    xy: NDArray[np.float64],
    edge: NDArray[np.float64],
    weight: NDArray[np.float64],
    count: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted means of the corners and edges of each marker, NaN where it has none."""
    total = np.bincount(ids, weights=weight, minlength=count)
    sums = [np.bincount(ids, weights=weight * v, minlength=count) for v in (xy[:, 0], xy[:, 1], edge)]
    with np.errstate(invalid="ignore"):
        x, y, around = (s / total for s in sums)
    return np.stack([x, y], axis=1), around
