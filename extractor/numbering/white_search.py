"""Searches the white cell, which fixes the rotation and the origin of a numbering.

The white cell is a down-cell; all other down-cells are black. Therefore it is searched at the predicted down-cells:
first in the middle between three numbered cells, and farther away only if it is not found there. The white cell fills
its triangle and ends at its sides; dirt or a reflection on a black cell hardly ever does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.cell_prediction import LIMITS as PREDICTION_LIMITS
from extractor.localmap.cell_prediction import CellPredictionLimits
from extractor.numbering.white_cell import LIMITS as WHITE_CELL_LIMITS
from extractor.numbering.white_cell import WhiteCellLayout, WhiteCellLimits
from extractor.numbering.whiteness import LIMITS as WHITENESS_LIMITS
from extractor.numbering.whiteness import WhitenessLimits


class WhiteSearchLimits(NamedTuple):
    """Limits of the search.

    Brightness is the sum of the channels, relative to that of the inks around.

    Attributes:
        min_white_ratio: brightness of white; blurred black stays below 0.5, dim white is brighter than any ink. Chosen.
        max_white_candidates: places tried in a ring, the brightest. Chosen.
        min_weakest_channel: least whiteness. Chosen.
        min_weakest_channel_far: the same where no walked cell touches the place. Chosen.
        cell, prediction, whiteness: of the modules that do these steps.
    """

    min_white_ratio: float = 0.75
    max_white_candidates: int = 16
    min_weakest_channel: float = 0.5
    min_weakest_channel_far: float = 0.75
    cell: WhiteCellLimits = WHITE_CELL_LIMITS
    prediction: CellPredictionLimits = PREDICTION_LIMITS
    whiteness: WhitenessLimits = WHITENESS_LIMITS


LIMITS = WhiteSearchLimits()


class LayoutPlacement(NamedTuple):
    """A way to place the walked cells in the layout.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        inside, outside: how many walked cells lie in the layout, and how many do not.
        missing: how often a neighbour of a walked cell lies in the layout and in the image, but was not found.
        fits: hardly any walked cell lies outside the layout.
        white_px: (2,) the center of the white cell.
        white_adjacent: walked cells touch the white cell.
    """

    cell: NDArray[np.int32]
    inside: int
    outside: int
    missing: int
    fits: bool
    white_px: NDArray[np.float64]
    white_adjacent: bool


class _WhiteCandidates(NamedTuple):
    """P bright places, the brightest first.

    Attributes:
        known: number of the walked cells with enough neighbours for a prediction.
        ring: the ring around the known cells in which they were found, -1 if none was found.
        cell: (P, N) int32, the layout's cell of each cell of the image, or -1.
        inside: (P,) int64, how many known cells lie in the layout; 0 where the white cell is not there.
        missing: (P,) int64, see ``LayoutPlacement``.
        center_px: (P, 2) float64, the center of the white cell, NaN where it is not there.
        fits: (P,) bool, hardly any known cell lies outside the layout.
    """

    known: int
    ring: int
    cell: NDArray[np.int32]
    inside: NDArray[np.int64]
    missing: NDArray[np.int64]
    center_px: NDArray[np.float64]
    fits: NDArray[np.bool_]


def placements_by_white_cell(
    image: NDArray[np.uint8], cells: Cells, lattice: Lattice, axial: NDArray[np.int32]
) -> list[LayoutPlacement]:
    """All placements with the white cell at a bright place; one placement has hardly any cell outside the layout.

    The other places are white cells, too, but the walked cells around them are not this layout.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        cells: the cells of the image.
        lattice: the layout.
        axial: (N, 2) int32, the cells' axial coordinates, up to rotations and translations; ``UNKNOWN_AXIAL`` for cells
            not walked to.
    """
    frame = lattice.white_cell_frame
    layout = WhiteCellLayout(lattice.layers, lattice.cell_lookup, *frame, lattice.center_mm)
    found = _WhiteCandidates(*native.search_white_cell(image, cells, axial, layout, LIMITS))
    return [
        LayoutPlacement(
            found.cell[n],
            inside,
            found.known - inside,
            int(found.missing[n]),
            bool(found.fits[n]),
            found.center_px[n],
            found.ring == 0,
        )
        for n, inside in enumerate(found.inside.tolist())
        if inside > 0
    ]
