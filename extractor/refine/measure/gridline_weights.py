"""The gridlines' weights by their misfit, the lengths of the gridlines, and the markers after a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure as native

SHORTEST_RARITY = 100  # one in so many gridlines is shorter than a short edge; chosen
MIN_NOISE = 0.3  # gray levels; rounding alone makes 0.29
MIN_SIGMA_PX = 0.4  # blur with the pixel; the bare pixel has 0.29


class GridlineWeightLimits(NamedTuple):
    """Limits of the gridlines' weights, of the noise and of a step.

    Attributes:
        min_noise: gray levels. Derived: rounding alone makes 0.29.
        prior_hidden_px: prior deviation of a hidden marker from its prediction. Chosen.
        informed_factor: of the prior information about a hidden marker; markers with more count for the median
            information. Chosen.
        min_information_share: of that median; a marker with less does not guide its neighbours' gridlines. Chosen.
        rim_deviation_px: at the rim, a marker with enough weight and a smaller deviation guides them all the same: the
            map of markers on one side only is less precise. Chosen.
        min_clean_share: of the gridlines with weight 1, from which on the noise is that of all gridlines. Chosen.
        min_marker_weight: mean weight of the gridlines at a marker, for the marker to count. Chosen.
        min_sigma_px: of the blur. Derived: the bare pixel has 0.29.
        max_blur_change: of the blur, in one step. Chosen.
        chance_factor, chance_deviations: of the median misfit, and deviations above it; a misfit up to their sum is
            explained by chance. Chosen.
        min_misfit: gray levels^2; the least misfit by which is divided. Derived: it only keeps a division from failing.
        min_determinant_share, min_determinant: of the squared sum over both ends, and of a gridline without any; the
            least determinant of a gridline's ends by which is divided. Derived: it only keeps a division from failing.
        min_edge_px: of the median length of the edges. Chosen.
    """

    min_noise: float = MIN_NOISE
    prior_hidden_px: float = 1.0
    informed_factor: float = 3.0
    min_information_share: float = 0.04
    rim_deviation_px: float = 0.05
    min_clean_share: float = 0.68
    min_marker_weight: float = 0.3
    min_sigma_px: float = MIN_SIGMA_PX
    max_blur_change: float = 0.3
    chance_factor: float = 1.25
    chance_deviations: float = 5.0
    min_misfit: float = 1e-12
    min_determinant_share: float = 1e-9
    min_determinant: float = 1e-12
    min_edge_px: float = 1.0


LIMITS = GridlineWeightLimits()


def short_edge(xy: NDArray[np.float64], edges: NDArray[np.int32], rarity: int) -> float:
    """The length, px, that all edges exceed except for one in ``rarity``; 0 without any known edge.

    Args:
        xy: (M, 2) px, NaN where unknown.
        edges: (E, 2) marker ids.
        rarity: at least 1.
    """
    return float(native.short_edge(np.ascontiguousarray(xy), np.ascontiguousarray(edges), rarity))
