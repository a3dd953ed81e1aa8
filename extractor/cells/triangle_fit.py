"""Stage 5: fits triangles to the grown regions, and to their edges with sub-pixel accuracy.

The profile of the ink's light across an edge, 1 inside and 0 outside, is integrated: its area gives the edge's position
for any blur, so that the blur need not be known. The edge is the line through two such positions. Profiles run along
the median, not the normal, so that they avoid the other edges in any triangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.cells import Cells
from extractor.cells.region_growing import Regions
from extractor.image.pyramid import PyramidLevel


def regions_as_cells(cells: Cells, regions: Regions, view: PyramidLevel) -> Cells:
    """The cells, with the triangles of the grown regions where these are better triangles than the seeds' regions.

    Args:
        cells: the seeds.
        regions: grown from them.
        view: the image in which they were grown.
    """
    corners, quality = native.fit_to_moments(regions.moments, regions.seed)
    better = quality > cells.quality
    corner_px = np.where(better[:, None, None], view.to_full_scale(corners), cells.corner_px)
    return Cells(
        corner_px.mean(axis=1),
        np.where(better, regions.moments[:, 0] * view.scale**2, cells.area_px),
        corner_px,
        np.maximum(quality, cells.quality),
        cells.share,
    )


def fit_edges(view: PyramidLevel, corner_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 2) the intersections of the edges as the image shows them; NaN where no triangle is measured.

    Args:
        view: the image at full scale.
        corner_px: (N, 3, 2) clockwise in the image.
    """
    corners, good = corner_px.copy(), np.ones(len(corner_px), np.bool_)
    native.update_triangle_corners(view, corners, good)
    corners[~good] = np.nan
    return corners
