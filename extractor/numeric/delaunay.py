"""Delaunay triangulation of points in the plane, with the triangles' neighbours.

A general library takes twice the time of all the rest of the numbering. Points are inserted one by one along the rows
of a grid (Lawson 1977): a walk from the point before leads to the triangle that contains the new point; the triangle is
split; then every edge whose other triangle has the new point in its circumcircle is flipped.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled

OUTER_RADIUS = 64.0  # in units of the points' extent, of the triangle that contains all points
ROUNDING_TOLERANCE = 1e-15  # of determinants, with the extent as unit, for points on a line or on a circle
POINTS_PER_BUCKET = 3.0  # mean number of points in a cell of the grid that orders the insertion


@compiled
def _insertion_order(points):  # type: ignore[no-untyped-def]
    """(N,) the points' order along the rows of a grid, every other row backwards."""
    count = points.shape[0]
    low_x, low_y = points[:, 0].min(), points[:, 1].min()
    width, height = points[:, 0].max() - low_x, points[:, 1].max() - low_y
    step = np.sqrt(max(width * height * POINTS_PER_BUCKET / count, 1e-300))
    key = np.empty(count)
    for i in range(count):
        row = np.floor((points[i, 1] - low_y) / step)
        along = (points[i, 0] - low_x) / max(width, 1e-300)
        key[i] = row + (0.999 * along if row % 2.0 == 0.0 else 0.999 * (1.0 - along))
    return np.argsort(key)


@compiled
def _doubled_area(xy, a, b, p):  # type: ignore[no-untyped-def]
    """Twice the signed area of a, b, p; positive if p lies on the inner side of a triangle's edge a-b."""
    ax, ay = xy[a, 0], xy[a, 1]
    return (xy[b, 0] - ax) * (xy[p, 1] - ay) - (xy[b, 1] - ay) * (xy[p, 0] - ax)


@compiled
def _in_circle_determinant(xy, a, b, c, p):  # type: ignore[no-untyped-def]
    """Positive if p lies in the circle through a, b, c, which turn positively."""
    px, py = xy[p, 0], xy[p, 1]
    ax, ay, bx, by, cx, cy = (
        xy[a, 0] - px,
        xy[a, 1] - py,
        xy[b, 0] - px,
        xy[b, 1] - py,
        xy[c, 0] - px,
        xy[c, 1] - py,
    )
    aa, bb, cc = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    return aa * (bx * cy - by * cx) - bb * (ax * cy - ay * cx) + cc * (ax * by - ay * bx)


@compiled
def _locate_triangle(xy, faces, neighbours, start, count, p, tolerance):  # type: ignore[no-untyped-def]
    """The triangle that contains p, by a walk from the triangle ``start``; -1 if rounding makes the walk circular."""
    f = start
    for _ in range(4 * count):
        outside = -1
        for k in range(3):
            if _doubled_area(xy, faces[f, (k + 1) % 3], faces[f, (k + 2) % 3], p) < -tolerance:
                outside = k
                break
        if outside < 0:
            return f
        f = neighbours[f, outside]
        if f < 0:
            return -1
    return -1


@compiled
def _update_neighbour(neighbours, face, old, new):  # type: ignore[no-untyped-def]
    """Replace a face's neighbour ``old`` by ``new``; no change for face -1."""
    if face >= 0:
        for k in range(3):
            if neighbours[face, k] == old:
                neighbours[face, k] = new


