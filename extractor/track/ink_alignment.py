"""The alignment of predicted cells to the image: every cell moves to the centroid of its ink nearby."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import track as native
from extractor.track.warm_tables import WarmTables

LARGE_SHIFT = 0.2  # in edges; after a larger shift the window is moved and the shift measured again. Chosen
RESTING_SHIFT = 0.02  # of a cell from the frame before, in edges, up to which the cell rests; chosen


class AlignedMarkers(NamedTuple):
    """Predicted markers after their cells were moved onto the image.

    Attributes:
        xy_px: (M, 2) float64, NaN where the shifts of the cells disagree or are unknown.
        max_shift: the largest shift of a cell, in edges.
        edge_px: (M,) float64, the mean edge of the cells at each marker.
    """

    xy_px: NDArray[np.float64]
    max_shift: float
    edge_px: NDArray[np.float64]


def align_to_inks(
    image: NDArray[np.uint8],
    predicted_px: NDArray[np.float64],
    tables: WarmTables,
    levels_before: NDArray[np.float64],
    shift_before: NDArray[np.float64],
) -> AlignedMarkers:
    """The markers moved to the places of their cells' inks, in at most two passes.

    Blur, encoding and the choice of pixels shift centroids by a tenth of a pixel, equally in equal frames. Therefore
    the shift of a cell that rests is the difference from the shift in the previous frame at its own markers.

    Args:
        image: (H, W, 3) uint8 BGR.
        predicted_px: (M, 2), NaN where not predicted.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the previous frame.
        shift_before: (C, 2) px, ``resting_shifts`` of the previous frame.
    """
    for _ in range(2):
        shift = _measure_shifts(image, predicted_px, tables, levels_before)
        shift = _less_resting_shifts(shift, shift_before, predicted_px[tables.corners])
        aligned = native.update_shifts_and_move_markers(predicted_px, shift, tables.corners)
        if aligned.max_shift < LARGE_SHIFT:
            break
        predicted_px = aligned.xy_px
    return aligned


def _less_resting_shifts(
    shift: NDArray[np.float64], shift_before: NDArray[np.float64], corner_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(C, 2) px, the shifts of cells with corners (C, 3, 2); of those that rest, the difference from before."""
    change = shift - shift_before
    edge_px = np.linalg.norm(corner_px[:, 1] - corner_px[:, 0], axis=1)
    rests = np.linalg.norm(change, axis=1) < RESTING_SHIFT * edge_px
    return np.where(rests[:, None], change, shift)


def resting_shifts(
    image: NDArray[np.uint8], xy_px: NDArray[np.float64], tables: WarmTables, levels: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(C, 2) px, the shifts of cells whose markers (M, 2) are known; 0 where they are not.

    Args:
        image, tables: as for ``align_to_inks``.
        levels: (2, C, 3) ``CellCheck.cell_levels``, with which the next frame is aligned.
    """
    shift = _measure_shifts(image, xy_px, tables, levels)
    return np.where(np.isfinite(shift), shift, 0.0)


def _measure_shifts(
    image: NDArray[np.uint8], xy_px: NDArray[np.float64], tables: WarmTables, levels: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(C, 2) px from each cell's predicted middle to the centroid of its ink nearby, NaN where there is too little ink.

    The ink is unmixed from the two others, whose cells touch this cell's corners, and from white, which shows all
    three. The window is the ellipse that a disc in an equilateral cell becomes when the cell is sheared to its corners.
    """
    return native.measure_shifts(np.ascontiguousarray(image), xy_px, tables, levels)
