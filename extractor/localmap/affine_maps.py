"""Local linear maps from the layout to the image around every numbered cell, in pixels per millimetre."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined_no_refcount

MIN_SPREAD = 0.2  # least ratio of the neighbours' spread across to along; below it they lie on one line
MAX_MISFIT = 0.3  # of the distance to a neighbour, from its center to the prediction by a triangle
MIN_RIVAL_MISFIT = 0.8  # the same for the triangle rotated by 120 degrees, which mispredicts by 1.7 distances


@compiled
def image_cell_of_layout_cell(cell, count):  # type: ignore[no-untyped-def]
    """Invert the numbering.

    Args:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        count: number U of the layout's cells.

    Returns:
        (U,) int32, the cell of the image that each cell of the layout is, or -1.
    """
    out = np.full(count, -1, np.int32)
    for i in range(cell.shape[0]):
        if cell[i] >= 0:
            out[cell[i]] = i
    return out


@compiled
def linear_maps(center_px, cell, image_cell, layout):  # type: ignore[no-untyped-def]
    """The linear map around each numbered cell, by least squares over its six neighbours.

    The millimetres of the layout contain the pattern's own shape, so a round pattern is no more curved than a
    honeycomb.

    Args:
        center_px: (N, 2) the cells' centers.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        image_cell: (U,) int32, the inverse, by ``image_cell_of_layout_cell``.
        layout: ``LayoutCells``.

    Returns:
        (N, 2, 2) float64, px per mm; NaN without a number and where the neighbours lie on one line.
    """
    out = np.full((cell.shape[0], 2, 2), np.nan)
    for i in range(cell.shape[0]):
        if cell[i] >= 0:
            fill_linear_map(i, center_px, cell[i], image_cell, layout, out[i])
    return out


@inlined_no_refcount
def fill_linear_map(i, center_px, u, image_cell, layout, out):  # type: ignore[no-untyped-def]
    """Write the linear map (2, 2) around cell i of the image, which is the layout's cell u; see ``linear_maps``."""
    xx, xy, yy = 0.0, 0.0, 0.0
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    for k in range(6):
        v = layout.cell_neighbours[u, k]
        if v < 0 or image_cell[v] < 0:
            continue
        j = image_cell[v]
        x = layout.center_mm[v, 0] - layout.center_mm[u, 0]
        y = layout.center_mm[v, 1] - layout.center_mm[u, 1]
        px, py = center_px[j, 0] - center_px[i, 0], center_px[j, 1] - center_px[i, 1]
        xx += x * x
        xy += x * y
        yy += y * y
        ax += px * x
        ay += px * y
        bx += py * x
        by += py * y
    determinant = xx * yy - xy * xy
    if determinant > MIN_SPREAD * MIN_SPREAD * 0.25 * (xx + yy) ** 2:
        out[0, 0], out[0, 1] = (ax * yy - ay * xy) / determinant, (ay * xx - ax * xy) / determinant
        out[1, 0], out[1, 1] = (bx * yy - by * xy) / determinant, (by * xx - bx * xy) / determinant
    else:
        out[0, 0], out[0, 1], out[1, 0], out[1, 1] = np.nan, np.nan, np.nan, np.nan


@compiled
def _fill_map_from_triangle(vectors_mm, corner_px, center_px, first_corner, corner_step, out):  # type: ignore[no-untyped-def]
    """Write the linear map that carries a cell's corners 0 and 1 onto a triangle of the image.

    Args:
        vectors_mm: (3, 2) from the layout cell's center to its corners 0, 1, 2.
        corner_px: (3, 2) the triangle; center_px: (2,) its center.
        first_corner: the triangle's corner that is corner 0.
        corner_step: corners from one to the next of the cell, clockwise in the image: 1 or 2.
    """
    a, b = vectors_mm[0], vectors_mm[1]
    p, q = corner_px[first_corner] - center_px, corner_px[(first_corner + corner_step) % 3] - center_px
    area = a[0] * b[1] - a[1] * b[0]
    out[:, 0] = (p * b[1] - q * a[1]) / area
    out[:, 1] = (q * a[0] - p * b[0]) / area


@compiled
def _fill_maps_from_triangles(center_px, corner_px, mirrored, cell, image_cell, layout, out):  # type: ignore[no-untyped-def]
    """Write the map of every numbered cell without one that has a triangle and a neighbour to orient it."""
    maps, misfit = np.empty((3, 2, 2)), np.empty(3)
    # clockwise in the image a cell's corners run 0, 2, 1, from the back 0, 1, 2
    corner_step = 1 if mirrored else 2
    for i in range(cell.shape[0]):
        u = cell[i]
        if u < 0 or not np.isnan(out[i, 0, 0]) or np.isnan(corner_px[i, 0, 0]):
            continue
        for first in range(3):
            _fill_map_from_triangle(
                layout.corner_vectors_mm[u], corner_px[i], center_px[i], first, corner_step, maps[first]
            )
        misfit[:] = 0.0
        for k in range(6):
            v = layout.cell_neighbours[u, k]
            if v < 0 or image_cell[v] < 0:
                continue
            x = layout.center_mm[v, 0] - layout.center_mm[u, 0]
            y = layout.center_mm[v, 1] - layout.center_mm[u, 1]
            j = image_cell[v]
            px, py = center_px[j, 0] - center_px[i, 0], center_px[j, 1] - center_px[i, 1]
            for first in range(3):
                m = maps[first]
                distance = np.hypot(px - m[0, 0] * x - m[0, 1] * y, py - m[1, 0] * x - m[1, 1] * y)
                misfit[first] = max(misfit[first], distance / np.hypot(px, py))
        best = misfit.argmin()
        # without a neighbour all misfits are 0
        if misfit[best] < MAX_MISFIT and min(misfit[best - 1], misfit[best - 2]) > MIN_RIVAL_MISFIT:
            out[i] = maps[best]


@compiled
def completed_linear_maps(center_px, corner_px, cell, mirrored, layout):  # type: ignore[no-untyped-def]
    """``linear_maps``, completed by triangles where a cell has too few neighbours, at the rims of holes.

    A cell's own triangle gives its map if a neighbour shows which of its corners is which.

    Args:
        center_px: (N, 2) the cells' centers; corner_px: (N, 3, 2) their triangles, clockwise, or NaN.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        mirrored: the pattern is seen from its back.
        layout: ``LayoutCells``.

    Returns:
        (N, 2, 2) float64, px per mm, or NaN.
    """
    image_cell = image_cell_of_layout_cell(cell, layout.center_mm.shape[0])
    out = linear_maps(center_px, cell, image_cell, layout)
    _fill_maps_from_triangles(center_px, corner_px, mirrored, cell, image_cell, layout, out)
    return out
