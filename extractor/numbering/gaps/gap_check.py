"""Checks whether detached numbered cells lie where the pattern continues.

Cells of one ink are 1.7 cells apart. A part of the pattern beyond a scratch, numbered one such step aside, is
consistent in itself and wrong as a whole. So the numbered cells are divided into blocks connected by shared corners.
Beginning with the block at the white cell, the nearest blocks first, each block is compared with the consistent cells:
the vectors between their centers must have the lengths that the pattern's slopes on both sides predict. Cells
that are inconsistent, or not connected, lose their number. A slope is the local linear map from layout to image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import gaps as native
from extractor.layout.lattice_tables import LayoutCells
from extractor.numbering.gaps.corner_contact import LIMITS as CONTACT_LIMITS
from extractor.numbering.gaps.corner_contact import CornerContactLimits


class GapCheckLimits(NamedTuple):
    """Limits of the check. A jump is the difference, in cells, between a vector by the numbers and by the slopes; a
    wrong step makes 1.7.

    Attributes:
        max_median_jump: the median jump of a block. Measured: rule "gap check".
        max_jump_share: share of a block's jumps that may be larger. Measured: rule "gap check".
        max_single_jump: of a cell without contacts: its center may be shifted. Measured: rule "single cells".
        max_gap: between the two sides, in cells. Measured: rule "gap check".
        max_gap_ratio: vectors of a block not longer than this many times its shortest are compared. Chosen.
        min_slope_spread: the determinant of the neighbours' vectors over their squared sum; below it they lie on one
            line, and give no slope. Chosen.
        reference_candidates: cells nearest to the white one, of which the largest block is the reference. Chosen.
        white_cell_neighbours: numbered cells nearest to the white cell, which predict its place. Measured: rule "white
            contradicted".
        min_white_cell_neighbours: least number of them. Measured: rule "white contradicted".
        max_white_cell_misfit: in cells, the median distance from the predictions; a wrong step makes 1.7. Measured:
            rule "white contradicted".
        max_contact_jump: of a contact against the slope by the other contacts of either cell, in cells; larger ones
            join no two large blocks. Measured: rule "even contacts".
        min_block_cells, min_block_share: of a large block, and as a share of the numbered cells: contacts that no third
            cell confirms join it to no other such one. Measured: rule "firm contacts".
        contact: of the cells' contacts and maps.
    """

    max_median_jump: float = 0.6
    max_jump_share: float = 0.25
    max_single_jump: float = 0.9
    max_gap: float = 5.0
    max_gap_ratio: float = 1.5
    min_slope_spread: float = 0.05
    reference_candidates: int = 3
    white_cell_neighbours: int = 5
    min_white_cell_neighbours: int = 3
    max_white_cell_misfit: float = 1.0
    max_contact_jump: float = 0.5
    min_block_cells: int = 20
    min_block_share: float = 0.02
    contact: CornerContactLimits = CONTACT_LIMITS


LIMITS = GapCheckLimits()


def is_white_cell_contradicted(
    center_px: NDArray[np.float64],
    is_intact: NDArray[np.bool_],
    cell: NDArray[np.int32],
    white_px: NDArray[np.float64],
    white_mm: NDArray[np.float64],
    layout: LayoutCells,
) -> bool:
    """Whether the numbered cells nearest to the white cell predict another place of the white cell, by the local
    slopes.

    A part of the pattern that does not touch the white cell may be numbered one step aside. The cells around the white
    cell were then numbered by that part, and contradict the white cell. False where no numbered cell is within reach.

    Args:
        center_px: (N, 2) px; is_intact: (N,) bool, as in ``Cells``.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        white_px, white_mm: (2,) the white cell's center in the image and in the layout.
        layout: the layout's cells.
    """
    known = center_px, is_intact, cell
    return bool(native.is_white_cell_contradicted(*known, white_px, white_mm, layout, LIMITS))
