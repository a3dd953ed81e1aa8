"""Between numbering and refinement: every marker's initial place, averaged from the cells that meet there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import completed_linear_maps
from extractor.numbering.lattice_walk import Numbering

AGREED_DEVIATION = 0.04  # in edges, of corners on which triangles agree, where gridlines bend; chosen
# in edges, between a marker's place by its gridlines and a correct initial place; chosen
MAX_PLACE_ERROR = 0.1


class CornerLimits(NamedTuple):
    """Limits of corners.

    Attributes:
        max_corner_misfit: in edges, between a triangle's corner and its prediction by the cell's neighbours. Measured:
            rule "corner misfit".
        max_agreed_spread: in the triangle's shortest edge, between a corner and the mean of its marker's corners, where
            these agree. Chosen.
        predicted_weight: of a predicted corner, relative to a corner of a fitted triangle. Chosen.
    """

    max_corner_misfit: float = 0.28
    max_agreed_spread: float = 0.2
    predicted_weight: float = 0.05


LIMITS = CornerLimits()


class InitialMarkers(NamedTuple):
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the means of the corners, NaN where there is none.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN where there is none.
        agreed: (M,) bool, all triangles that the pattern has there were found and agree, or at least two.
        is_intact: (M,) bool, all triangles that the pattern has there were found and agree, and these are at least two.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
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
    """

    ids: NDArray[np.int32]
    corner_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    is_fitted: NDArray[np.bool_]


class _MergedCorners(NamedTuple):
    """The corners merged at each of M markers.

    Attributes:
        xy_px: (M, 2) float64, weighted means of the corners; NaN where there is none.
        edge_px: (M,) float64, weighted means of the edges, NaN where there is none.
        agreeing: (M,) int64, how many fitted triangles agree.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    agreeing: NDArray[np.int64]


def merge_corners(cells: Cells, numbering: Numbering, lattice: Lattice) -> InitialMarkers:
    """Merge the corners at each marker (eq. 4: at most one red, green and blue).

    A cell's corners are those of its triangle where the triangle agrees with the prediction by the cell's neighbours,
    else the predicted ones.

    Args:
        cells: the cells of the image.
        numbering: their numbers.
        lattice: the layout.

    Returns:
        The markers before refinement.
    """
    slope = completed_linear_maps(
        cells.center_px, cells.corner_px, numbering.cell, numbering.mirrored, lattice.layout_cells
    )
    mapped = _MappedCells(cells.center_px, cells.corner_px, slope, numbering.cell, numbering.mirrored)
    corners = _CellCorners(
        *native.cell_corners(mapped, lattice.corner_vectors_mm, lattice.corner_ids, LIMITS)
    )
    merged = _MergedCorners(*native.average_corners(corners, len(lattice.marker_mm), LIMITS))
    agreed, is_intact = corner_agreement(merged.agreeing, lattice.cells_per_marker)
    return InitialMarkers(merged.xy_px, merged.edge_px, agreed, is_intact)


def corner_agreement(
    agreeing: NDArray[np.int64], meeting: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """``agreed`` and ``is_intact`` of ``InitialMarkers``.

    Args:
        agreeing: (M,) how many triangles agree at each marker.
        meeting: (M,) how many triangles the pattern has there.
    """
    return (agreeing == meeting) | (agreeing >= 2), (agreeing == meeting) & (agreeing >= 2)
