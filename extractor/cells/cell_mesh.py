"""Stage 6: the cell mesh, a triangular mesh through the cells' centers; its faces are the markers and the black cells.

The centers of the colored cells form a lattice as regular as the pattern's own, and blur that rounds the corners moves
no center. Every marker is a triangle of a red, a green and a blue center, and so is every black cell; the two kinds
turn in opposite directions. Cells of one ink are second neighbours in that lattice: an edge of the mesh between two of
them is the wrong diagonal and is flipped. So colors determine the right neighbours even where shear has made wrong ones
nearer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.numeric.compilation import compiled, inlined_no_refcount
from extractor.numeric.delaunay import delaunay

MAX_FLIP_ROUNDS = 12
# Area of a face relative to its cells' mean area: about 1 for three neighbours, at least 2 across a gap.
MIN_AREA_RATIO = 0.4
MAX_AREA_RATIO = 1.9
# Sides of the cells over those at which neighbours just meet. Ink that bled and overexposure make cells larger; smaller
# ones are left as they are: in clutter, figures that lie apart must not meet.
MAX_SWELLING = 1.6
# L of eq. 5 (neighbouring cells share a corner), in edges of an equilateral cell of the smaller area.
MAX_CORNER_GAP = 0.4


@dataclass(frozen=True, eq=False)
class CellMesh:
    """Stage 6.

    Attributes:
        faces: (F, 3) int32, the red, green and blue cell of each face; -1 thrice for a triangle that is no face.
        neighbours: (F, 3) int32, the face across the edge opposite to each cell, or -1.
        orientation: (F,) int8, +1 where red, green, blue run clockwise in the image, -1 counter-clockwise, 0 no face.
        swelling: sides of the cells' triangles over those at which neighbours just meet, 1 to ``MAX_SWELLING``.
    """

    faces: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    orientation: NDArray[np.int8]
    swelling: float


@inlined_no_refcount
def _index_in_row(rows, i, value):  # type: ignore[no-untyped-def]
    """The column of a value in row i of ``rows`` (N, 3)."""
    return 0 if rows[i, 0] == value else 1 if rows[i, 1] == value else 2


@inlined_no_refcount
def _doubled_area(xy, a, b, c):  # type: ignore[no-untyped-def]
    """Twice the signed area of the points a, b, c; positive if clockwise, y down."""
    x, y = xy[a, 0], xy[a, 1]
    return (xy[b, 0] - x) * (xy[c, 1] - y) - (xy[b, 1] - y) * (xy[c, 0] - x)


@compiled
def _update_flipped_edges(points, ink, faces, neighbours):  # type: ignore[no-untyped-def]
    """Flip edges between cells of one ink where the other diagonal joins two other inks."""
    for _ in range(MAX_FLIP_ROUNDS):
        flips = 0
        for f in range(faces.shape[0]):
            for k in range(3):
                g = neighbours[f, k]
                if g < f:
                    continue
                a, b, c = faces[f, (k + 1) % 3], faces[f, (k + 2) % 3], faces[f, k]
                j = _index_in_row(neighbours, g, f)
                d = faces[g, j]
                if ink[a] != ink[b] or ink[c] == ink[d] or ink[c] == ink[a] or ink[d] == ink[a]:
                    continue
                # the quadrilateral must be convex: both new triangles turn the same way
                if _doubled_area(points, c, a, d) * _doubled_area(points, c, d, b) <= 0.0:
                    continue
                beyond_bc, beyond_ca = neighbours[f, (k + 1) % 3], neighbours[f, (k + 2) % 3]
                beyond_ad = neighbours[g, _index_in_row(faces, g, b)]
                beyond_db = neighbours[g, _index_in_row(faces, g, a)]
                # f becomes c, a, d and g becomes c, d, b
                faces[f, 0], faces[f, 1], faces[f, 2] = c, a, d
                neighbours[f, 0], neighbours[f, 1], neighbours[f, 2] = beyond_ad, g, beyond_ca
                faces[g, 0], faces[g, 1], faces[g, 2] = c, d, b
                neighbours[g, 0], neighbours[g, 1], neighbours[g, 2] = beyond_db, beyond_bc, f
                if beyond_ad >= 0:
                    neighbours[beyond_ad, _index_in_row(neighbours, beyond_ad, g)] = f
                if beyond_bc >= 0:
                    neighbours[beyond_bc, _index_in_row(neighbours, beyond_bc, f)] = g
                flips += 1
                break
        if flips == 0:
            break


@inlined_no_refcount
def _has_shared_corner(corner, area, a, b):  # type: ignore[no-untyped-def]
    """Whether cells a and b have a common corner; true if one of them has no triangle."""
    if np.isnan(corner[a, 0, 0]) or np.isnan(corner[b, 0, 0]):
        return True
    limit = MAX_CORNER_GAP * MAX_CORNER_GAP * min(area[a], area[b]) * 4.0 / np.sqrt(3.0)
    nearest = np.inf
    for i in range(3):
        for j in range(3):
            dx, dy = corner[a, i, 0] - corner[b, j, 0], corner[a, i, 1] - corner[b, j, 1]
            nearest = min(nearest, dx * dx + dy * dy)
    return nearest < limit


@compiled
def _classify_faces(points, ink, area, corner, faces, neighbours):  # type: ignore[no-untyped-def]
    """The fields of ``CellMesh``: corners as red, green, blue; only triangles that are markers or black cells."""
    count = faces.shape[0]
    ordered = np.full((count, 3), -1, np.int32)
    across = np.full((count, 3), -1, np.int32)
    orientation = np.zeros(count, np.int8)
    for f in range(count):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if ink[a] == ink[b] or ink[b] == ink[c] or ink[a] == ink[c]:
            continue
        size = 0.5 * abs(_doubled_area(points, a, b, c))
        mean = (area[a] + area[b] + area[c]) / 3.0
        if size < MIN_AREA_RATIO * mean or size > MAX_AREA_RATIO * mean:
            continue
        if not (_has_shared_corner(corner, area, a, b) and _has_shared_corner(corner, area, b, c)):
            continue
        if not _has_shared_corner(corner, area, c, a):
            continue
        for k in range(3):
            ordered[f, ink[faces[f, k]] - 1] = faces[f, k]
            across[f, ink[faces[f, k]] - 1] = neighbours[f, k]
        is_clockwise = _doubled_area(points, ordered[f, 0], ordered[f, 1], ordered[f, 2]) > 0.0
        orientation[f] = 1 if is_clockwise else -1
    for f in range(count):
        for k in range(3):
            g = across[f, k]
            if g >= 0 and orientation[g] != -orientation[f]:
                across[f, k] = -1
    return ordered, across, orientation


def build_cell_mesh(cells: Cells) -> CellMesh | None:
    """Stage 6: Delaunay triangles of the centers, corrected by color.

    Returns None with fewer than three cells, or with all centers on one line.
    """
    faces, neighbours = delaunay(cells.center_px)
    if len(faces) == 0:
        return None
    _update_flipped_edges(cells.center_px, cells.ink, faces, neighbours)
    swelling = float(_swelling(cells.center_px, cells.ink, cells.corner_px, faces))
    corner = without_swelling(cells.center_px, cells.corner_px, swelling)
    faces, neighbours, orientation = _classify_faces(
        cells.center_px, cells.ink, cells.area_px, corner, faces, neighbours
    )
    return CellMesh(faces, neighbours, orientation, swelling)


@compiled
def _swelling(points, ink, corner, faces):  # type: ignore[no-untyped-def]
    """``CellMesh.swelling``: where neighbours just meet, a face is as large as the triangles of its cells."""
    ratio, count = np.empty(faces.shape[0]), 0
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if ink[a] == ink[b] or ink[b] == ink[c] or ink[a] == ink[c]:
            continue
        size, total = abs(_doubled_area(points, a, b, c)), 0.0
        for i in faces[f]:
            total += abs(_doubled_area(corner[i], 0, 1, 2))
        if size > 0.0 and np.isfinite(total):
            ratio[count] = total / (3.0 * size)
            count += 1
    return min(max(np.sqrt(np.median(ratio[:count])), 1.0), MAX_SWELLING) if count > 0 else 1.0


@compiled
def without_swelling(center, corner, swelling):  # type: ignore[no-untyped-def]
    """The corners (N, 3, 2) of cells whose sides are divided by the swelling, around their centers (N, 2)."""
    out = np.empty(corner.shape)
    for i in range(center.shape[0]):
        for k in range(3):
            out[i, k, 0] = center[i, 0] + (corner[i, k, 0] - center[i, 0]) / swelling
            out[i, k, 1] = center[i, 1] + (corner[i, k, 1] - center[i, 1]) / swelling
    return out
