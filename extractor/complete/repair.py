"""Stage 8: markers that contradict their neighbours are dropped, and lost markers are repaired where their neighbours
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
from extractor.complete.consistency_filter import LIMITS as CONSISTENCY_LIMITS
from extractor.complete.consistency_filter import ConsistencyLimits
from extractor.complete.layer_arcs import LIMITS as LAYER_LIMITS
from extractor.complete.layer_arcs import LayerLimits
from extractor.complete.uncertain_markers import LIMITS as UNCERTAIN_LIMITS
from extractor.complete.uncertain_markers import UncertainLimits
from extractor.layout.lattice_tables import Lattice
from extractor.layout.neighbour_tables import LIMITS as NEIGHBOUR_MAP_LIMITS
from extractor.layout.neighbour_tables import NeighbourMapLimits
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import RefinedMarkers


class RepairLimits(NamedTuple):
    """Limits of repaired markers. Distances and deviations are in edges, unless stated otherwise.

    The variance of a repaired marker has two parts. The stated errors of its neighbours are independent: each counts by
    the squared weight of the neighbour. The other part is the departure of the surface from the map, the larger of two
    estimates. By the neighbours' residuals: their deviation beyond noise counts ``mild_error`` * leverage times, as a
    smooth surface departs the more from the map the farther this extrapolates. By cross-validation: the neighbours are
    predicted from their own rings, too, and the variance of their departures beyond noise, over 1 + leverage, is that
    of markers that scatter. Measurements that were dropped as inconsistent count among these departures: where a whole
    row of them contradicts the map, as under a rolling shutter, the map may be what is wrong. The variance of a fitted
    marker has two parts, too (``layer_arcs``).

    Attributes:
        mild_support: known neighbours of two rings that make an omission mild. Chosen.
        max_repaired_deviation: of a repaired marker: three such deviations stay below a quarter of an edge. Derived.
        max_fitted_deviation: of a fitted marker: a layer's quadratic is wrong where the surface is bent. Measured: rule
            "repair by layer".
        max_leverage: of the neighbours' errors on a repaired marker. Measured: rule "repair by rings".
        model_deviation: deviation of a smooth surface from a quadratic map. Chosen.
        fitted_model_sigmas: such deviations that are added to a layer's residual before it is compared with
            ``max_fitted_deviation``. Chosen.
        mild_error: times leverage, of the departure by residuals. Measured: `python -m benchmarks.calibration` prints z
            of repaired markers.
        picture_departures: departures, as many as those of the whole picture count beside those around a marker.
            Chosen.
        own_departures: as many as that of a marker's own dropped measurement counts. Chosen: with 1, a third of the
            markers that a wobble of 3 to 6 px moves were repaired with too small a deviation.
        layers: limits of a layer's quadratic.
        maps: limits of the predictions by neighbours.
        consistency: limits of markers that do not contradict their neighbours.
        uncertain: limits of uncertain markers.
    """

    mild_support: int = 10
    max_repaired_deviation: float = 0.08
    max_fitted_deviation: float = 0.05
    max_leverage: float = 1.2
    model_deviation: float = 0.012
    fitted_model_sigmas: float = 3.0
    mild_error: float = 1.2
    picture_departures: float = 4.0
    own_departures: float = 4.0
    layers: LayerLimits = LAYER_LIMITS
    maps: NeighbourMapLimits = NEIGHBOUR_MAP_LIMITS
    consistency: ConsistencyLimits = CONSISTENCY_LIMITS
    uncertain: UncertainLimits = UNCERTAIN_LIMITS


LIMITS = RepairLimits()


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
    return RepairedMarkers(*native.repair_markers(refined, places, lattice.ring_tables, size, LIMITS))
