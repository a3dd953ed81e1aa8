"""Between numbering and refinement: every marker's initial place, averaged from the cells that meet there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.layout.neighbour_tables import LIMITS as NEIGHBOUR_MAP_LIMITS
from extractor.layout.neighbour_tables import NeighbourMapLimits
from extractor.localmap.affine_maps import completed_linear_maps
from extractor.numbering.lattice_walk import Numbering

AGREED_DEVIATION = 0.04  # in edges, of corners on which triangles agree, where gridlines bend
MAX_PLACE_ERROR = 0.1  # in edges, between a marker's place by its gridlines and a correct initial place


class CornerLimits(NamedTuple):
    """Limits of corners.

    Where most cells have triangles, a cell without one is damaged and its edges are not the pattern's, unless the
    image's border cuts it off.

    Attributes:
        max_corner_misfit: in edges, between a triangle's corner and its prediction by the cell's neighbours.
        max_corner_spread: in edges, between a corner and the mean of its marker's corners.
        max_agreed_spread: in the triangle's shortest edge, the same for corners that agree.
        min_sharp_share: share of cells with triangles, above which most have one.
        border_px: px, from the image's border; the border cuts off cells with a corner nearer to it.
        predicted_weight: of a predicted corner, relative to a corner of a fitted triangle.
        max_ambiguity_ratio: of the smallest misfit to the next rotation's; below this ratio the orientation is clear.
        max_predicted_deviation: in edges, of a marker whose prediction confirms a triangle's corner.
        max_predicted_distance: in edges, between that prediction and the corner.
        max_distance_ratio: of that distance to the one between the prediction and the averaged place.
        prediction: of the maps that predict a marker.
    """

    max_corner_misfit: float = 0.28
    max_corner_spread: float = 0.3
    max_agreed_spread: float = 0.2
    min_sharp_share: float = 0.6
    border_px: float = 3.0
    predicted_weight: float = 0.05
    max_ambiguity_ratio: float = 0.6
    max_predicted_deviation: float = 0.15
    max_predicted_distance: float = 0.1
    max_distance_ratio: float = 0.5
    prediction: NeighbourMapLimits = NEIGHBOUR_MAP_LIMITS


LIMITS = CornerLimits()


@dataclass(frozen=True, eq=False)
class InitialMarkers:
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the means of the corners, NaN without corners or where corners disagree.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN without edges.
        cells: (C, 3) int32, marker ids of the numbered cells' corners.
        agreed: (M,) bool, all triangles that the pattern has there were found and agree, or at least two.
        is_intact: (M,) bool, all triangles that the pattern has there were found and agree, and these are at least two.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    cells: NDArray[np.int32]
    agreed: NDArray[np.bool_]
    is_intact: NDArray[np.bool_]


class _MappedCells(NamedTuple):
    """The N cells of the image with their local maps.

    Attributes:
        center_px: (N, 2) float64.
        corner_px: (N, 3, 2) float64, of the triangles, clockwise.
        slope: (N, 2, 2) float64, px per mm, NaN where unknown.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        mirrored: the pattern is seen from its back.
    """

    center_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    slope: NDArray[np.float64]
    cell: NDArray[np.int32]
    mirrored: bool


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
        xy_px: (M, 2) float64, weighted means of the corners; NaN without corners, or where corners disagree.
        edge_px: (M,) float64, weighted means of the edges, NaN without edges.
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
    else the predicted corners. A marker whose triangles disagree is lost. At the pattern's rim all neighbours are on
    one
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
    mapped = _MappedCells(cells.center_px, cells.corner_px, slope, numbering.cell, numbering.mirrored)
    corners = _CellCorners(
        *native.cell_corners(mapped, lattice.corner_vectors_mm, lattice.corner_ids, size, LIMITS)
    )
    merged = _MergedCorners(*native.average_corners(corners, len(lattice.marker_mm), LIMITS))
    agreed, is_intact = corner_agreement(merged.agreeing, lattice.cells_per_marker)
    unmatched = merged.is_unmatched & lattice.is_rim
    if unmatched.any():
        native.update_unmatched_markers(
            merged.xy_px,
            merged.edge_px,
            agreed,
            unmatched,
            corners,
            lattice.marker_mm,
            lattice.neighbours,
            LIMITS,
        )
    return InitialMarkers(merged.xy_px, merged.edge_px, merged.cells, agreed, is_intact)


def corner_agreement(
    agreeing: NDArray[np.int64], meeting: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """``agreed`` and ``is_intact`` of ``InitialMarkers``.

    Args:
        agreeing: (M,) how many triangles agree at each marker.
        meeting: (M,) how many triangles the pattern has there.
    """
    return (agreeing == meeting) | (agreeing >= 2), (agreeing == meeting) & (agreeing >= 2)
