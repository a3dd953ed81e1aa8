"""The gridlines between the current markers: cubic curves of the smooth map that the markers define.

Gridlines are straight in the layout; the map to the image curves them. The map's derivative at every marker is
estimated from the two rings of neighbours, and gives the direction of each gridline at that marker. The gridline is the
cubic between two markers with these directions, as in a C1-smooth interpolation of the map (Clough-Tocher).

Where markers scatter independently, the directions are wrong, and the sides of cells are straight. There a gridline
curves by the map's second derivatives (``marker_scatter``), inside the pattern; at the rim these count as 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import synthesis as native


def local_maps(
    xy: NDArray[np.float64],
    near: NDArray[np.int32],
    offset: NDArray[np.float64],
    stencil: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The local map at each marker.

    Where all markers of the stencil are known, the derivatives are by the stencil. Elsewhere they are those of a
    quadratic through the known ones, whose second derivatives are regularised towards 0 and are 0 where fewer than five
    are known.

    Args:
        xy: (M, 2) px, NaN where unknown.
        near, offset, stencil: ``ring_markers``, ``ring_vectors`` and ``derivative_stencil`` of ``Topology``.

    Returns:
        (M, 2, 5): derivatives of x and y by the layout's x, y, xx, xy, yy; NaN where unknown.
    """
    return native.local_maps(xy, near, offset, stencil)


def gridlines(
    xy: NDArray[np.float64],
    maps: NDArray[np.float64],
    bend: NDArray[np.float64],
    edges: NDArray[np.int32],
    along: NDArray[np.float64],
    scatter_share: float,
) -> NDArray[np.float64]:
    """The gridlines between markers.

    Args:
        xy: (M, 2) px, the markers. maps: (M, 2, 5), as ``local_maps`` gives them.
        bend: (E, 2) px, b and s of ``gridline_bending``, which add to the slopes.
        edges: (E, 2) marker ids. along: (E, 2) ``Topology.edge_vectors``.
        scatter_share: 0 to 1, weight of the slopes of the cubic over those of the maps' tangents; the cubic has the
            maps' second derivatives at both ends.

    Returns:
        (E, 8): start and unit vector of the chord, its length, px; slopes against the chord at both ends, towards
        (-uy, ux); 1 where known. All 0 where unknown.
    """
    return native.gridlines(xy, maps, bend, edges, along, scatter_share)
