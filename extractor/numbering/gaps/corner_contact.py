"""Cells in contact: neighbours in the pattern share a corner; a triangle's ink and corner determine its number.

The only extrapolation is by one cell's own triangle to its neighbour, and back. Cells connected by corners are numbered
alike, wherever damage has cut the mesh (the article's eqs. 4 and 5).

``corner_step`` is the number of corners from one corner of the layout's cell to the next, clockwise in the image: 1
from the back, 2 from the front. ``first_corner`` is the triangle's corner that is corner 0 of the layout's cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.localmap.affine_maps import fill_linear_map, image_cell_of_layout_cell
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.nearest_points import bucket_grid, fill_nearest_points

MAX_CORNER_DISTANCE = 0.3  # of the shorter edge, between the corners of two triangles at one marker
MAX_PREDICTED_DISTANCE = 0.35  # of two neighbours' distance, from a center to the other triangle's prediction
MAX_MAP_DIFFERENCE = 0.5  # between two cells' maps, of a map's size; a rotation by 120 degrees makes 1.7
NOT_EVALUATED = -2
MAX_NEIGHBOUR_DISTANCE = 1.6  # of an edge, between the centers of neighbours without triangles
# A cell and its neighbour along ``NEIGHBOUR_STEPS`` share this corner of the cell, and this one of the neighbour.
OWN_CORNER = np.array([1, 2, 2, 0, 0, 1])
NEIGHBOUR_CORNER = np.array([0, 0, 1, 1, 2, 2])


class PartialNumbering(NamedTuple):
    """A numbering in progress, of N cells of the image and U of the layout; updated in place.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        free: (U,) bool, the layout's cells without a cell of the image.
        first_corner: (N,) int64, which corner of a numbered cell's triangle is corner 0; -1 unknown,
            ``NOT_EVALUATED`` before the first use.
        maps: (N, 2, 2) float64, px per mm, by ``first_corner``.
        image_cell: (U,) int32, the cells of the image at the beginning, or -1; they orient triangles.
    """

    cell: NDArray[np.int32]
    free: NDArray[np.bool_]
    first_corner: NDArray[np.int64]
    maps: NDArray[np.float64]
    image_cell: NDArray[np.int32]


@compiled
def begin_numbering(cell, free):  # type: ignore[no-untyped-def]
    """The ``PartialNumbering`` that starts from copies of ``cell`` (N,) and ``free`` (U,)."""
    return PartialNumbering(
        cell.copy(),
        free.copy(),
        np.full(cell.shape[0], NOT_EVALUATED, np.int64),
        np.empty((cell.shape[0], 2, 2)),
        image_cell_of_layout_cell(cell, free.shape[0]),
    )


@inlined_no_refcount
def equilateral_edge(area):  # type: ignore[no-untyped-def]
    """The edge of an equilateral triangle."""
    return np.sqrt(area * 4.0 / np.sqrt(3.0))


@inlined_no_refcount
def triangle_map(cells, i, layout, u, first_corner, corner_step):  # type: ignore[no-untyped-def]
    """The linear map, px per mm, that carries the corners of the layout's cell u onto the triangle of cell i.

    Returns the four entries, row by row.
    """
    center, corner, vectors = cells.center_px, cells.corner_px, layout.corner_vectors_mm
    ax, ay, bx, by = vectors[u, 0, 0], vectors[u, 0, 1], vectors[u, 1, 0], vectors[u, 1, 1]
    area, after = ax * by - ay * bx, (first_corner + corner_step) % 3
    px, qx = corner[i, first_corner, 0] - center[i, 0], corner[i, after, 0] - center[i, 0]
    py, qy = corner[i, first_corner, 1] - center[i, 1], corner[i, after, 1] - center[i, 1]
    return (
        (px * by - qx * ay) / area,
        (qx * ax - px * bx) / area,
        (py * by - qy * ay) / area,
        (qy * ax - py * bx) / area,
    )


@compiled
def corner_neighbours(cells, cell, layout, corner_step):  # type: ignore[no-untyped-def]
    """The numbered intact cells in contact with each numbered intact cell.

    Cells are in contact if they are neighbours in the layout and share the corner that such neighbours share; where a
    triangle is missing, if their centers are close.

    Args:
        cells: ``CellArrays``. layout: ``LayoutCells``.
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.

    Returns:
        (N, 6) int32, cells of the image in the order of ``NEIGHBOUR_STEPS``, or -1.
    """
    out = np.full((cell.shape[0], 6), -1, np.int32)
    update_corner_neighbours(np.ones(cell.shape[0], np.bool_), cells, cell, layout, corner_step, out)
    return out


@compiled
def update_corner_neighbours(is_new, cells, cell, layout, corner_step, out):  # type: ignore[no-untyped-def]
    """Add to ``corner_neighbours`` (N, 6) the contacts of the newly numbered cells ``is_new`` (N,)."""
    image_cell = image_cell_of_layout_cell(cell, layout.ink.shape[0])
    for i in range(cell.shape[0]):
        if cell[i] < 0 or not cells.is_intact[i]:
            continue
        for k in range(3):  # directions 3 to 5 are those of the other cell
            v = layout.cell_neighbours[cell[i], k]
            if v < 0 or image_cell[v] < 0 or not cells.is_intact[image_cell[v]]:
                continue
            j = image_cell[v]
            if (is_new[i] or is_new[j]) and _has_shared_corner(cells, i, j, cell[i], k, layout, corner_step):
                out[i, k], out[j, k + 3] = j, i


@inlined_no_refcount
def _has_shared_corner(cells, i, j, u, k, layout, corner_step):  # type: ignore[no-untyped-def]
    """Whether cells i and j, as the layout's u and its neighbour in direction k, share the right corner."""
    center, corner, v = cells.center_px, cells.corner_px, layout.cell_neighbours[u, k]
    edge = equilateral_edge(min(cells.area_px[i], cells.area_px[j]))
    if np.isnan(corner[i, 0, 0]) or np.isnan(corner[j, 0, 0]):
        x, y = center[j, 0] - center[i, 0], center[j, 1] - center[i, 1]
        return x * x + y * y < (MAX_NEIGHBOUR_DISTANCE * edge) ** 2
    limit = (MAX_CORNER_DISTANCE * edge) ** 2
    for a in range(3):
        for b in range(3):
            x, y = corner[j, b, 0] - corner[i, a, 0], corner[j, b, 1] - corner[i, a, 1]
            if x * x + y * y < limit:
                first_i = (a + 6 - corner_step * OWN_CORNER[k]) % 3
                first_j = (b + 6 - corner_step * NEIGHBOUR_CORNER[k]) % 3
                if _is_neighbour_predicted(
                    cells, i, j, u, v, first_i, layout, corner_step
                ) and _is_neighbour_predicted(cells, j, i, v, u, first_j, layout, corner_step):
                    return True
    return False


