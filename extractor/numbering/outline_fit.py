"""Finds the origin of the lattice by the pattern's outline where no white cell is visible: only if it is unique."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.layout.lattice_tables import Lattice


class OutlineLimits(NamedTuple):
    """Limits of an alignment with the outline.

    Attributes:
        min_seen_share: of the layout's cells must be found. Measured: rule "outline".
        max_outside_share: of the cells found may lie outside at the best alignment: dirt in the mesh. Measured: rule
            "outline".
        min_margin_share: so many more of them must lie outside at every other alignment. Measured: rule "outline
            margin".
        min_margin_cells: the same, as a number of cells. Measured: rule "outline margin".
        shift_margin: lattice steps, by which shifts may exceed the fitting ones. Chosen.
        max_alignments: alignments to try; with more possible ones none is certain. Chosen.
        rim_width: lattice steps from the outermost cells; the cells of this rim are tested first. The result does not
            depend on it. Chosen.
        batch_size: cells that are tested between two comparisons with the limit. Nor on this. Chosen.
    """

    min_seen_share: float = 0.5
    max_outside_share: float = 0.005
    min_margin_share: float = 0.02
    min_margin_cells: int = 5
    shift_margin: int = 3
    max_alignments: int = 200
    rim_width: int = 2
    batch_size: int = 32


LIMITS = OutlineLimits()


def align_to_outline(axial: NDArray[np.int32], lattice: Lattice) -> NDArray[np.int32] | None:
    """Align connected cells with the layout's outline.

    All rotations by 120 degrees and all shifts that map every ink onto itself are tried.

    Args:
        axial: (N, 2) int32, axial coordinates of the connected cells, up to such a rotation and shift;
            ``UNKNOWN_AXIAL`` for the others.
        lattice: the layout.

    Returns:
        (N,) int32, the layout's cell of each cell of the image, or -1; None unless the alignment is unique.
    """
    is_unique, cell = native.align(axial, lattice.axial, lattice.cell_lookup, LIMITS)
    return cell if is_unique else None
