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
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import Estimate


class CorrectedOutliers(NamedTuple):
    """Markers with outliers at their new places, and their places; the arrays are empty if nothing was found."""

    found: bool
    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    xy_px: NDArray[np.float64]
    agreed: NDArray[np.bool_]
    is_intact: NDArray[np.bool_]


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
    after = native.correct_outliers(topology, estimate, places, profile_weight, view.scale)
    if not after.found:
        return estimate, places
    places = places._replace(xy_px=after.xy_px, agreed=after.agreed, is_intact=after.is_intact)
    return estimate._replace(measured=after.measured, reliable=after.reliable), places