@inlined_no_refcount
def _is_neighbour_predicted(cells, i, j, u, v, first_corner, layout, corner_step):  # type: ignore[no-untyped-def]
    """Whether the triangle of cell i, as the layout's u, predicts the layout's v near cell j."""
    a, b, c, d = triangle_map(cells, i, layout, u, first_corner, corner_step)
    x = cells.center_px[j, 0] - cells.center_px[i, 0]
    y = cells.center_px[j, 1] - cells.center_px[i, 1]
    x_mm = layout.center_mm[v, 0] - layout.center_mm[u, 0]
    y_mm = layout.center_mm[v, 1] - layout.center_mm[u, 1]
    dx, dy = a * x_mm + b * y_mm - x, c * x_mm + d * y_mm - y
    return dx * dx + dy * dy < MAX_PREDICTED_DISTANCE**2 * (x * x + y * y)


@inlined_no_refcount
def fill_map_by_similarity(cells, i, layout, u, corner_step, wanted, out):  # type: ignore[no-untyped-def]
    """Orient the triangle of cell i, the layout's u, so that its map is most similar to the map ``wanted`` (2, 2).

    Writes the map to ``out`` (2, 2) and returns the first corner; -1 where no map is similar or one is missing.
    """
    if np.isnan(cells.corner_px[i, 0, 0]) or np.isnan(wanted[0, 0]):
        return -1
    w0, w1, w2, w3 = wanted[0, 0], wanted[0, 1], wanted[1, 0], wanted[1, 1]
    best, found = MAX_MAP_DIFFERENCE * np.sqrt(w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3), -1
    for first_corner in range(3):
        a, b, c, d = triangle_map(cells, i, layout, u, first_corner, corner_step)
        difference = np.sqrt((a - w0) ** 2 + (b - w1) ** 2 + (c - w2) ** 2 + (d - w3) ** 2)
        if difference < best:
            best, found = difference, first_corner
            out[0, 0], out[0, 1], out[1, 0], out[1, 1] = a, b, c, d
    return found


@inlined_no_refcount
def fill_map_by_neighbours(cells, i, u, image_cell, layout, corner_step, out):  # type: ignore[no-untyped-def]
    """Orient the triangle of cell i, the layout's u, by its numbered neighbours; see ``fill_map_by_similarity``."""
    fill_linear_map(i, cells.center_px, u, image_cell, layout, out)
    return fill_map_by_similarity(cells, i, layout, u, corner_step, out, out)


