"""Virtual markers: points on the gridlines between two markers, numbered by edge and place (section III-B-3).

Along the gridline, a virtual marker is interpolated by the smooth map that the markers define. Across the gridline, it
is measured: the residual of the pixels around it against the synthesis, or against a blurred step where nothing was
drawn, gives the gridline's offset.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native
from extractor.complete.repair import RepairedMarkers
from extractor.layout.topology import Topology
from extractor.refine.measure.marker_scatter import MarkerScatter
from extractor.result import VirtualMarkers


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
    return native.locate_on_edges(repaired, scatter, topology, points)
