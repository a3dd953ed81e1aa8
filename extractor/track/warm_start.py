"""The warm start: a frame's numbering is predicted from the previous frame, and proved by the image.

The previous frame is no evidence. Every cell must show its own ink inside and none of it across its edges, and must be
connected to the white cell (or to the whole rim of the pattern) over cells that pass the same test. A triangle that is
off by more than a seventh of an edge fails. Therefore, where two passing triangles share a corner, the real cells share
it, too. Around a real corner red, green and blue turn clockwise, so a chain of such cells from the white cell has the
numbering of a cold start. Frames that fail have a cold start. The previous frame thus saves time and does not determine
the numbering, except while the white cell is hidden and the whole rim is visible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import track as native
from extractor.image.pyramid import PyramidLevel
from extractor.numbering.marker_places import InitialMarkers
from extractor.track.image_check import CONFIRMED, check_cells
from extractor.track.ink_alignment import align_to_inks
from extractor.track.warm_tables import WarmTables

# of the cells in view whose middles must show their ink under a predicted position; chosen
MIN_PREDICTED = 0.8
# of a cell's three edges across which it is bright, for the white cell and for a rival; chosen
MIN_WHITE_EDGES = 2


class VisibleCells(NamedTuple):
    """Numbers of cells whose middles lie in the image, and of those whose middles match their own ink best."""

    visible: int
    matching: int


class VerifiedMarkers(NamedTuple):
    """The corners of proved cells, NaN elsewhere; ``agreed`` and ``is_intact`` as in ``InitialMarkers``."""

    xy_px: NDArray[np.float64]
    agreed: NDArray[np.bool_]
    is_intact: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class WarmStart:
    """A proved warm start.

    Attributes:
        places: the markers before refinement.
        cell_levels: (2, C, 3) as in ``CellCheck``; of cells that are not proved, the levels of the previous frame.
        by_rim: the white cell is hidden, and the rim proved the numbering.
    """

    places: InitialMarkers
    cell_levels: NDArray[np.float64]
    by_rim: bool


def select_prediction(
    image: NDArray[np.uint8],
    candidates: list[NDArray[np.float64]],
    tables: WarmTables,
    levels_before: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """The candidate with the most cells that show their ink in their middle; None with too few cells.

    Args:
        image: (H, W, 3) uint8 BGR.
        candidates: (M, 2) predicted markers each, px.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the previous frame.
    """
    best, best_share = None, MIN_PREDICTED
    for candidate in candidates:
        cells = native.count_matching_centres(
            np.ascontiguousarray(image), candidate, tables, levels_before[0]
        )
        if cells.matching > best_share * cells.visible:
            best, best_share = candidate, cells.matching / cells.visible
            if cells.matching == cells.visible:
                break
    return best


def verify_prediction(
    level: PyramidLevel,
    predicted_px: NDArray[np.float64],
    known: NDArray[np.bool_],
    tables: WarmTables,
    levels_before: NDArray[np.float64],
    shift_before: NDArray[np.float64],
) -> WarmStart | None:
    """Move the predicted cells onto the image; None unless the image confirms enough cells.

    Args:
        level: the image at the scale of the check.
        predicted_px: (M, 2) in this level, NaN where not predicted.
        known: (M,) bool, markers of the previous frame; nearly all of their cells in view must be confirmed.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the previous frame.
        shift_before: (C, 2) px in this level, ``resting_shifts`` of the previous frame.
    """
    aligned = align_to_inks(level.image, predicted_px, tables, levels_before, shift_before)
    check = check_cells(level.image, aligned.xy_px[tables.corners], tables, levels_before)
    by_rim = check.white_count == 0
    if check.white_elsewhere_count >= MIN_WHITE_EDGES:
        return None
    if by_rim and (check.verdict[tables.is_rim] != CONFIRMED).any():
        return None
    if not by_rim and (check.white_count < MIN_WHITE_EDGES or check.white_missing_count > 0):
        return None
    first = tables.is_rim if by_rim else tables.is_at_white
    cells = tables.corners, tables.cells_of_marker
    proved, enough = native.connected_cells(check.verdict, first, known, *cells)
    if not enough:
        return None
    seen = native.verified_markers(aligned.xy_px, proved, tables.corners)
    xy_px, edge_px = level.to_full_scale(seen.xy_px), aligned.edge_px * level.scale
    places = InitialMarkers(xy_px, edge_px, seen.agreed, seen.is_intact)
    return WarmStart(places, np.where(proved[:, None], check.cell_levels, levels_before), by_rim)
