"""The alignment of predicted cells to the image: every cell moves to the centroid of its ink nearby."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, vectorized
from extractor.numeric.dense_systems import dot3
from extractor.track.warm_tables import WarmTables

SEARCH_RADIUS = 0.9  # of the window around a cell's middle, in edges
MIN_ROWS = 8  # of pixels that are sampled in the window, at least
MIN_PIXEL_INK = 0.2  # of an ink, for a pixel to count as this ink
MIN_INK_SHARE = 0.4  # of a cell's area that must show its ink in the window
MAX_SHIFT = 0.35  # of a cell from its prediction, in edges
LARGE_SHIFT = 0.2  # in edges; after a larger shift the window is moved and the shift measured again
RESTING_SHIFT = 0.02  # of a cell from the frame before, in edges, up to which the cell rests
MAX_SPREAD = 0.25  # of the shifts of cells that share a marker, from their mean, in edges
MIN_VOLUME = 0.05  # sine of the angle of an ink to the plane of the two others, for unmixing
CELL_AREA_RATIO = 3**0.5 / 4  # area of an equilateral triangle relative to the square on its edge


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
    """The markers moved to where the inks of their cells are, in at most two passes.

    Blur, encoding and the choice of pixels shift centroids by a tenth of a pixel, alike in frames that are alike. So
    the shift of a cell that rests is the difference from what the frame before showed at its own markers.

    Args:
        image: (H, W, 3) uint8 BGR.
        predicted_px: (M, 2), NaN where not predicted.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the frame before.
        shift_before: (C, 2) px, ``resting_shifts`` of the frame before.
    """
    for _ in range(2):
        shift = _measure_shifts(
            image, predicted_px, tables.corners, tables.ink, tables.nearest, levels_before
        )
        shift = _less_resting_shifts(shift, shift_before, predicted_px[tables.corners])
        aligned: AlignedMarkers = _update_shifts_and_move_markers(predicted_px, shift, tables.corners)
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
    shift = _measure_shifts(image, xy_px, tables.corners, tables.ink, tables.nearest, levels)
    return np.where(np.isfinite(shift), shift, 0.0)


@compiled
def _fill_unmixing_weights(own, first, second, row):  # type: ignore[no-untyped-def]
    """Write the weights (3,) of the channels that give 1 for an ink, -1 for the two others and 0 for black.

    Returns:
        False where the three inks are nearly coplanar.
    """
    normal = np.empty(3)
    row[:] = 0.0
    for n in range(3):
        a, b, c = (own, first, second) if n == 0 else (first, second, own) if n == 1 else (second, own, first)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            normal[k] = b[i] * c[j] - b[j] * c[i]
        volume = dot3(normal, a)
        if not abs(volume) > MIN_VOLUME * np.sqrt(dot3(normal, normal) * dot3(a, a)):
            return False
        for k in range(3):
            row[k] += (1.0 if n == 0 else -1.0) * normal[k] / volume
    return True


@compiled
def _measure_shifts(image, xy, corners, ink, nearest, levels):  # type: ignore[no-untyped-def]
    """(C, 2) px from each cell's predicted middle to the centroid of its ink nearby, NaN where there is too little ink.

    The ink is unmixed from the two others, whose cells touch this cell's corners, and from white, which shows all
    three. The window is the ellipse that a disc in an equilateral cell becomes when the cell is sheared to its corners.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    shift = np.full((corners.shape[0], 2), np.nan)
    row, sums = np.zeros(3), np.zeros(3)
    for i in range(corners.shape[0]):
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        first = levels[0, nearest[i, (ink[i] + 0) % 3]]
        second = levels[0, nearest[i, (ink[i] + 1) % 3]]
        if not _fill_unmixing_weights(levels[0, i], first, second, row):
            continue
        zero = dot3(row, levels[1, i])
        cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        # images of the unit vectors along and across the edge a-b of the equilateral cell: the ellipse's axes
        ux, uy = b[0] - a[0], b[1] - a[1]
        vx, vy = (c[0] - a[0] - 0.5 * ux) / 0.75**0.5, (c[1] - a[1] - 0.5 * uy) / 0.75**0.5
        area = ux * vy - uy * vx
        if not abs(area) > 1.0:
            continue
        yy, xy_moment = uy * uy + vy * vy, ux * uy + vx * vy
        half_height = SEARCH_RADIUS * np.sqrt(yy)
        sums[:] = 0.0
        row_step = max(int(2.0 * half_height / MIN_ROWS), 1)
        top, bottom = max(int(np.ceil(cy - half_height)), 0), min(int(np.floor(cy + half_height)), height - 1)
        for y in range(top, bottom + 1, row_step):
            offset = (y - cy) / yy
            half_width = abs(area) * np.sqrt(max(SEARCH_RADIUS * SEARCH_RADIUS / yy - offset * offset, 0.0))
            start = max(int(np.ceil(cx + xy_moment * offset - half_width)), 0)
            end = min(int(np.floor(cx + xy_moment * offset + half_width)), width - 1)
            if start <= end:
                line = flat[3 * (y * width + start) : 3 * (y * width + end + 1)]
                _add_ink_moments(line, start - cx, y - cy, row, zero, sums)
        if row_step * sums[0] > MIN_INK_SHARE * CELL_AREA_RATIO * abs(area):
            shift[i, 0], shift[i, 1] = sums[1] / sums[0], sums[2] / sums[0]
    return shift


