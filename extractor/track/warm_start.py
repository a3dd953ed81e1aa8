"""The warm start: a frame's numbering is predicted from the frame before, and proved by the image.

The frame before is no evidence. Every cell must show its own ink inside and none of it across its edges, and must be
connected to the white cell (or to the whole rim of the pattern) over cells that do the same. A triangle that is off by
more than a seventh of an edge fails, so where two of them share a corner the real cells do so, too. Around a real
corner red, green and blue turn clockwise, so a chain of such cells from the white cell has the numbering of a cold
start. Frames that fail are left to the cold start. The frame before thus saves time and decides nothing, except while
the white cell is hidden and the whole rim is visible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.numbering.marker_places import InitialMarkers, corner_agreement
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled
from extractor.track.image_check import CONFIRMED, UNSEEN, check_cells
from extractor.track.ink_alignment import align_to_inks
from extractor.track.warm_tables import WarmTables

MIN_VERIFIED_SHARE = 0.95  # of the cells in view that the image must confirm
MIN_PREDICTED = 0.8  # of the cells in view whose middles must show their ink under a predicted position
MIN_CENTER_STRENGTH = 0.3  # of a middle's ink level, relative to the frame before
MIN_WHITE_EDGES = 2  # of a cell's three edges across which it is bright, for the white cell and for a rival


@dataclass(frozen=True, eq=False)
class WarmStart:
    """A proved warm start.

    Attributes:
        places: the markers before refinement.
        cell_levels: (2, C, 3) as in ``CellCheck``; of cells that are not proved, those of the frame before.
        by_rim: the white cell is hidden, and the rim proved the numbering.
    """

    places: InitialMarkers
    cell_levels: NDArray[np.float64]
    by_rim: bool


class VerifiedMarkers(NamedTuple):
    """The corners of proved cells.

    Attributes:
        xy_px: (M, 2) float64, NaN where no proved cell has a corner.
        verified_count, cell_count: (M,) int64, number of proved cells and of all cells that meet at each marker.
    """

    xy_px: NDArray[np.float64]
    verified_count: NDArray[np.int64]
    cell_count: NDArray[np.int64]


@compiled
def _count_matching_centers(image, xy, corners, ink, levels, nearest):  # type: ignore[no-untyped-def]
    """Number of cells in view, and of those whose middle matches their own ink better than the two others."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    color = np.zeros(3)
    visible, matching = 0, 0
    for i in range(corners.shape[0]):
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        x, y = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        if not fill_patch_mean(flat, height, width, x, y, 0.5, color):  # outside the image, or NaN
            continue
        visible += 1
        best, best_score = 0, -np.inf
        for k in range(3):
            other = levels[nearest[i, k]]
            norm = np.sqrt(other[0] ** 2 + other[1] ** 2 + other[2] ** 2)
            low = min(color[0], color[1], color[2])
            score = other[0] * (color[0] - low) + other[1] * (color[1] - low) + other[2] * (color[2] - low)
            if score / norm > best_score:
                best, best_score = k + 1, score / norm
        own = levels[i]
        own_norm = np.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2)
        if best == ink[i] and best_score > MIN_CENTER_STRENGTH * own_norm:
            matching += 1
    return visible, matching


@compiled
def _connected_cells(verdict, first, known, corners, cells_of_marker):  # type: ignore[no-untyped-def]
    """(C,) bool, the confirmed cells that are connected to the ``first`` ones (C,) over common markers; and whether
    they are nearly all of the cells in view whose markers were ``known`` (M,)."""
    count = corners.shape[0]
    reached = first & (verdict == CONFIRMED)
    queue = np.empty(count, np.int64)
    head, tail = 0, 0
    for i in range(count):
        if reached[i]:
            queue[tail] = i
            tail += 1
    while head < tail:
        i = queue[head]
        head += 1
        for k in range(3):
            for n in range(3):
                j = cells_of_marker[corners[i, k], n]
                if j >= 0 and verdict[j] == CONFIRMED and not reached[j]:
                    reached[j] = True
                    queue[tail] = j
                    tail += 1
    expected, found = 0, 0
    for i in range(count):
        if verdict[i] != UNSEEN and known[corners[i, 0]] and known[corners[i, 1]] and known[corners[i, 2]]:
            expected += 1
            found += reached[i]
    return reached, tail > 0 and found >= MIN_VERIFIED_SHARE * expected


@compiled
def _verified_markers(xy, proved, corners):  # type: ignore[no-untyped-def]
    """The ``VerifiedMarkers`` of the cells ``proved`` (C,) bool."""
    kept = np.full(xy.shape, np.nan)
    verified_count, cell_count = np.zeros(xy.shape[0], np.int64), np.zeros(xy.shape[0], np.int64)
    for i in range(corners.shape[0]):
        for k in range(3):
            m = corners[i, k]
            cell_count[m] += 1
            if proved[i]:
                verified_count[m] += 1
                kept[m] = xy[m]
    return VerifiedMarkers(kept, verified_count, cell_count)


def select_prediction(
    image: NDArray[np.uint8],
    candidates: list[NDArray[np.float64]],
    tables: WarmTables,
    levels_before: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """The candidate under which the most cells show their ink in their middle; None when too few do.

    Args:
        image: (H, W, 3) uint8 BGR.
        candidates: (M, 2) predicted markers each, px.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the frame before.
    """
    best, best_share = None, MIN_PREDICTED
    for candidate in candidates:
        visible, matching = _count_matching_centers(
            image, candidate, tables.corners, tables.ink, levels_before[0], tables.nearest
        )
        if matching > best_share * visible:
            best, best_share = candidate, matching / visible
            if matching == visible:
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
    """Move the predicted cells onto the image; None unless the image confirms enough of them.

    Args:
        level: the image at the scale of the check.
        predicted_px: (M, 2) in this level, NaN where not predicted.
        known: (M,) bool, markers of the frame before; nearly all of their cells in view must be confirmed.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the frame before.
        shift_before: (C, 2) px in this level, ``resting_shifts`` of the frame before.
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
    proved, enough = _connected_cells(check.verdict, first, known, tables.corners, tables.cells_of_marker)
    if not enough:
        return None
    verified: VerifiedMarkers = _verified_markers(aligned.xy_px, proved, tables.corners)
    agreement = corner_agreement(verified.verified_count, verified.cell_count)
    places = InitialMarkers(
        level.to_full_scale(verified.xy_px),
        aligned.edge_px * level.scale,
        tables.corners[proved],
        *agreement,
    )
    return WarmStart(places, np.where(proved[:, None], check.cell_levels, levels_before), by_rim)
