"""The witnesses of a part's motion: their weights, the white cell, and the prior of the map to other parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numbering.ink_fields import LIMITS, InkFields


class WitnessLimits(NamedTuple):
    """Weights of the witnesses of a part's motion.

    Attributes:
        outside_weight: log odds against a motion for each cell outside the layout. Chosen.
        max_outside_share: of a part's cells outside the layout. Chosen.
        min_outside: cells outside the layout that any part may have. Chosen.
        trimmed_share: of a part's cells at each end, without which it fits into the layout. Chosen.
        max_motions: the best motions, that are looked at. Chosen.
    """

    outside_weight: float = 3.0
    max_outside_share: float = 0.1
    min_outside: int = 3
    trimmed_share: float = 0.03
    max_motions: int = 100


class WhiteLimits(NamedTuple):
    """The witness of the white cell.

    Attributes:
        dark: whiteness of a black cell; blurred and milky black stays below. Chosen.
        white_is_bright: probability that the white cell is bright. Chosen.
        white_is_dark: log odds against a dark place. Chosen.
        usual_bright: number of bright black cells of an image in which none is seen. Chosen.
        is_triangle: more log odds for a bright place with the triangle of a down-cell. Chosen.
        max_without_triangle: log odds of any other bright place; a drop and glare are bright, too. Chosen.
    """

    dark: float = 0.3
    white_is_bright: float = 0.9
    white_is_dark: float = -3.0
    usual_bright: float = 0.2
    is_triangle: float = 4.0
    max_without_triangle: float = 3.0


class MapPrior(NamedTuple):
    """The prior of local maps. Lengths are in edges; a term of degree k has the unit edge per edge^k.

    Attributes:
        noise: standard deviation of a cell's center. Chosen.
        quadratic: of the terms of degree 2. Chosen.
        cubic: of the terms of degree 3. Chosen.
    """

    noise: float = 0.08
    quadratic: float = 0.05
    cubic: float = 0.01


class AttachmentLimits(NamedTuple):
    """Limits of parts that are registered against placed ones.

    Attributes:
        prior: of the map. Chosen, see ``MapPrior``.
        known_cells: placed cells through which a map goes. Chosen.
        judged_cells: cells of a part by which its motion is judged, those nearest to placed ones. Chosen.
        max_rounds: passes over all parts. Chosen.
        stiffness: of the prior's terms, in the map that looks for places. Chosen.
        reach: in edges, beyond the nearest place, the farthest of the places that are tried for a cell. Chosen.
        reach_deviations: of the map, of these places beyond the neighbours. Chosen.
        max_corner_misfit: in edges, between a cell's corners and those of the map; a triangle that points the other way
            has 1.15. Chosen.
        max_misfit: mean log likelihood of the judged cells of an accepted part. Chosen.
        outside_odds: log likelihood of a cell that lies outside, on a taken place, or nowhere near. Chosen.
        margin: lead of the best motion. Chosen.
        margin_of_misfit: the same, in addition, relative to the misfit of the best motion. Chosen.
        with_single_cells: cells without a part are registered, too. Measured: rule "single cells".
    """

    prior: MapPrior = MapPrior()
    known_cells: int = 36
    judged_cells: int = 16
    max_rounds: int = 6
    stiffness: float = 0.1
    reach: float = 3.2
    reach_deviations: float = 4.0
    max_corner_misfit: float = 0.6
    max_misfit: float = 8.0
    outside_odds: float = -12.5
    margin: float = 6.0
    margin_of_misfit: float = 2.5
    with_single_cells: bool = True


WITNESSES = WitnessLimits()
WHITE = WhiteLimits()
ATTACHMENT = AttachmentLimits()


class BrightPlaces(NamedTuple):
    """How often a down-cell of an image is bright: the white cell, and black cells under glare, dirt and scratches.

    Attributes:
        known: number of down-cells of which the light is known.
        bright: number of the bright ones among them.
    """

    known: int
    bright: int

    @staticmethod
    def of(parts: list[NDArray[np.float64]]) -> BrightPlaces:
        """Of the whiteness (D,) of the down-cells of each part."""
        return BrightPlaces(
            sum(int(np.isfinite(one).sum()) for one in parts),
            sum(int((one > LIMITS.bright).sum()) for one in parts),
        )

    def white_odds(self, fields: InkFields) -> NDArray[np.float64]:
        """(D,) log odds that a down-cell is the white one over a black one; NaN is unknown."""
        whiteness = fields.whiteness
        others = max(self.bright - 1, 0)
        is_bright = np.log(WHITE.white_is_bright * (self.known + 1.0) / (others + WHITE.usual_bright))
        bright, dark = whiteness > LIMITS.bright, whiteness < WHITE.dark
        is_bright = np.where(
            fields.is_triangle,
            is_bright + WHITE.is_triangle,
            min(float(is_bright), WHITE.max_without_triangle),
        )
        odds = np.where(bright, is_bright, np.where(dark, WHITE.white_is_dark, 0.0))
        return np.where(np.isfinite(whiteness), odds, np.nan)
