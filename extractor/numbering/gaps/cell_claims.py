"""Assigns cells without a number to free cells of the layout, beginning with the cells nearest to numbered cells."""

from __future__ import annotations

from typing import NamedTuple

from extractor.localmap.quadratic_map import LIMITS as MAP_LIMITS
from extractor.localmap.quadratic_map import QuadraticMapLimits


class CellClaimLimits(NamedTuple):
    """Limits of assignments.

    Attributes:
        joint_gap: cells not farther than this from a numbered one, in cells, are numbered in one round. Measured: rule
            "nearest first".
        joint_gap_ratio: so are cells not farther than this many times the least gap. Chosen.
        max_place_misfit: in cells, between a cell's predicted place and the layout's cell. Cells of one ink are 1.7
            cells apart, so that a smaller misfit is unambiguous. Chosen.
        rival_distance: in cells, between possible fragments of one cell; the next cell of the ink is at 1.7. Chosen
            below that.
        max_gap_ratio: of ``maps.max_support_distance``, the gap from which on a cell is not evaluated; a map would be
            uncertain there. Chosen.
        maps: of the quadratic maps.
    """

    joint_gap: float = 1.7
    joint_gap_ratio: float = 1.25
    max_place_misfit: float = 0.3
    rival_distance: float = 1.5
    max_gap_ratio: float = 2.0
    maps: QuadraticMapLimits = MAP_LIMITS


LIMITS = CellClaimLimits()