@vectorized
def _add_ink_moments(line, x, y, weights, zero, sums):  # type: ignore[no-untyped-def]
    """Add the area and the first moments in x and y of the ink in a row of pixels.

    Args:
        line: (3 N,) uint8, the pixels; the first one lies at (x, y).
        weights, zero: the ink of a pixel is the weighted sum of its channels minus ``zero``.
        sums: (3,) area and moments.
    """
    w0, w1, w2 = weights[0], weights[1], weights[2]
    total, moment = 0.0, 0.0
    for k in range(np.uint64(line.shape[0] // 3)):
        i = np.uint64(3) * k
        share = w0 * line[i] + w1 * line[i + np.uint64(1)] + w2 * line[i + np.uint64(2)] - zero
        share = min(share, 1.0) * (share > MIN_PIXEL_INK)
        total += share
        moment += share * k
    sums[0] += total
    sums[1] += moment + total * x
    sums[2] += total * y


@compiled
def _update_shifts_and_move_markers(xy, shift, corners):  # type: ignore[no-untyped-def]
    """The ``AlignedMarkers`` after the mean shift of their cells; too large shifts (C, 2) become NaN."""
    count = xy.shape[0]
    total, cell_count, edge = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    largest = 0.0
    for i in range(corners.shape[0]):
        if not np.isfinite(shift[i, 0]):
            continue
        a, b, c = xy[corners[i, 0]], xy[corners[i, 1]], xy[corners[i, 2]]
        size = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) + np.sqrt(
            (b[0] - c[0]) ** 2 + (b[1] - c[1]) ** 2
        )
        size = (size + np.sqrt((c[0] - a[0]) ** 2 + (c[1] - a[1]) ** 2)) / 3
        distance = np.sqrt(shift[i, 0] ** 2 + shift[i, 1] ** 2) / size
        if distance > MAX_SHIFT:
            shift[i] = np.nan
            continue
        largest = max(largest, distance)
        for k in range(3):
            m = corners[i, k]
            total[m] += shift[i]
            edge[m] += size
            cell_count[m] += 1.0
    moved = np.full((count, 2), np.nan)
    for m in range(count):
        if cell_count[m] > 0.0:
            moved[m] = xy[m] + total[m] / cell_count[m]
    for i in range(corners.shape[0]):
        for k in range(3):
            m = corners[i, k]
            if np.isfinite(shift[i, 0]) and np.isfinite(moved[m, 0]):
                dx, dy = shift[i, 0] - (moved[m, 0] - xy[m, 0]), shift[i, 1] - (moved[m, 1] - xy[m, 1])
                if dx * dx + dy * dy > (MAX_SPREAD * edge[m] / cell_count[m]) ** 2:
                    moved[m] = np.nan
    return AlignedMarkers(moved, largest, edge / np.maximum(cell_count, 1.0))
