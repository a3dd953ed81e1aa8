"""Between numbering and refinement: every marker's initial place, averaged from the cells that meet there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import completed_linear_maps
from extractor.localmap.neighbour_prediction import predict_markers
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.compilation import compiled

MAX_CORNER_MISFIT = 0.28  # in edges, between a triangle's corner and its prediction by the cell's neighbours
MAX_CORNER_SPREAD = 0.3  # in edges, between a corner and the mean of its marker's corners
MAX_AGREED_SPREAD = 0.2  # in the triangle's shortest edge, the same for corners that agree
# Where most cells have triangles, a cell without one is damaged and its edges are not the pattern's, unless the image's
# border cuts it off.
MIN_SHARP_SHARE = 0.6  # share of cells with triangles
BORDER_PX = 3.0
PREDICTED_WEIGHT = 0.05  # of a predicted corner, relative to a corner of a fitted triangle
AGREED_DEVIATION = 0.04  # in edges, of corners on which triangles agree, where gridlines bend
MAX_AMBIGUITY_RATIO = 0.6  # of the least misfit to the next rotation's; below it the orientation is clear
MAX_PREDICTED_DEVIATION = 0.15  # in edges, of a marker whose prediction confirms a triangle's corner
MAX_PREDICTED_DISTANCE = 0.1  # in edges, between that prediction and the corner
MAX_DISTANCE_RATIO = 0.5  # of that distance to the one between the prediction and the averaged place
MAX_PLACE_ERROR = 0.1  # in edges, between a marker's place by its gridlines and a correct initial place
X, Y, EDGE, WEIGHT = range(4)  # columns of a marker's sums


@dataclass(frozen=True, eq=False)
class InitialMarkers:
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the means of the corners, NaN where there is none or they disagree.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN where there is none.
        cells: (C, 3) int32, marker ids of the numbered cells' corners.
        agreed: (M,) bool, all triangles that the pattern has there were found and agree, or at least two.
        is_intact: (M,) bool, all triangles that the pattern has there were found and agree, and these are at least two.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    cells: NDArray[np.int32]
    agreed: NDArray[np.bool_]
    is_intact: NDArray[np.bool_]


class _CellCorners(NamedTuple):
    """The corners of the C numbered cells with a local map, by the layout's corners 0, 1, 2.

    Attributes:
        ids: (C, 3) int32, marker ids.
        corner_px: (C, 3, 2) float64, of the cell's triangle where that is fitted, else predicted.
        edge_px: (C,) float64, the mean predicted edge.
        is_fitted: (C,) bool, the triangle agrees with the prediction.
        is_kept: (C,) bool, the triangle is fitted, or the image's border cuts the cell off.
        rejected_px: (C, 3, 2) float64, the corners of triangles not fitted whose orientation is clear, else NaN.
        is_sharp: most triangles are fitted.
    """

    ids: NDArray[np.int32]
    corner_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    is_fitted: NDArray[np.bool_]
    is_kept: NDArray[np.bool_]
    rejected_px: NDArray[np.float64]
    is_sharp: bool


class _MergedCorners(NamedTuple):
    """The corners merged at each of M markers.

    Attributes:
        xy_px: (M, 2) float64, weighted means of the corners; NaN where there is none, or they disagree.
        edge_px: (M,) float64, weighted means of the edges, NaN where there is none.
        agreeing: (M,) int64, how many fitted triangles agree.
        cells: (K, 3) int32, marker ids of the cells whose corners are all known; if most are sharp, of those kept.
        is_unmatched: (M,) bool, markers with predicted corners only.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    agreeing: NDArray[np.int64]
    cells: NDArray[np.int32]
    is_unmatched: NDArray[np.bool_]


def merge_corners(
    cells: Cells, numbering: Numbering, lattice: Lattice, size: tuple[int, int]
) -> InitialMarkers:
    """Merge the corners at each marker (eqs. 4 and 5: at most one red, green and blue, no farther apart than L).

    A cell's corners are those of its triangle where the triangle agrees with the prediction by the cell's neighbours,
    else the predicted ones. A marker whose triangles disagree is lost. At the pattern's rim all neighbours are on one
    side and predict a bent cell badly: there one corner of a triangle is accepted if the neighbouring markers predict
    it.

    Args:
        cells: the cells of the image.
        numbering: their numbers.
        lattice: the layout.
        size: width and height of the image, px.

    Returns:
        The markers before refinement.
    """
    slope = completed_linear_maps(
        cells.center_px, cells.corner_px, numbering.cell, numbering.mirrored, lattice.layout_cells
    )
    corners = _cell_corners(
        cells.center_px,
        cells.corner_px,
        slope,
        numbering.cell,
        lattice.corner_vectors_mm,
        lattice.corner_ids,
        numbering.mirrored,
        size,
    )
    merged = _average_corners(corners, len(lattice.marker_mm))
    agreed, is_intact = corner_agreement(merged.agreeing, lattice.cells_per_marker)
    unmatched = merged.is_unmatched & lattice.is_rim
    if unmatched.any():
        _update_unmatched_markers(merged, agreed, unmatched, corners, lattice.marker_mm, lattice.neighbours)
    return InitialMarkers(merged.xy_px, merged.edge_px, merged.cells, agreed, is_intact)