@compiled
def _update_split_triangle(faces, neighbours, f, count, p):  # type: ignore[no-untyped-def]
    """Split face f at the point p, which becomes corner 0 of f and of the new faces ``count`` and ``count`` + 1."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    na, nb, nc = neighbours[f, 0], neighbours[f, 1], neighbours[f, 2]
    g, h = count, count + 1
    faces[f, 0], faces[f, 1], faces[f, 2] = p, b, c
    faces[g, 0], faces[g, 1], faces[g, 2] = p, c, a
    faces[h, 0], faces[h, 1], faces[h, 2] = p, a, b
    neighbours[f, 0], neighbours[f, 1], neighbours[f, 2] = na, g, h
    neighbours[g, 0], neighbours[g, 1], neighbours[g, 2] = nb, h, f
    neighbours[h, 0], neighbours[h, 1], neighbours[h, 2] = nc, f, g
    _update_neighbour(neighbours, nb, f, g)
    _update_neighbour(neighbours, nc, f, h)


@compiled
def _update_by_flips(xy, faces, neighbours, stack, height, tolerance):  # type: ignore[no-untyped-def]
    """Flip edges opposite to the new point, corner 0 of the ``height`` faces on the stack, until all are Delaunay."""
    for _ in range(stack.shape[0] - height):  # only rounding could cause more flips
        if height == 0:
            break
        height -= 1
        f = stack[height]
        g = neighbours[f, 0]
        if g < 0:
            continue
        p, a, b = faces[f, 0], faces[f, 1], faces[f, 2]
        k = 0 if neighbours[g, 0] == f else 1 if neighbours[g, 1] == f else 2
        d = faces[g, k]
        if not _in_circle_determinant(xy, p, a, b, d) > tolerance:
            continue
        # f = p, a, b and g = d, b, a become f = p, a, d and g = p, d, b
        beyond_ad, beyond_db = neighbours[g, (k + 1) % 3], neighbours[g, (k + 2) % 3]
        beyond_pb = neighbours[f, 1]
        faces[f, 2] = d
        faces[g, 0], faces[g, 1], faces[g, 2] = p, d, b
        neighbours[f, 0], neighbours[f, 1] = beyond_ad, g
        neighbours[g, 0], neighbours[g, 1], neighbours[g, 2] = beyond_db, beyond_pb, f
        _update_neighbour(neighbours, beyond_ad, g, f)
        _update_neighbour(neighbours, beyond_pb, f, g)
        stack[height], stack[height + 1] = f, g
        height += 2


@compiled
def _triangulate(points, order):  # type: ignore[no-untyped-def]
    """All triangles, including those with a corner of the outer triangle, and their neighbours."""
    count = points.shape[0]
    xy = np.empty((count + 3, 2))
    middle = np.array(
        [0.5 * (points[:, 0].min() + points[:, 0].max()), 0.5 * (points[:, 1].min() + points[:, 1].max())]
    )
    extent = max(np.ptp(points[:, 0]), np.ptp(points[:, 1]), 1e-300)
    xy[:count] = (points - middle) / extent
    for k in range(3):
        angle = 0.3 + 2.0 * np.pi * k / 3.0
        xy[count + k, 0], xy[count + k, 1] = OUTER_RADIUS * np.cos(angle), OUTER_RADIUS * np.sin(angle)
    faces = np.full((2 * count + 1, 3), -1, np.int32)
    neighbours = np.full((2 * count + 1, 3), -1, np.int32)
    stack = np.empty(4 * count + 64, np.int32)
    for k in range(3):
        faces[0, k] = count + k
    found, last = 1, 0
    for i in order:
        f = _locate_triangle(xy, faces, neighbours, last, found, i, ROUNDING_TOLERANCE)
        if f < 0:
            continue
        is_duplicate = False
        for k in range(3):
            c = faces[f, k]
            is_duplicate = is_duplicate or (xy[c, 0] == xy[i, 0] and xy[c, 1] == xy[i, 1])
        if is_duplicate:
            continue
        _update_split_triangle(faces, neighbours, f, found, i)
        stack[0], stack[1], stack[2] = f, found, found + 1
        found += 2
        _update_by_flips(xy, faces, neighbours, stack, 3, ROUNDING_TOLERANCE)
        last = f
    return faces[:found], neighbours[:found]


@compiled
def _inner_triangles(faces, neighbours, count):  # type: ignore[no-untyped-def]
    """The triangles without a corner of the outer triangle, renumbered, and their neighbours."""
    number = np.full(faces.shape[0], -1, np.int32)
    kept = 0
    for f in range(faces.shape[0]):
        if max(faces[f, 0], faces[f, 1], faces[f, 2]) < count:
            number[f] = kept
            kept += 1
    inner, across = np.empty((kept, 3), np.int32), np.full((kept, 3), -1, np.int32)
    for f in range(faces.shape[0]):
        n = number[f]
        if n < 0:
            continue
        for k in range(3):
            inner[n, k] = faces[f, k]
            if neighbours[f, k] >= 0:
                across[n, k] = number[neighbours[f, k]]
    return inner, across


def delaunay(points: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The Delaunay triangles of finite points (N, 2) float64.

    Only the first of coincident points is used. Slivers along the hull may be missing.

    Returns:
        (F, 3) int32 the triangles' corners, turning from x to y; (F, 3) int32 the triangle across the edge opposite to
        each corner, or -1.
    """
    if len(points) < 3:
        return np.empty((0, 3), np.int32), np.empty((0, 3), np.int32)
    faces, neighbours = _triangulate(points, _insertion_order(points))
    return _inner_triangles(faces, neighbours, len(points))  # type: ignore[no-any-return]
