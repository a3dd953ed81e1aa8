"""Between numbering and refinement: every marker's place, agreed upon by the cells that meet there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import completed_linear_maps
from extractor.localmap.neighbour_prediction import predict_markers
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.compilation import compiled

MAX_CORNER_MISFIT = 0.28  # between a triangle's corner and where the cell's neighbours put it, in edges
MAX_CORNER_SPREAD = 0.3  # how far a corner may lie from the mean of its marker's, in edges
MAX_AGREED_SPREAD = 0.2  # of those that agree, in the triangle's shortest edge
# Where most cells are sharp enough for triangles, one without is damaged and its edges are not the pattern's, unless
# it is only cut off by the image's border.
MIN_SHARP_SHARE = 0.6
BORDER_PX = 3.0
PREDICTED_WEIGHT = 0.05  # of a corner that the neighbours' centers put there, beside one of a fitted triangle
AGREED_DEVIATION = (
    0.04  # standard deviation in edges of corners on which triangles agree, where gridlines bend
)
MAX_AMBIGUITY_RATIO = 0.6  # of the misfit with the corners named otherwise: then it is clear which is which
MAX_PREDICTED_DEVIATION = 0.15  # in edges, of where markers around put a corner of such a triangle, and
MAX_PREDICTED_DISTANCE = 0.1  # how far from there it may lie,
MAX_DISTANCE_RATIO = 0.5  # of how far the neighbours' centers put it
MAX_PLACE_ERROR = 0.1  # how far what the gridlines say may lie from a place that is right, in edges
X, Y, EDGE, WEIGHT = range(4)  # columns of a marker's sums


@dataclass(frozen=True, eq=False)
class InitialMarkers:
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the mean of the corners, NaN where there is none or they disagree.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN where there is none.
        cells: (C, 3) int32, marker ids of the numbered cells' corners.
        agreed: (M,) bool, triangles that the pattern has there were found and meet: all, or at least two.
        whole: (M,) bool, it were all, and at least two.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    cells: NDArray[np.int32]
    agreed: NDArray[np.bool_]
    whole: NDArray[np.bool_]


def merge_corners(
    cells: Cells, numbering: Numbering, lattice: Lattice, size: tuple[int, int]
) -> InitialMarkers:
    """Merge the corners of each marker (eqs. 4 and 5: at most one red, green and blue, no farther apart than L).

    A cell's corners are those of its triangle where that lies as its neighbours say, else where they say. A marker
    whose triangles lie apart has a wrong one among them and is lost. At the pattern's rim the neighbours lie on one
    side and say little of a cell that is bent: one corner of a triangle is believed there where the markers around
    say the same.

    Args:
        size: width and height of the image.
    """
    slope = completed_linear_maps(
        cells.center_px, cells.corner_px, numbering.cell, numbering.mirrored, lattice.layout_cells
    )
    seen = cells.center_px, cells.corner_px, slope, numbering.cell
    corners = _cell_corners(*seen, lattice.corner_vectors_mm, lattice.corner_ids, numbering.mirrored, *size)
    xy, around, there, kept, unmatched = _average_corners(corners, len(lattice.marker_mm))
    agreed, whole = corner_agreement(there, lattice.cells_per_marker)
    unmatched &= lattice.is_rim
    if unmatched.any():
        _update_unmatched_markers(
            xy, around, agreed, unmatched, corners, lattice.marker_mm, lattice.neighbours
        )
    return InitialMarkers(xy, around, kept, agreed, whole)


def corner_agreement(
    there: NDArray[np.int64], meeting: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """``agreed`` and ``whole`` of ``InitialMarkers``, by how many cells agree at each marker and how many meet
    there."""
    return (there == meeting) | (there >= 2), (there == meeting) & (there >= 2)


@compiled
def _cell_corners(center, triangle, slope, cell_of, arms_mm, corner_ids, mirrored, width, height):  # type: ignore[no-untyped-def]
    """Of the N numbered cells with a slope: (N, 3) the ids of corners 0, 1, 2, (N, 3, 2) these, (N,) the mean edges,
    (N,) where a triangle matched, (N,) which matched or are cut off by the border, (N, 3, 2) the corners of the others'
    triangles where it is clear which is which, else NaN, and whether most matched.

    Clockwise in the image a cell's corners run 0, 2, 1, seen from the back 0, 1, 2.
    """
    here = np.flatnonzero(np.isfinite(slope[:, 0, 0]))
    count, matched, step = here.shape[0], 0, 1 if mirrored else 2
    ids, corner, edge = np.empty((count, 3), np.int32), np.empty((count, 3, 2)), np.zeros(count)
    fitted, kept = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    aside, misfit = np.full((count, 3, 2), np.nan), np.empty(3)
    for n in range(count):
        i, inside = here[n], True
        u = cell_of[i]
        for k in range(3):
            arm_x, arm_y = arms_mm[u, k, 0], arms_mm[u, k, 1]
            x = center[i, 0] + (slope[i, 0, 0] * arm_x + slope[i, 0, 1] * arm_y)
            y = center[i, 1] + (slope[i, 1, 0] * arm_x + slope[i, 1, 1] * arm_y)
            ids[n, k], corner[n, k, 0], corner[n, k, 1] = corner_ids[u, k], x, y
            inside = inside and min(x, y, width - 1 - x, height - 1 - y) >= BORDER_PX
        for k in range(3):
            edge[n] += np.sqrt(_squared_corner_distance(corner, n, k, corner, n, (k + 1) % 3)) / 3
        for shift in range(3):
            misfit[shift] = 0.0
            for k in range(3):
                square = _squared_corner_distance(triangle, i, (shift + step * k) % 3, corner, n, k)
                misfit[shift] = square if not square <= misfit[shift] else misfit[shift]  # a NaN stays
        first = misfit.argmin()
        fitted[n] = misfit[first] < (MAX_CORNER_MISFIT * edge[n]) ** 2
        matched += fitted[n]
        clear = misfit[first] < MAX_AMBIGUITY_RATIO**2 * min(misfit[first - 1], misfit[first - 2])
        for k in range(3):
            x, y = triangle[i, (first + step * k) % 3, 0], triangle[i, (first + step * k) % 3, 1]
            if fitted[n]:
                corner[n, k, 0], corner[n, k, 1] = x, y
            elif clear:
                aside[n, k, 0], aside[n, k, 1] = x, y
        kept[n] = fitted[n] or not inside
    return ids, corner, edge, fitted, kept, aside, matched > MIN_SHARP_SHARE * count


@compiled
def _squared_corner_distance(a, i, k, b, j, m):  # type: ignore[no-untyped-def]
    """The squared distance of two triangles' corners."""
    x, y = a[i, k, 0] - b[j, m, 0], a[i, k, 1] - b[j, m, 1]
    return x * x + y * y


