"""The code of a layout as rows of bits, for the reading of coded pads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.lattice import axial_coordinates
from extractor.layout.reference import BLACK, WHITE, Reference

MAX_CODE_LAYERS = 30  # a row is one number of 64 bits


class CodeBoard(NamedTuple):
    """The down-cells of a layout: bit q of row r is the cell with the axial place (q - origin, r - origin).

    Attributes:
        white: (S,) uint64, the white cells.
        cells: (S,) uint64, the black and the white cells.
        origin: the row and the bit of the down-cell (0, 0).
    """

    white: NDArray[np.uint64]
    cells: NDArray[np.uint64]
    origin: int


def code_board(layout: Reference) -> CodeBoard:
    """The board of a triangular layout of at most ``MAX_CODE_LAYERS`` layers.

    Raises:
        ValueError: the layout has more layers.
    """
    if layout.layers > MAX_CODE_LAYERS:
        raise ValueError(
            f"{layout.layers} layers are more than {MAX_CODE_LAYERS}; codes of so many are not read"
        )
    size, origin = 2 * layout.layers + 3, layout.layers + 1
    down = np.flatnonzero((layout.cell_color == BLACK) | (layout.cell_color == WHITE))
    # The corners of the down-cell (q, r) add up to (3q - 1, 3r + 2).
    total = axial_coordinates(layout.layer, layout.index)[layout.cell_corners[down]].sum(axis=1)
    place = (total - (-1, 2)) // 3 + origin
    boards = [np.zeros(size, np.uint64), np.zeros(size, np.uint64)]
    for board, chosen in zip(
        boards, (layout.cell_color[down] == WHITE, np.ones(len(down), np.bool_)), strict=True
    ):
        np.bitwise_or.at(
            board, place[chosen, 1], np.left_shift(np.uint64(1), place[chosen, 0].astype(np.uint64))
        )
    return CodeBoard(*boards, origin)
