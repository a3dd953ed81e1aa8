"""Fields between the markers: interpolation over the pattern's triangles, linear or with a continuous tangent plane.

``smooth`` is the element of Clough and Tocher (1965): each triangle is split at its centroid into three cubics in
Bernstein form. These take values and gradients at the corners and a cross-edge derivative that is linear along each
edge, so that neighbouring triangles share their tangent planes. Gradients come from local polynomials through two rings
of markers. All fields are functions of the position in the layout (mm); a square cell counts as two triangles.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import space as native
from extractor.layout.reference import Reference
from extractor.numeric.nearest_points import nearest_points
from extractor.space.camera import Array, is_finite

MIN_CUBIC_NEIGHBOURS = 10  # known neighbours for the polynomial of 9 terms; derived: one equation over
MIN_QUADRATIC_NEIGHBOURS = 5  # for that of 5 terms; fewer get the plane
MAX_CONDITION = 1e3  # of the normal equations; complete rings have 4 to 170. Chosen above these
CANDIDATES = 12  # nearest triangles (by centroid) that are searched for a point; chosen
MIN_BARYCENTRIC = -1e-9  # of a point in a triangle; derived: rounding


class _Places(NamedTuple):
    """Points of the layout, and those within the pattern.

    Attributes:
        xy_mm: (N, 2) the points.
        hit: (H,) the points in a triangle.
        corners: (H, 3) its markers.
        inside: (H, 3) barycentric coordinates.
        weights: (H, 9) of value, slope by x and slope by y of each corner.
    """

    xy_mm: Array
    hit: NDArray[np.intp]
    corners: NDArray[np.int32]
    inside: Array
    weights: Array


class Field:
    """Interpolates values that are known at a layout's markers. Can be pickled and copied.

    >>> field = Field(layout)  # doctest: +SKIP
    >>> field.at(shape.displacement_mm, grid_xy_mm)  # doctest: +SKIP

    Attributes:
        xy_mm: (M, 2) float64, the markers in the layout.
        triangles: (T, 3) int32 marker ids.
    """

    def __init__(self, layout: Reference) -> None:
        self._layout = layout
        self.xy_mm = np.asarray(layout.xy_mm)
        corners = np.asarray(layout.cell_corners)
        if corners.shape[1] == 4:
            corners = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
        self.triangles: NDArray[np.int32] = corners
        self._last_stencil: tuple[bytes, Array] | None = (
            None  # weights of the last known markers, with this key
        )
        self._last_places: _Places | None = None
        self._ring_markers = _two_rings(np.asarray(layout.edges), len(self.xy_mm))
        self._edge_mm = float(np.linalg.norm(np.diff(self.xy_mm[layout.edges], axis=1)[:, 0], axis=1).mean())

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made from the layout."""
        return type(self), (self._layout,)

    @cached_property
    def _centres_mm(self) -> Array:
        return np.asarray(self.xy_mm[self.triangles].mean(axis=1))

    def gradients(self, values: Array) -> Array:
        """(M, k, 2) derivatives of values (M, k) by the layout's x and y, per mm; NaN where unknown.

        Args:
            values: NaN where unknown.
        """
        known = is_finite(values)
        values = np.ascontiguousarray(values, np.float64)
        return native.gradients(self._stencil(known), self._ring_markers, values)

    def _stencil(self, known: NDArray[np.bool_]) -> Array:
        """(M, 2, K) weights of the differences to the known markers of two rings; NaN where these are too few.

        The method is least squares, weighted by the inverse square of the distance. The last result is kept, because
        the same markers are usually known in the next frame.
        """
        key, last = known.tobytes(), self._last_stencil  # another thread may change the last one
        if last is None or last[0] != key:
            near = self._ring_markers
            usable = (near >= 0) & known[near] & known[:, None]
            vectors = np.where(usable[..., None], self.xy_mm[near] - self.xy_mm[:, None], 0.0)
            stencil = np.full((len(known), 2, usable.shape[1]), np.nan)
            for terms, needed in ((2, 2), (5, MIN_QUADRATIC_NEIGHBOURS), (9, MIN_CUBIC_NEIGHBOURS)):
                markers = np.flatnonzero(usable.sum(axis=1) >= needed)
                self._fill_stencil_weights(vectors / self._edge_mm, usable, terms, markers, stencil)
            self._last_stencil = last = key, stencil
        return last[1]

    def _fill_stencil_weights(
        self,
        vectors: Array,
        usable: NDArray[np.bool_],
        terms: int,
        markers: NDArray[np.intp],
        stencil: Array,
    ) -> None:
        """Write the weights of polynomials with this number of terms, for markers whose neighbours determine them."""
        x, y = np.moveaxis(vectors[markers], 2, 0)
        rows = np.stack([x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3][:terms], axis=2)
        weight = usable[markers] / np.maximum(x * x + y * y, 1e-12)
        design = np.swapaxes(rows * weight[..., None], 1, 2)
        gram = design @ rows
        regular = np.linalg.cond(gram) < MAX_CONDITION
        solutions = np.linalg.solve(gram[regular], design[regular])
        stencil[markers[regular]] = solutions[:, :2] / self._edge_mm

    def mean_around(self, values: Array) -> Array:
        """(M,) means of the known values (M,) of each marker and the two rings around it; NaN where none is known."""
        near = np.column_stack([np.arange(len(self._ring_markers)), self._ring_markers])
        nearby = np.where(near >= 0, values[near], np.nan)
        known = np.isfinite(nearby)
        total = np.where(known, nearby, 0.0).sum(axis=1)
        count = known.sum(axis=1)
        return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))

    def normals(self, xyz_mm: Array) -> Array:
        """(M, 3) unit normals, out of the front, of the surface through markers (M, 3); NaN where unknown."""
        return normals_of(self.gradients(xyz_mm))

    def find(self, xy_mm: Array) -> tuple[NDArray[np.intp], Array]:
        """(N,) the triangle that contains each point (N, 2) of the layout, -1 for none; (N, 3) barycentric."""
        count = min(CANDIDATES, len(self.triangles))
        candidates = nearest_points(self._centres_mm, xy_mm, count)
        triangle, inside = np.full(len(xy_mm), -1, np.intp), np.full((len(xy_mm), 3), np.nan)
        for k in range(count):
            open_points = np.flatnonzero(triangle < 0)
            coordinates = self._barycentric(candidates[open_points, k], xy_mm[open_points])
            hit = coordinates.min(axis=1) > MIN_BARYCENTRIC
            found = open_points[hit]
            triangle[found], inside[found] = candidates[found, k], coordinates[hit]
        return triangle, inside

    def _barycentric(self, triangle: NDArray[np.integer[Any]], xy_mm: Array) -> Array:
        """(N, 3) barycentric coordinates of points (N, 2) in these triangles (N,)."""
        a, b, c = np.moveaxis(self.xy_mm[self.triangles[triangle]], 1, 0)
        twice = _cross_2d(b - a, c - a)
        second, third = _cross_2d(xy_mm - a, c - a) / twice, _cross_2d(b - a, xy_mm - a) / twice
        return np.column_stack([1 - second - third, second, third])

    def at(self, values: Array, xy_mm: Array, smooth: bool = True) -> Array:
        """(N, k) values at points of the layout; NaN outside the pattern and in triangles with an unknown corner.

        Args:
            values: (M, k) at the markers.
            xy_mm: (N, 2) points.
            smooth: with a continuous tangent plane; False: linear in each triangle.
        """
        places = self._places_of(xy_mm)
        nearby = values[places.corners]
        if smooth:
            slopes = self.gradients(values)[places.corners]
            terms = np.concatenate([nearby[:, :, None], np.moveaxis(slopes, 3, 2)], axis=2)
            found = places.weights[:, None] @ terms.reshape(len(terms), 9, values.shape[1])
        else:
            found = places.inside[:, None] @ nearby
        out = np.full((len(xy_mm), values.shape[1]), np.nan)
        out[places.hit] = found[:, 0]
        return out

    def _places_of(self, xy_mm: Array) -> _Places:
        """The places of points; the last ones are kept, because grids stay the same from frame to frame."""
        last = self._last_places
        if last is None or not np.array_equal(last.xy_mm, xy_mm):
            triangle, inside = self.find(xy_mm)
            hit = np.flatnonzero(triangle >= 0)
            corners, inside = self.triangles[triangle[hit]], inside[hit]
            # the field is linear in the corners' values and slopes
            units = np.tile(np.eye(9).reshape(3, 3, 9), (len(hit), 1, 1, 1))
            values, slopes = units[:, :, 0], np.moveaxis(units[:, :, 1:], 2, 3)
            weights = clough_tocher(self.xy_mm[corners], values, slopes, inside)
            self._last_places = last = _Places(xy_mm.copy(), hit, corners, inside, weights)
        return last


