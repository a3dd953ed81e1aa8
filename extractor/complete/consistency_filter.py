"""Consistency: markers that contradict their neighbours are dropped.

A marker must lie at the place that follows from the map of its two rings.
"""

from __future__ import annotations

from typing import NamedTuple

from extractor.layout.neighbour_tables import LIMITS as NEIGHBOUR_MAP_LIMITS
from extractor.layout.neighbour_tables import NeighbourMapLimits


class ConsistencyLimits(NamedTuple):
    """Limits of markers that do not contradict their neighbours. Distances and deviations are in edges.

    Attributes:
        max_rounds: of rejection; each round drops the worst marker of every neighbourhood. Measured: rule "ring
            outliers".
        max_distance: between a marker and its prediction by two rings. Measured:
            `python -m benchmarks.acceptance`.
        max_predicted_deviation: of the prediction of a marker that only two triangles confirm. Measured: rule
            "confirmed".
        max_unexplained_distance: of a marker that is obstructed, and the deviation of its prediction. Measured: rule
            "unexplained".
        maps: limits of the predictions.
    """

    max_rounds: int = 40
    max_distance: float = 0.14
    max_predicted_deviation: float = 0.12
    max_unexplained_distance: float = 0.06
    maps: NeighbourMapLimits = NEIGHBOUR_MAP_LIMITS


LIMITS = ConsistencyLimits()
