"""The ground of a layout, cells and border, as triangles with common corners."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.scene.camera.plain import pitch_mm

Points = NDArray[np.float64]


@lru_cache(maxsize=4)
def ground_patches(layout: Layout) -> Points:
    """(P, 3, 2) mm: triangles that fill a layout's outline, counter-clockwise from the front.

    First the cells in their order (of square cells the first half of each, then the second), then the border.
    """
    corners = layout.marker_xy_mm[layout.cell_corners]
    fans = [corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)]
    found = np.concatenate([*fans, _border_triangles(layout, corners)])
    found.setflags(write=False)
    return found


def _border_triangles(layout: Layout, cells_mm: Points) -> Points:
    """(B, 3, 2) mm: triangles of the outline without the cells, of about the cells' size."""
    import shapely

    inner = shapely.union_all(shapely.polygons(cells_mm))
    ring = shapely.segmentize(shapely.difference(shapely.Polygon(layout.outline_mm), inner), pitch_mm(layout))
    triangles = [
        np.asarray(part.exterior.coords)[:3]
        for piece in shapely.get_parts(shapely.get_parts(ring))
        for part in shapely.get_parts(shapely.constrained_delaunay_triangles(piece))
    ]
    border = np.array(triangles).reshape(-1, 3, 2)
    first_side, second_side = border[:, 1] - border[:, 0], border[:, 2] - border[:, 0]
    clockwise = first_side[:, 0] * second_side[:, 1] < first_side[:, 1] * second_side[:, 0]
    border[clockwise] = border[clockwise][:, ::-1]
    return border


@lru_cache(maxsize=8)
def subdivide_triangle(parts: int) -> tuple[Points, NDArray[np.int64]]:
    """A triangle with sides divided into ``parts``: barycentric nodes (K, 3) and triangles (parts^2, 3) of nodes."""
    i, j = (index.ravel() for index in np.indices((parts + 1, parts + 1)))
    kept = i + j <= parts
    number = np.full((parts + 1, parts + 1), -1)
    number[i[kept], j[kept]] = np.arange(kept.sum())
    nodes = np.stack([parts - i[kept] - j[kept], i[kept], j[kept]], axis=-1) / parts
    up = [(number[a, b], number[a + 1, b], number[a, b + 1]) for a in range(parts) for b in range(parts - a)]
    down = [
        (number[a + 1, b], number[a + 1, b + 1], number[a, b + 1])
        for a in range(parts)
        for b in range(parts - a - 1)
    ]
    return nodes, np.array(up + down)
