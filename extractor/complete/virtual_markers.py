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
from extractor.refine.synthesis.gridlines import local_maps
from extractor.result import Status


class VirtualLimits(NamedTuple):
    """Limits of virtual markers.

    Attributes:
        max_measured_offset: in edges, of a measured point from the interpolated one; larger offsets are dirt. Chosen.
        bend_uncertainty: deviation of the interpolated point, as a share of its distance from the chord. Chosen.
    """

    max_measured_offset: float = 0.08
    bend_uncertainty: float = 0.05


LIMITS = VirtualLimits()


class GridlineEnds(NamedTuple):
    """The M markers between which virtual ones lie.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2) float64.
        known: (M,) bool.
        maps: (M, 2, 5) float64, the local map at each marker.
        scatter: of the markers.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    known: NDArray[np.bool_]
    maps: NDArray[np.float64]
    scatter: MarkerScatter


class VirtualMarkers(NamedTuple):
    """m virtual markers on each of E edges.

    Attributes:
        xy_px, cov_px2: (E, m, 2) and (E, m, 2, 2) float64, NaN where lost.
        status: (E, m) uint8, a ``VirtualStatus`` each.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


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
    if points.shape[1] == 0:
        return VirtualMarkers(
            points[..., :2], np.empty((len(points), 0, 2, 2)), np.empty((len(points), 0), np.uint8)
        )
    maps = local_maps(
        repaired.xy_px, topology.ring_markers, topology.ring_vectors, topology.derivative_stencil
    )
    ends = GridlineEnds(repaired.xy_px, repaired.cov_px2, repaired.status != Status.LOST, maps, scatter)
    return VirtualMarkers(*native.locate_on_edges(ends, topology, points, LIMITS))
