"""Repair: markers that contradict their neighbours are dropped, and lost markers are repaired where their neighbours
leave no doubt.

Mild omission (the article's eq. 6): the triangles around a lost marker give its place; here all markers of two rings
give it, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers of the same layer and
sextant, read at equidistant places. A marker that neither method predicts within a tenth of an edge stays lost.

The prediction by the rings of an uncertain marker, as under dirt, may be better than its measurement: both are
combined.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native
from extractor.layout.lattice_tables import Lattice
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import RefinedMarkers


class RepairedMarkers(NamedTuple):
    """Markers after repair.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2) float64, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


def repair_markers(
    refined: RefinedMarkers, places: InitialMarkers, lattice: Lattice, size: tuple[int, int]
) -> RepairedMarkers:
    """Drop inconsistent markers, repair lost markers that the others predict, and combine uncertain markers with
    predictions.

    Args:
        refined: the markers after refinement.
        places: the markers before refinement.
        size: width and height of the image, px; no marker is reported outside the image.
    """
    return native.repair_markers(refined, places, lattice.ring_tables, size)