def corner_agreement(
    agreeing: NDArray[np.int64], meeting: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """``agreed`` and ``is_intact`` of ``InitialMarkers``.

    Args:
        agreeing: (M,) how many triangles agree at each marker.
        meeting: (M,) how many the pattern has there.
    """
    return (agreeing == meeting) | (agreeing >= 2), (agreeing == meeting) & (agreeing >= 2)


@compiled
def _cell_corners(center, triangle, slope, cell, vectors_mm, corner_ids, mirrored, size):  # type: ignore[no-untyped-def]
    """``_CellCorners`` of the cells with a slope.

    Clockwise in the image a cell's corners run 0, 2, 1, from the back 0, 1, 2.

    Args:
        center: (N, 2) px; triangle: (N, 3, 2) px; slope: (N, 2, 2) px per mm, the local maps.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        vectors_mm: (U, 3, 2) from the layout's centers to the corners; corner_ids: (U, 3) their markers.
        size: width and height of the image, px.
    """
    here = np.flatnonzero(np.isfinite(slope[:, 0, 0]))
    count, matched, corner_step = here.shape[0], 0, 1 if mirrored else 2
    ids, corner, edge = np.empty((count, 3), np.int32), np.empty((count, 3, 2)), np.zeros(count)
    fitted, kept = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    rejected, misfit = np.full((count, 3, 2), np.nan), np.empty(3)
    for n in range(count):
        i, is_inside = here[n], True
        u = cell[i]
        for k in range(3):
            x_mm, y_mm = vectors_mm[u, k, 0], vectors_mm[u, k, 1]
            x = center[i, 0] + (slope[i, 0, 0] * x_mm + slope[i, 0, 1] * y_mm)
            y = center[i, 1] + (slope[i, 1, 0] * x_mm + slope[i, 1, 1] * y_mm)
            ids[n, k], corner[n, k, 0], corner[n, k, 1] = corner_ids[u, k], x, y
            is_inside = is_inside and min(x, y, size[0] - 1 - x, size[1] - 1 - y) >= BORDER_PX
        for k in range(3):
            edge[n] += np.sqrt(_squared_corner_distance(corner, n, k, corner, n, (k + 1) % 3)) / 3
        for first in range(3):
            misfit[first] = 0.0
            for k in range(3):
                square = _squared_corner_distance(triangle, i, (first + corner_step * k) % 3, corner, n, k)
                misfit[first] = square if not square <= misfit[first] else misfit[first]  # NaN is kept
        best = misfit.argmin()
        fitted[n] = misfit[best] < (MAX_CORNER_MISFIT * edge[n]) ** 2
        matched += fitted[n]
        is_clear = misfit[best] < MAX_AMBIGUITY_RATIO**2 * min(misfit[best - 1], misfit[best - 2])
        for k in range(3):
            at = (best + corner_step * k) % 3
            x, y = triangle[i, at, 0], triangle[i, at, 1]
            if fitted[n]:
                corner[n, k, 0], corner[n, k, 1] = x, y
            elif is_clear:
                rejected[n, k, 0], rejected[n, k, 1] = x, y
        kept[n] = fitted[n] or not is_inside
    return _CellCorners(ids, corner, edge, fitted, kept, rejected, matched > MIN_SHARP_SHARE * count)


@compiled
def _squared_corner_distance(a, i, k, b, j, m):  # type: ignore[no-untyped-def]
    """The squared distance between the corners (i, k) and (j, m) of triangles a and b (N, 3, 2)."""
    x, y = a[i, k, 0] - b[j, m, 0], a[i, k, 1] - b[j, m, 1]
    return x * x + y * y


@compiled
def _squared_point_distance(a, i, k, xy, m):  # type: ignore[no-untyped-def]
    """The squared distance between the corner (i, k) of triangles (N, 3, 2) and the point m of (M, 2)."""
    x, y = a[i, k, 0] - xy[m, 0], a[i, k, 1] - xy[m, 1]
    return x * x + y * y


@compiled
def _average_corners(corners, count):  # type: ignore[no-untyped-def]
    """``_MergedCorners`` of ``_CellCorners`` at ``count`` markers."""
    sums = _corner_sums(corners, count)
    xy, edge, unmatched = np.full((count, 2), np.nan), np.full(count, np.nan), np.zeros(count, np.bool_)
    for m in range(count):
        unmatched[m] = 0.0 < sums[m, WEIGHT] < 1.0
        if sums[m, WEIGHT] > 0.0:
            xy[m, 0], xy[m, 1] = sums[m, X] / sums[m, WEIGHT], sums[m, Y] / sums[m, WEIGHT]
            edge[m] = sums[m, EDGE] / sums[m, WEIGHT]
    agreeing = _update_disagreeing_and_count(corners, edge, xy)
    ids = corners.ids
    known_cells, rows = np.empty(ids.shape, np.int32), 0
    for n in range(ids.shape[0]):
        a, b, c = ids[n, 0], ids[n, 1], ids[n, 2]
        is_known = np.isfinite(xy[a, 0]) and np.isfinite(xy[b, 0]) and np.isfinite(xy[c, 0])
        if is_known and (corners.is_kept[n] or not corners.is_sharp):
            known_cells[rows, 0], known_cells[rows, 1], known_cells[rows, 2] = a, b, c
            rows += 1
    return _MergedCorners(xy, edge, agreeing, known_cells[:rows], unmatched)


@compiled
def _corner_sums(corners, count):  # type: ignore[no-untyped-def]
    """(M, 4) the weighted sums of x, y and edge, and of the weights, at each marker."""
    sums = np.zeros((count, 4))
    for n in range(corners.ids.shape[0]):
        weight = 1.0 if corners.is_fitted[n] else PREDICTED_WEIGHT
        for k in range(3):
            m = corners.ids[n, k]
            sums[m, X] += weight * corners.corner_px[n, k, 0]
            sums[m, Y] += weight * corners.corner_px[n, k, 1]
            sums[m, EDGE] += weight * corners.edge_px[n]
            sums[m, WEIGHT] += weight
    return sums


@compiled
def _update_disagreeing_and_count(corners, edge, xy):  # type: ignore[no-untyped-def]
    """Set markers whose triangles disagree to NaN in ``xy`` (M, 2); (M,) int64, how many triangles agree."""
    corner, mean, agreeing = corners.corner_px, xy.copy(), np.zeros(xy.shape[0], np.int64)
    for n in range(corners.ids.shape[0]):
        if not corners.is_fitted[n]:
            continue
        shortest = np.inf
        for k in range(3):
            shortest = min(shortest, _squared_corner_distance(corner, n, k, corner, n, (k + 1) % 3))
        for k in range(3):
            m = corners.ids[n, k]
            square = _squared_point_distance(corner, n, k, mean, m)
            if square > (MAX_CORNER_SPREAD * edge[m]) ** 2:
                xy[m, 0], xy[m, 1] = np.nan, np.nan
            agreeing[m] += square < MAX_AGREED_SPREAD**2 * shortest
    return agreeing


@compiled
def _update_unmatched_markers(merged, agreed, unmatched, corners, marker_mm, table):  # type: ignore[no-untyped-def]
    """Move ``unmatched`` markers (M,) to rejected triangles' corners that the ``agreed`` neighbours (M,) predict."""
    xy, edge, ids, rejected = merged.xy_px, merged.edge_px, corners.ids, corners.rejected_px
    agreed_xy = xy.copy()
    agreed_xy[~agreed] = np.nan
    predicted = predict_markers(agreed_xy, unmatched, marker_mm, table)
    expected = predicted.xy_px
    for n in range(ids.shape[0]):
        for k in range(3):
            m = ids[n, k]
            variance = predicted.variance_px2[m] * (1.0 + predicted.leverage[m])
            if unmatched[m] and variance < (MAX_PREDICTED_DEVIATION * edge[m]) ** 2:
                distance = np.sqrt((xy[m, 0] - expected[m, 0]) ** 2 + (xy[m, 1] - expected[m, 1]) ** 2)
                limit = min(MAX_PREDICTED_DISTANCE * edge[m], MAX_DISTANCE_RATIO * distance)
                if _squared_point_distance(rejected, n, k, expected, m) < limit * limit:
                    xy[m] = rejected[n, k]
