"""Virtual markers: points on the gridlines between two markers, numbered by edge and place (section III-B-3).

Along its gridline a virtual marker is interpolated: through the smooth map that the markers define. Across it, it is
measured, by the pixels around it: what they show beyond the drawn pattern, or beyond a blurred step where none was
drawn, tells how far the gridline lies off.
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

MAX_MEASURED_OFFSET = 0.08  # of a measured point from the interpolated one, in edges: more is dirt
BEND_UNCERTAINTY = 0.05  # of the way from the chord to the cubic may be wrong


class VirtualMarkers(NamedTuple):
    """(E, m, 2) places, (E, m, 2, 2) covariances, (E, m) status; NaN and 0 where lost."""

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]


def locate_virtual_markers(
    mesh: Topology, repaired: RepairedMarkers, points: NDArray[np.float64]
) -> VirtualMarkers:
    """The virtual markers at the fractions (j + 1) / (m + 1) of every edge from its smaller id.

    Args:
        points: (E, m, 3) measured points and their variance across, NaN where there is none.

    Lost where either marker of the edge is; interpolated where nothing was measured, as on gridlines that border black
    on both sides, or where what was measured lies too far off to be the gridline.
    """
    if points.shape[1] == 0:
        return VirtualMarkers(
            points[..., :2], np.empty((len(points), 0, 2, 2)), np.empty((len(points), 0), np.uint8)
        )
    maps = local_maps(repaired.xy_px, mesh.ring_markers, mesh.ring_vectors, mesh.derivative_stencil)
    known = repaired.status != Status.LOST
    tables = mesh.edges, mesh.ring_markers, mesh.ring_vectors
    return VirtualMarkers(*_locate_on_edges(repaired.xy_px, repaired.cov_px2, known, maps, *tables, points))


@compiled
def _edge_tangent(maps, near, offset, a, b, chord):  # type: ignore[no-untyped-def]
    """The map's derivative along the edge at marker a, towards b; the chord where it is not known."""
    for k in range(FIRST_RING):
        if near[a, k] == b and np.isfinite(maps[a, 0, 0]):
            u, v = offset[a, k]
            return maps[a, 0, 0] * u + maps[a, 0, 1] * v, maps[a, 1, 0] * u + maps[a, 1, 1] * v
    return chord


@compiled
def _locate_on_edges(xy, cov, known, maps, edges, near, offset, points):  # type: ignore[no-untyped-def]
    count, m = points.shape[0], points.shape[1]
    places, spread = np.full((count, m, 2), np.nan), np.full((count, m, 2, 2), np.nan)
    status = np.zeros((count, m), np.uint8)
    for e in range(count):
        a, b = edges[e, 0], edges[e, 1]
        if not (known[a] and known[b]):
            continue
        x0, y0 = xy[a, 0], xy[a, 1]
        cx, cy = xy[b, 0] - x0, xy[b, 1] - y0
        length = np.sqrt(cx * cx + cy * cy)
        tx, ty = cx / length, cy / length
        ax, ay = _edge_tangent(maps, near, offset, a, b, (cx, cy))
        bx, by = _edge_tangent(maps, near, offset, b, a, (-cx, -cy))
        for j in range(m):
            t = (j + 1.0) / (m + 1.0)
            s = 1.0 - t
            # a cubic through both markers with the map's derivatives there
            end, leave, arrive = t * t * (3 - 2 * t), s * s * t, s * t * t
            x = end * cx + leave * ax + arrive * bx
            y = end * cy + leave * ay + arrive * by
            hidden = BEND_UNCERTAINTY**2 * ((x - t * cx) ** 2 + (y - t * cy) ** 2)
            xx = s * s * cov[a, 0, 0] + t * t * cov[b, 0, 0] + hidden
            cross = s * s * cov[a, 0, 1] + t * t * cov[b, 0, 1]
            yy = s * s * cov[a, 1, 1] + t * t * cov[b, 1, 1] + hidden
            across = (points[e, j, 1] - y0 - y) * tx - (points[e, j, 0] - x0 - x) * ty
            status[e, j] = VirtualStatus.INTERPOLATED
            if abs(across) < MAX_MEASURED_OFFSET * length:  # not where there is none
                x, y = x - across * ty, y + across * tx
                along, aside = xx * tx * tx + 2 * cross * tx * ty + yy * ty * ty, points[e, j, 2]
                xx, cross = along * tx * tx + aside * ty * ty, (along - aside) * tx * ty
                yy = along * ty * ty + aside * tx * tx
                status[e, j] = VirtualStatus.MEASURED
            places[e, j, 0], places[e, j, 1] = x0 + x, y0 + y
            spread[e, j, 0, 0], spread[e, j, 1, 1] = xx, yy
            spread[e, j, 0, 1], spread[e, j, 1, 0] = cross, cross
    return places, spread, status