@compiled
def _squared_point_distance(a, i, k, xy, m):  # type: ignore[no-untyped-def]
    """The squared distance of a triangle's corner from a point."""
    x, y = a[i, k, 0] - xy[m, 0], a[i, k, 1] - xy[m, 1]
    return x * x + y * y


@compiled
def _average_corners(corners, count):  # type: ignore[no-untyped-def]
    """(M, 2) weighted means of the corners and (M,) of the edges at each marker, NaN where it has none; (M,) how many
    triangles agree there; (C, 3) the ids of the cells whose corners are all known, where most are sharp only of those
    ``kept``; (M,) bool, the markers where no triangle matched. ``corners`` as ``_cell_corners`` gives them."""
    ids, corner, edge, fitted, kept, _, sharp = corners
    sums, there = np.zeros((count, 4)), np.zeros(count, np.int64)
    for n in range(ids.shape[0]):
        weight = 1.0 if fitted[n] else PREDICTED_WEIGHT
        for k in range(3):
            m = ids[n, k]
            sums[m, X] += weight * corner[n, k, 0]
            sums[m, Y] += weight * corner[n, k, 1]
            sums[m, EDGE] += weight * edge[n]
            sums[m, WEIGHT] += weight
    xy, around = np.full((count, 2), np.nan), np.full(count, np.nan)
    unmatched = np.zeros(count, np.bool_)
    for m in range(count):
        unmatched[m] = 0.0 < sums[m, WEIGHT] < 1.0
        if sums[m, WEIGHT] > 0.0:
            xy[m, 0], xy[m, 1] = sums[m, X] / sums[m, WEIGHT], sums[m, Y] / sums[m, WEIGHT]
            around[m] = sums[m, EDGE] / sums[m, WEIGHT]
    mean = xy.copy()
    for n in range(ids.shape[0]):
        if not fitted[n]:
            continue
        shortest = np.inf
        for k in range(3):
            shortest = min(shortest, _squared_corner_distance(corner, n, k, corner, n, (k + 1) % 3))
        for k in range(3):
            m = ids[n, k]
            apart = _squared_point_distance(corner, n, k, mean, m)
            if apart > (MAX_CORNER_SPREAD * around[m]) ** 2:
                xy[m, 0], xy[m, 1] = np.nan, np.nan
            there[m] += apart < MAX_AGREED_SPREAD**2 * shortest
    whole, rows = np.empty(ids.shape, np.int32), 0
    for n in range(ids.shape[0]):
        a, b, c = ids[n, 0], ids[n, 1], ids[n, 2]
        known = np.isfinite(xy[a, 0]) and np.isfinite(xy[b, 0]) and np.isfinite(xy[c, 0])
        if known and (kept[n] or not sharp):
            whole[rows, 0], whole[rows, 1], whole[rows, 2] = a, b, c
            rows += 1
    return xy, around, there, whole[:rows], unmatched


@compiled
def _update_unmatched_markers(xy, edge, agreed, unmatched, corners, marker_mm, table):  # type: ignore[no-untyped-def]
    """Put ``unmatched`` markers (M,) on corners of triangles that the ``agreed`` ones around confirm, in place."""
    ids, aside = corners[0], corners[5]
    seen = xy.copy()
    seen[~agreed] = np.nan
    expected, variance, leverage, _ = predict_markers(seen, unmatched, marker_mm, table)
    for n in range(ids.shape[0]):
        for k in range(3):
            m = ids[n, k]
            if unmatched[m] and variance[m] * (1.0 + leverage[m]) < (MAX_PREDICTED_DEVIATION * edge[m]) ** 2:
                limit = min(
                    MAX_PREDICTED_DISTANCE * edge[m],
                    MAX_DISTANCE_RATIO
                    * np.sqrt((xy[m, 0] - expected[m, 0]) ** 2 + (xy[m, 1] - expected[m, 1]) ** 2),
                )
                if _squared_point_distance(aside, n, k, expected, m) < limit * limit:
                    xy[m] = aside[n, k]
