"""A small pattern amid much else: numbered by the centers of its cells alone, at a reduced scale, or not at all.

Cells of a few pixels have no shape there, but their centers are good to a fraction of one. If these suffice to number
the whole pattern, the numbers say where every cell's corners are, and the full image places its edges from there. So
nothing has to be grown, or fitted, in what lies around or behind.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.cells.seeds import Seeds
from extractor.cells.triangle_edges import update_triangle_corners
from extractor.cells.triangle_fit import Triangles
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import image_cell_of_layout_cell, linear_maps
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.compilation import compiled

MIN_CELL_PX = 12  # of a cell, of which there must be more than the pattern has,
MIN_DOMAINS_PER_CELL = 1.0
MIN_AREA_PX, MIN_DOMAIN_SHARE = (
    8,
    0.9,
)  # at least so many domains are larger than specks: noise has many of them
MIN_FITTED_SHARE = 0.97  # of the pattern's cells have edges where their numbers say


def is_small_pattern_possible(seeds: Seeds, cells: int) -> bool:
    """Whether a pattern of so many cells may be whole and small among these domains."""
    if np.count_nonzero(seeds.area_px >= MIN_CELL_PX) < MIN_DOMAINS_PER_CELL * cells:
        return False
    return bool(np.count_nonzero(seeds.area_px >= MIN_AREA_PX) >= MIN_DOMAIN_SHARE * len(seeds.area_px))


def fit_predicted_triangles(
    image: NDArray[np.uint8], cells: Cells, numbering: Numbering, lattice: Lattice
) -> Triangles | None:
    """The triangles of the numbered cells, from where their numbers put the corners; their ``region`` is the cell.

    None unless the whole pattern is numbered, and nearly all of its cells have edges there.
    """
    if np.count_nonzero(numbering.cell >= 0) < len(lattice.ink):
        return None
    corners, good = _predicted_corners(
        cells.center_px, numbering.cell, lattice.layout_cells, numbering.mirrored
    )
    update_triangle_corners(image, corners, good)
    if np.count_nonzero(good) < MIN_FITTED_SHARE * len(lattice.ink):
        return None
    return Triangles(corners[good], cells.ink[good], np.flatnonzero(good).astype(np.int32))


@compiled
def _predicted_corners(center_px, cell, plan, mirrored):  # type: ignore[no-untyped-def]
    """(N, 3, 2) px, the corners of the numbered cells, clockwise in the image, by the neighbours' centers; (N,) bool,
    which have any."""
    slope = linear_maps(
        center_px,
        cell,
        image_cell_of_layout_cell(cell, plan.ink.shape[0]),
        plan.center_mm,
        plan.cell_neighbours,
    )
    corners, good = np.full((cell.shape[0], 3, 2), np.nan), np.zeros(cell.shape[0], np.bool_)
    step = 1 if mirrored else 2  # clockwise a cell's corners run 0, 2, 1, seen from the back 0, 1, 2
    for i in range(cell.shape[0]):
        if cell[i] < 0 or np.isnan(slope[i, 0, 0]):
            continue
        good[i] = True
        for k in range(3):
            x, y = plan.corner_vectors_mm[cell[i], step * k % 3]
            for axis in range(2):
                corners[i, k, axis] = center_px[i, axis] + slope[i, axis, 0] * x + slope[i, axis, 1] * y
    return corners, good
