"""Markers that contradict their neighbours, because of dirt that looks like a gridline.

Two independent criteria must agree: the gridlines of the marker do not look like the pattern, and most gridlines
through the marker show that the map would be smooth if the marker were moved by one vector. The marker then starts
again from the moved place. Sharp bends, at the rim of an object or where it slips, give vectors that differ from one
gridline to the next.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import markers as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import MAX_PLACE_ERROR, InitialMarkers
from extractor.refine.estimate import Estimate
from extractor.refine.synthesis.gridlines import LIMITS as GRIDLINE_LIMITS
from extractor.refine.synthesis.gridlines import GridlineLimits


class OutlierLimits(NamedTuple):
    """Limits of outliers. The native code has room for two ratios and two shifts.

    Attributes:
        min_mean_weight: of the gridlines measured at a marker, below which the marker is suspect. Chosen.
        outlier_ratios: shift of an outlier over that of the markers around, of a suspect marker and of any other.
            Chosen.
        min_outlier_shifts: the least such shifts, in edges. Chosen.
        min_agreeing_share: the gridlines of a marker agree on a shift if more than this share of them do. Chosen.
        min_agreeing_gridlines: the same, as a number of gridlines. Chosen.
        agreement_tolerance: share of a shift, by which the shifts of gridlines that agree may differ. Chosen.
        extrapolated_rings: of outliers that the markers around are continued to. Chosen.
        max_rounds: an outlier hides the errors of its neighbours. Chosen.
        max_place_error: in edges, between a marker's place by its neighbours and a correct initial place. Derived: as
            in ``marker_places``.
        rounding_allowance: of the squared least shift; a marker whose largest differences stay below cannot move.
            Derived: below 1 by more than rounding.
        gridlines: of the maps that continue the markers around.
    """

    min_mean_weight: float = 0.55
    outlier_ratios: tuple[float, float] = (3.0, 6.0)
    min_outlier_shifts: tuple[float, float] = (0.02, 0.03)
    min_agreeing_share: float = 0.7
    min_agreeing_gridlines: int = 3
    agreement_tolerance: float = 0.5
    extrapolated_rings: int = 2
    max_rounds: int = 6
    max_place_error: float = MAX_PLACE_ERROR
    rounding_allowance: float = 0.99
    gridlines: GridlineLimits = GRIDLINE_LIMITS


LIMITS = OutlierLimits()


def correct_outliers(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    profile_weight: NDArray[np.float64],
    places: InitialMarkers,
) -> tuple[Estimate, InitialMarkers]:
    """The estimate and the places, outliers put where their neighbours predict them.

    Args:
        view: the image.
        topology: of the layout.
        estimate: after the first round of profiles.
        profile_weight: (E,) 0 to 1, similarity of gridlines to the pattern.
        places: of the full image.
    """
    found, measured, reliable, xy, agreed, is_intact = native.correct_outliers(
        topology, estimate, places, profile_weight, view.scale, LIMITS
    )
    if not found:
        return estimate, places
    estimate = estimate._replace(measured=measured, reliable=reliable)
    return estimate, places._replace(xy_px=xy, agreed=agreed, is_intact=is_intact)