def normals_of(slopes: Array) -> Array:
    """(M, 3) unit normals, out of the front, of a surface with gradients (M, 3, 2); NaN where unknown."""
    (ax, ay, az), (bx, by, bz) = slopes.transpose(2, 1, 0)
    normal = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
    return np.asarray(normal / np.sqrt(np.einsum("mk,mk->m", normal, normal))[:, None])


def clough_tocher(xy: Array, values: Array, gradients: Array, inside: Array) -> Array:
    """(N, k) the smooth field at a point in each of N triangles.

    Args:
        xy: (N, 3, 2) corners.
        values: (N, 3, k) at the corners.
        gradients: (N, 3, k, 2) at the corners.
        inside: (N, 3) barycentric coordinates of the points.
    """
    low = inside.argmin(axis=1)
    order = (low[:, None] + [1, 2, 0]) % 3  # the third corner is opposite to the part that contains the point
    ordered = np.arange(len(xy))[:, None], order
    corner, value, slope = xy[ordered], values[ordered], gradients[ordered]
    middle = xy.mean(axis=1)

    def control(i: int, towards: Array) -> Array:
        return np.asarray(value[:, i] + np.einsum("nkd,nd->nk", slope[:, i], towards - corner[:, i]) / 3)

    inner = [control(i, middle) for i in range(3)]
    sides = {(i, j): control(i, corner[:, j]) for i in range(3) for j in range(3) if i != j}
    faces = {}
    for i, j in ((0, 1), (1, 2), (2, 0)):
        edge = corner[:, j] - corner[:, i]
        tau = (((middle - corner[:, i]) * edge).sum(axis=1) / (edge * edge).sum(axis=1))[:, None]
        at_i = inner[i] - (1 - tau) * value[:, i] - tau * sides[i, j]
        at_j = inner[j] - (1 - tau) * sides[j, i] - tau * value[:, j]
        faces[i, j] = faces[j, i] = (at_i + at_j) / 2 + (1 - tau) * sides[i, j] + tau * sides[j, i]
    deep = [(inner[i] + faces[i, (i + 1) % 3] + faces[i, (i + 2) % 3]) / 3 for i in range(3)]
    core = (deep[0] + deep[1] + deep[2]) / 3

    least = np.take_along_axis(inside, low[:, None], axis=1)
    u, v = (np.take_along_axis(inside, order[:, k : k + 1], axis=1) - least for k in (0, 1))
    w = 3 * least
    outer = u**3 * value[:, 0] + v**3 * value[:, 1] + 3 * u * v * (u * sides[0, 1] + v * sides[1, 0])
    rest = 3 * w * (u * u * inner[0] + v * v * inner[1] + 2 * u * v * faces[0, 1])
    return np.asarray(outer + rest + 3 * w * w * (u * deep[0] + v * deep[1]) + w**3 * core)


def _cross_2d(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _two_rings(edges: NDArray[np.int32], count: int) -> NDArray[np.intp]:
    """(M, K) the neighbours of each marker and their neighbours, padded with -1."""
    ring: list[set[int]] = [set() for _ in range(count)]
    for a, b in edges.tolist():
        ring[a].add(b)
        ring[b].add(a)
    both = [sorted(near.union(*(ring[j] for j in near)) - {i}) for i, near in enumerate(ring)]
    table = np.full((count, max(map(len, both))), -1, np.intp)
    for i, near in enumerate(both):
        table[i, : len(near)] = near
    return table
