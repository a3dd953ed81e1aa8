"""Numbers detached cells, behind a scratch or amid missing cells, by contact or by prediction and color."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from extractor._native import gaps as native
from extractor.cells.cell_mesh import without_swelling
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.numbering.gaps.cell_claims import LIMITS as CLAIM_LIMITS
from extractor.numbering.gaps.cell_claims import CellClaimLimits
from extractor.numbering.gaps.gap_check import LIMITS as CHECK_LIMITS
from extractor.numbering.gaps.gap_check import GapCheckLimits, is_white_cell_contradicted
from extractor.numbering.lattice_walk import Numbering
from extractor.result import Origin, Reason


class DetachedLimits(NamedTuple):
    """Limits of the numbering of detached cells.

    Attributes:
        max_rounds: of the numbering outward. Chosen.
        min_numbered_cells: intact ones, for any prediction. Measured: rule "claims".
        claims: of the assignments by prediction.
        check: of the consistency across gaps, and of the contacts.
    """

    max_rounds: int = 40
    min_numbered_cells: int = 8
    claims: CellClaimLimits = CLAIM_LIMITS
    check: GapCheckLimits = CHECK_LIMITS


LIMITS = DetachedLimits()


def number_detached_cells(cells: Cells, numbering: Numbering, lattice: Lattice, swelling: float) -> Numbering:
    """Number the cells that no face of the mesh connects with the reference cell.

    Cells that share a corner with a numbered cell are its neighbours. Other cells are predicted from the numbered cells
    around them: the prediction must be certain and near a free cell of the layout with the same ink, and no other cell
    may be assigned there. The nearest cells come first. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 is
    unambiguous. Cells inconsistent across the gap, or across damaged cells that connected the mesh, lose their number.
    If the white cell touches no cell that was numbered from the white cell, the cells around it must agree at the end;
    otherwise the numbering is ambiguous. Cells larger than cells that just meet, by the factor ``swelling``, are
    reduced to that size.
    """
    if np.count_nonzero(numbering.cell >= 0) == len(lattice.ink):
        return numbering
    corner_step, white_px = 1 if numbering.mirrored else 2, numbering.white_px
    corner = without_swelling(cells.center_px, cells.corner_px, swelling)
    arrays = cells.arrays._replace(corner_px=corner)
    layout = lattice.layout_cells
    cell = native.number_detached(arrays, numbering.cell, white_px, layout, corner_step, LIMITS)
    if numbering.origin is not Origin.WHITE or numbering.white_adjacent:
        return replace(numbering, cell=cell)
    white_mm = lattice.white_cell_frame[0]
    is_ambiguous = is_white_cell_contradicted(
        cells.center_px, cells.is_intact, cell, white_px, white_mm, layout
    )
    return replace(numbering, cell=cell, doubt=Reason.AMBIGUOUS if is_ambiguous else None)
