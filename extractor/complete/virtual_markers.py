"""Virtual markers: points on the gridlines between two markers, numbered by edge and place (section III-B-3).

Along the gridline, a virtual marker is interpolated by the smooth map that the markers define. Across the gridline, it
is measured: the residual of the pixels around it against the synthesis, or against a blurred step where nothing was
drawn, gives the gridline's offset.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.complete.repair import RepairedMarkers
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.synthesis.gridlines import FIRST_RING, local_maps
from extractor.result import Status, VirtualStatus

MAX_MEASURED_OFFSET = 0.08  # of a measured point from the interpolated one, in edges; larger offsets are dirt
BEND_UNCERTAINTY = 0.05  # deviation of the interpolated point, as a share of its distance from the chord


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
    topology: Topology, repaired: RepairedMarkers, points: NDArray[np.float64]
) -> VirtualMarkers:
    """The virtual markers at the fractions (j + 1) / (m + 1) of every edge from its smaller id.

    A virtual marker is lost where either marker of the edge is lost. It is interpolated only where no point was
    measured, as on gridlines with black on both sides, or where the measured point is too far away.

    Args:
        points: (E, m, 3) float64, measured x and y (px) and their variance across the gridline (px^2), NaN for none.
    """
    if points.shape[1] == 0:
        return VirtualMarkers(
            points[..., :2], np.empty((len(points), 0, 2, 2)), np.empty((len(points), 0), np.uint8)
        )
    ring_markers, ring_vectors = topology.ring_markers, topology.ring_vectors
    maps = local_maps(repaired.xy_px, ring_markers, ring_vectors, topology.derivative_stencil)
    known = repaired.status != Status.LOST
    tables = topology.edges, ring_markers, ring_vectors
    return VirtualMarkers(*_locate_on_edges(repaired.xy_px, repaired.cov_px2, known, maps, *tables, points))


@compiled
def _edge_tangent(maps, ring_markers, ring_vectors, a, b, chord):  # type: ignore[no-untyped-def]
    """The map's derivative along the edge at marker a, towards b, px per edge; the chord where it is unknown."""
    for k in range(FIRST_RING):
        if ring_markers[a, k] == b and np.isfinite(maps[a, 0, 0]):
            u, v = ring_vectors[a, k]
            return maps[a, 0, 0] * u + maps[a, 0, 1] * v, maps[a, 1, 0] * u + maps[a, 1, 1] * v
    return chord


@compiled
def _locate_on_edges(xy, cov, known, maps, edges, ring_markers, ring_vectors, points):  # type: ignore[no-untyped-def]
    """The arrays of ``VirtualMarkers``."""
    count, m = points.shape[0], points.shape[1]
    virtual_xy, virtual_cov = np.full((count, m, 2), np.nan), np.full((count, m, 2, 2), np.nan)
    status = np.zeros((count, m), np.uint8)
    for e in range(count):
        a, b = edges[e, 0], edges[e, 1]
        if not (known[a] and known[b]):
            continue
        x0, y0 = xy[a, 0], xy[a, 1]
        cx, cy = xy[b, 0] - x0, xy[b, 1] - y0
        length = np.sqrt(cx * cx + cy * cy)
        tx, ty = cx / length, cy / length
        ax, ay = _edge_tangent(maps, ring_markers, ring_vectors, a, b, (cx, cy))
        bx, by = _edge_tangent(maps, ring_markers, ring_vectors, b, a, (-cx, -cy))
        for j in range(m):
            t = (j + 1.0) / (m + 1.0)
            s = 1.0 - t
            # a cubic Hermite curve through both markers with the map's derivatives there
            end, slope_a, slope_b = t * t * (3 - 2 * t), s * s * t, s * t * t
            x = end * cx + slope_a * ax + slope_b * bx
            y = end * cy + slope_a * ay + slope_b * by
            bend_variance = BEND_UNCERTAINTY**2 * ((x - t * cx) ** 2 + (y - t * cy) ** 2)
            xx = s * s * cov[a, 0, 0] + t * t * cov[b, 0, 0] + bend_variance
            cross = s * s * cov[a, 0, 1] + t * t * cov[b, 0, 1]
            yy = s * s * cov[a, 1, 1] + t * t * cov[b, 1, 1] + bend_variance
            across = (points[e, j, 1] - y0 - y) * tx - (points[e, j, 0] - x0 - x) * ty
            status[e, j] = VirtualStatus.INTERPOLATED
            if abs(across) < MAX_MEASURED_OFFSET * length:  # False for NaN, where no point was measured
                x, y = x - across * ty, y + across * tx
                along2, across2 = xx * tx * tx + 2 * cross * tx * ty + yy * ty * ty, points[e, j, 2]
                xx, cross = along2 * tx * tx + across2 * ty * ty, (along2 - across2) * tx * ty
                yy = along2 * ty * ty + across2 * tx * tx
                status[e, j] = VirtualStatus.MEASURED
            virtual_xy[e, j, 0], virtual_xy[e, j, 1] = x0 + x, y0 + y
            virtual_cov[e, j, 0, 0], virtual_cov[e, j, 1, 1] = xx, yy
            virtual_cov[e, j, 0, 1], virtual_cov[e, j, 1, 0] = cross, cross
    return virtual_xy, virtual_cov, status