@compiled
def update_numbers_by_contact(cells, layout, corner_step, unnumbered, start, numbering):  # type: ignore[no-untyped-def]
    """Number the cells in contact with numbered ones, the cells in contact with these, and so on.

    Args:
        cells: ``CellArrays``. layout: ``LayoutCells``.
        unnumbered: (K,) int64, the intact cells without a number that have a triangle.
        start: the numbered cells to begin with.
        numbering: ``PartialNumbering``, updated.

    Returns:
        (F,) int64, the cells that were numbered.
    """
    center, cell, maps = cells.center_px, numbering.cell, numbering.maps
    queue = np.empty(start.shape[0] + unnumbered.shape[0], np.int64)
    begin, end = 0, 0
    if unnumbered.shape[0] > 0:
        for i in start:
            if not _has_free_neighbour(layout, cell[i], numbering.free):
                continue
            if update_first_corner(cells, i, layout, corner_step, numbering) >= 0:
                queue[end] = i
                end += 1
    first = end
    if end == 0:
        return queue[:0]
    grid = bucket_grid(center[unnumbered])
    index, square = np.empty(2, np.int32), np.empty(2)
    while begin < end:
        i = queue[begin]
        begin += 1
        u = cell[i]
        for k in range(6):
            v = layout.cell_neighbours[u, k]
            if v < 0 or not numbering.free[v]:
                continue
            x = layout.center_mm[v, 0] - layout.center_mm[u, 0]
            y = layout.center_mm[v, 1] - layout.center_mm[u, 1]
            px = center[i, 0] + maps[i, 0, 0] * x + maps[i, 0, 1] * y
            py = center[i, 1] + maps[i, 1, 0] * x + maps[i, 1, 1] * y
            for n in range(fill_nearest_points(grid, px, py, index, square)):
                j = unnumbered[index[n]]
                if cell[j] >= 0 or cells.ink[j] != layout.ink[v]:
                    continue
                distance2 = (center[j, 0] - center[i, 0]) ** 2 + (center[j, 1] - center[i, 1]) ** 2
                if square[n] > MAX_PREDICTED_DISTANCE**2 * distance2:
                    continue
                first_corner = numbering.first_corner[i]
                turned = _first_corner_by_contact(cells, i, j, u, k, first_corner, layout, corner_step)
                if turned >= 0:
                    cell[j], numbering.free[v], numbering.first_corner[j] = v, False, turned
                    a, b, c, d = triangle_map(cells, j, layout, v, turned, corner_step)
                    maps[j, 0, 0], maps[j, 0, 1], maps[j, 1, 0], maps[j, 1, 1] = a, b, c, d
                    queue[end] = j
                    end += 1
                    break
    return queue[first:end]


@inlined_no_refcount
def _has_free_neighbour(layout, u, free):  # type: ignore[no-untyped-def]
    """Whether a neighbour of the layout's cell u is free."""
    for k in range(6):
        v = layout.cell_neighbours[u, k]
        if v >= 0 and free[v]:
            return True
    return False


@inlined_no_refcount
def update_first_corner(cells, i, layout, corner_step, numbering):  # type: ignore[no-untyped-def]
    """The first corner of the numbered cell i, -1 unknown; evaluated and stored with its map at the first use."""
    if numbering.first_corner[i] == NOT_EVALUATED:
        numbering.first_corner[i] = fill_map_by_neighbours(
            cells, i, numbering.cell[i], numbering.image_cell, layout, corner_step, numbering.maps[i]
        )
    return numbering.first_corner[i]


@inlined_no_refcount
def _first_corner_by_contact(cells, i, j, u, k, first_corner, layout, corner_step):  # type: ignore[no-untyped-def]
    """The first corner of cell j as the layout's neighbour of u in direction k; -1 without the right contact.

    Cell i is the layout's u, counted from ``first_corner``.
    """
    corner, area, v = cells.corner_px, cells.area_px, layout.cell_neighbours[u, k]
    at = (first_corner + corner_step * OWN_CORNER[k]) % 3
    limit = (MAX_CORNER_DISTANCE * equilateral_edge(min(area[i], area[j]))) ** 2
    for c in range(3):
        x, y = corner[j, c, 0] - corner[i, at, 0], corner[j, c, 1] - corner[i, at, 1]
        if x * x + y * y <= limit:
            turned = (c + 6 - corner_step * NEIGHBOUR_CORNER[k]) % 3
            if _is_neighbour_predicted(cells, j, i, v, u, turned, layout, corner_step):
                return turned
    return -1
