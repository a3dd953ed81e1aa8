"""Virtual markers: points on the gridlines between two markers, numbered by edge and place (section III-B-3).

Along the gridline, a virtual marker is interpolated by the smooth map that the markers define. Across the gridline, it
is measured: the residual of the pixels around it against the synthesis, or against a blurred step where nothing was
drawn, gives the gridline's offset.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native
from extractor.complete.repair import RepairedMarkers
from extractor.layout.topology import Topology
from extractor.refine.measure.marker_scatter import MarkerScatter
from extractor.refine.synthesis.gridlines import LIMITS as GRIDLINE_LIMITS
from extractor.refine.synthesis.gridlines import GridlineLimits
from extractor.result import VirtualMarkers


class VirtualLimits(NamedTuple):
    """Limits of virtual markers.

    Attributes:
        max_measured_offset: in edges, of a measured point from the interpolated one; larger offsets are dirt. Chosen.
        bend_uncertainty: deviation of the interpolated point, as a share of its distance from the chord. Chosen.
        gridlines: of the maps between the markers.
    """

    max_measured_offset: float = 0.08
    bend_uncertainty: float = 0.05
    gridlines: GridlineLimits = GRIDLINE_LIMITS


LIMITS = VirtualLimits()


def locate_virtual_markers(
    topology: Topology, repaired: RepairedMarkers, points: NDArray[np.float64], scatter: MarkerScatter
) -> VirtualMarkers:
    """The virtual markers at the fractions (j + 1) / (m + 1) of every edge from its smaller id.

    A virtual marker is lost where either marker of the edge is lost. It is interpolated only where no point was
    measured, as on gridlines with black on both sides, or where the measured point is too far away.

    Args:
        points: (E, m, 3) float64, measured x and y (px) and their variance across the gridline (px^2), NaN for none.
        scatter: of the markers; with scatter, the gridlines curve by the map's second derivatives.
    """
    return VirtualMarkers(*native.locate_on_edges(repaired, scatter, topology, points, LIMITS))
