"""Stage 7: the bits of a coded pad, one witness of a part's motion.

A black place of the pattern is a bit: white or black. Each bit that differs from the layout's has the same log odds
against a motion. By bits alone a motion is accepted if few are wrong, and if chance would hardly make as many white
places agree, or the second best motion has so many more wrong bits that misread bits would not explain its defeat.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.numbering.ink_fields import InkFields


class CodeLimits(NamedTuple):
    """Limits of the witness.

    Attributes:
        wrong_bit: log odds against a motion for each wrong bit. Chosen.
        dark: whiteness up to which a place is black; blurred and milky black stays below. Chosen.
        cells_beside: of the part, at the sides of a place, with fewer of which the place may be hidden. Chosen.
        max_misfit: share of the known bits that are wrong. Derived: less than the eighth in which whole pads differ.
        max_log_chance: natural logarithm of the expected number of motions of another pad that agree as well.
            Measured: ``python -m benchmarks.pad_codes``.
        lead_bits, lead_share: the least number of bits, and the share of the known bits, that the second best motion
            has wrong in addition. Derived: the windows of a code differ in so many bits.
        max_log_chance_with_lead: as ``max_log_chance``, with this lead. Measured: the same command.
        other_bits, other_log_chance: known bits, from which on another code is named as the reason where the best
            motion agrees no better. Chosen.
    """

    wrong_bit: float = 3.0
    dark: float = 0.3
    cells_beside: int = 2
    max_misfit: float = 0.12
    max_log_chance: float = -12.0
    lead_bits: float = 3.0
    lead_share: float = 0.1
    max_log_chance_with_lead: float = -8.0
    other_bits: int = 75
    other_log_chance: float = -4.0


LIMITS = CodeLimits()


class Agreement(NamedTuple):
    """How well a motion agrees with the bits.

    Attributes:
        odds: its log odds.
        known_white: number of the known places that the motion makes white.
        motions: number of the motions that were compared; 1 where the outline decided.
    """

    odds: float
    known_white: int
    motions: int


class CodeBits(NamedTuple):
    """The bits of one part.

    Attributes:
        odds: (D,) float64, of the part's down-cells, ``wrong_bit`` for white, the negative for black, NaN for unknown.
            Their sum at the layout's white cells is the log odds of a motion, but for a constant.
        known: number of the known bits.
        white: number of the white ones among them.
    """

    odds: NDArray[np.float64]
    known: int
    white: int

    @staticmethod
    def of(fields: InkFields, axial: NDArray[np.int32]) -> CodeBits:
        """The bits of a part with the cells (P, 2). A bright place that is no triangle is unknown: glare or dirt."""
        beside = native.cells_beside(axial, fields.down_axial)
        white = fields.is_triangle
        black = (fields.whiteness < LIMITS.dark) & (beside >= LIMITS.cells_beside)
        odds = np.where(white, LIMITS.wrong_bit, np.where(black, -LIMITS.wrong_bit, np.nan))
        return CodeBits(odds, int((white | black).sum()), int(white.sum()))

    def misfit(self, odds: float) -> float:
        """The share of the known bits that are wrong by a motion with these log odds; outside the layout is black."""
        return (self.white - odds / LIMITS.wrong_bit) / max(self.known, 1)

    def is_other(self, best: Agreement) -> bool:
        """Whether the bits contradict the layout's code, by the best motion."""
        wrong = self.misfit(best.odds) * self.known
        is_chance = self.known >= LIMITS.other_bits and self._log_chance(best) > LIMITS.other_log_chance
        return is_chance or wrong > LIMITS.max_misfit * self.known + LIMITS.lead_bits

    def proves(self, best: Agreement, lead: float) -> bool:
        """Whether the bits show the layout's code, and no other one, and where by the best motion.

        Args:
            best: the agreement of this motion.
            lead: log odds over the second best motion.
        """
        leads = lead >= LIMITS.wrong_bit * (LIMITS.lead_bits + LIMITS.lead_share * self.known)
        most = LIMITS.max_log_chance_with_lead if leads else LIMITS.max_log_chance
        return self.misfit(best.odds) <= LIMITS.max_misfit and self._log_chance(best) <= most

    def _log_chance(self, best: Agreement) -> float:
        """The logarithm of the expected number of motions by which chance makes as many white places agree."""
        agreed = round((best.odds / LIMITS.wrong_bit + best.known_white) / 2)
        black = self.known - best.known_white
        ways = sum(
            math.comb(best.known_white, n) * math.comb(black, self.white - n)
            for n in range(agreed, min(best.known_white, self.white) + 1)
        )
        return math.log(max(best.motions, 1)) + math.log(ways) - math.log(math.comb(self.known, self.white))
