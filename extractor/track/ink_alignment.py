"""The alignment of predicted cells to the image: every cell moves to the centroid of its ink nearby."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import track as native
from extractor.track.warm_tables import WarmTables

LARGE_SHIFT = 0.2  # in edges; after a larger shift the window is moved and the shift measured again. Chosen
RESTING_SHIFT = 0.02  # of a cell from the frame before, in edges, up to which the cell rests; chosen


class AlignmentLimits(NamedTuple):
    """Limits of the alignment.

    Attributes:
        search_radius: of the window around a cell's middle, in edges. Chosen.
        min_rows: of pixels that are sampled in the window, at least. Chosen.
        min_pixel_ink: of an ink, for a pixel to count as this ink. Chosen.
        min_ink_share: of a cell's area that must show its ink in the window. Chosen.
        max_shift: of a cell from its prediction, in edges; beyond it the cell's shift is unknown. Chosen.
        max_spread: of the shifts of cells that share a marker, from their mean, in edges; beyond it the marker is
            unknown. Chosen.
        min_volume: sine of the angle of an ink to the plane of the two others, for unmixing. Chosen.
        min_area_px: px^2, of the parallelogram of the window's unit axes; smaller cells have no shift. Chosen.
    """

    search_radius: float = 0.9
    min_rows: int = 8
    min_pixel_ink: float = 0.2
    min_ink_share: float = 0.4
    max_shift: float = 0.35
    max_spread: float = 0.25
    min_volume: float = 0.05
    min_area_px: float = 1.0


LIMITS = AlignmentLimits()


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
        aligned = AlignedMarkers(
            *native.update_shifts_and_move_markers(predicted_px, shift, tables.corners, LIMITS)
        )
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
    return np.asarray(native.measure_shifts(np.ascontiguousarray(image), xy_px, tables, levels, LIMITS))
