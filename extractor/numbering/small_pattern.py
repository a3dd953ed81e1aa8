"""Recognises a small pattern in a large image: numbered at a reduced scale by the centers of its cells alone.

Cells of a few pixels have no shape at that scale, but their centers are accurate to a fraction of a pixel. If the
centers number the whole pattern, the numbers predict every cell's corners, and the edges are then measured in the full
image. So no region is grown and no triangle is fitted in the background.
"""

from __future__ import annotations

import numpy as np

from extractor._native import numbering as native
from extractor.cells.cells import Cells
from extractor.cells.seeds import Seeds
from extractor.cells.triangle_edges import update_triangle_corners
from extractor.cells.triangle_fit import Triangles
from extractor.image.pyramid import PyramidLevel
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import LIMITS as AFFINE_MAP_LIMITS
from extractor.numbering.lattice_walk import Numbering

MIN_CELL_PX = 12  # px^2, area of a domain that may be a cell; chosen
MIN_DOMAINS_PER_CELL = 1.0  # least number of such domains, per cell of the pattern; chosen
MIN_AREA_PX = 8  # px^2, area of a domain that is no speck; chosen
MIN_DOMAIN_SHARE = 0.9  # of the domains are no specks; noise has many specks. Chosen
MIN_FITTED_SHARE = 0.97  # of the pattern's cells have edges where predicted; chosen


def is_small_pattern_possible(seeds: Seeds, cells: int) -> bool:
    """Whether a complete small pattern of ``cells`` cells may be among these domains."""
    if np.count_nonzero(seeds.area_px >= MIN_CELL_PX) < MIN_DOMAINS_PER_CELL * cells:
        return False
    return bool(np.count_nonzero(seeds.area_px >= MIN_AREA_PX) >= MIN_DOMAIN_SHARE * len(seeds.area_px))


def fit_predicted_triangles(
    view: PyramidLevel, cells: Cells, numbering: Numbering, lattice: Lattice
) -> Triangles | None:
    """The triangles of the numbered cells, measured from the corners that the numbers predict.

    Args:
        view: the image at full scale.
        cells: the cells, at full scale.
        numbering: their numbers.
        lattice: the layout.

    Returns:
        Triangles whose ``region`` is the index of the cell; None unless the whole pattern is numbered and nearly all of
        its cells have edges where predicted.
    """
    if np.count_nonzero(numbering.cell >= 0) < len(lattice.ink):
        return None
    corners, good = native.predicted_corners(
        cells.center_px, numbering.cell, lattice.layout_cells, numbering.mirrored, AFFINE_MAP_LIMITS
    )
    update_triangle_corners(view, corners, good)
    if np.count_nonzero(good) < MIN_FITTED_SHARE * len(lattice.ink):
        return None
    return Triangles(corners[good], cells.ink[good], np.flatnonzero(good).astype(np.int32))
