"""The witness of a pad's code: the turn and the shift of a part of the lattice, by its white and black down-cells.

Every motion is scored by the number of cells that differ from the layout. A motion is accepted if few differ, and if
the second best motion has so many more that misread cells alone would not explain its defeat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.layout.code_board import CodeBoard

UNKNOWN, BLACK_BIT, WHITE_BIT = -1, 0, 1


class CodeLimits(NamedTuple):
    """Limits of the witness.

    Attributes:
        dark, bright: contrasts up to which a cell is black, and from which on it is white; unknown between. Black is 0,
            white 1. Chosen.
        glare: contrast from which on a cell is unknown: no ink is so bright. Chosen.
        least_bits: known cells, with fewer of which no place is accepted. Derived: three quarters of the smallest
            window of a code.
        max_misfit: share of known cells that differ. Measured: `python -m benchmarks.pad_codes`.
        lead_bits, lead_share: the least number of cells, and the share of known cells, by which the second best motion
            is worse. Measured: the same command.
        inside_share: of a part's down-cells, that lie in the layout. Chosen.
    """

    dark: float = 0.3
    bright: float = 0.6
    glare: float = 1.6
    least_bits: int = 36
    max_misfit: float = 0.1
    lead_bits: float = 3.0
    lead_share: float = 0.1
    inside_share: float = 0.9


LIMITS = CodeLimits()


class CodePlace(NamedTuple):
    """The best motion of a part.

    Attributes:
        turns, dq, dr: turns by 120 degrees about marker 0, counter-clockwise in the layout, then the shift.
        bits: number of known cells.
        wrong: number of known cells that differ from the layout.
        lead: number of cells by which the second best motion is worse; ``bits`` if there is no second one.
    """

    turns: int
    dq: int
    dr: int
    bits: int
    wrong: int
    lead: int

    @property
    def is_certain(self) -> bool:
        """Whether the code alone proves the place."""
        return (
            self.bits >= LIMITS.least_bits
            and self.wrong <= LIMITS.max_misfit * self.bits
            and self.lead >= LIMITS.lead_bits + LIMITS.lead_share * self.bits
        )


def code_bits(contrast: NDArray[np.float64]) -> NDArray[np.int8]:
    """(D,) 1 white, 0 black, -1 unknown, of contrasts (D,) over the black around; NaN is unknown."""
    with np.errstate(invalid="ignore"):
        is_white = (contrast >= LIMITS.bright) & (contrast < LIMITS.glare)
        is_black = contrast <= LIMITS.dark
    return np.where(is_white, WHITE_BIT, np.where(is_black, BLACK_BIT, UNKNOWN)).astype(np.int8)


def code_place(
    axial: NDArray[np.int32], bit: NDArray[np.int8], board: CodeBoard, are_inks_known: bool = True
) -> CodePlace | None:
    """The best place of a part of a coded pad; None where no motion carries the part into the layout.

    Args:
        axial: (D, 2) int32, the part's down-cells in a frame of its own.
        bit: (D,) int8, see ``code_bits``.
        board: the layout.
        are_inks_known: the frame's classes (q - r) mod 3 are those of the layout, up to a motion that keeps the inks.
    """
    least = int(np.ceil(LIMITS.inside_share * len(axial)))
    motions, wrong = native.code_motions(axial, bit, board, least, are_inks_known, 2)
    if len(wrong) == 0:
        return None
    turns, dq, dr = (int(value) for value in motions[0])
    bits = int(np.count_nonzero(bit != UNKNOWN))
    lead = int(wrong[1] - wrong[0]) if len(wrong) > 1 else bits
    return CodePlace(turns, dq, dr, bits, int(wrong[0]), lead)
