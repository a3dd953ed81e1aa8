"""Between the markers: fields over the pattern's own triangles, continuous or with a continuous tangent plane.

``smooth`` is Clough and Tocher's element (1965): each triangle is split at its centroid into three cubics in Bernstein
form, which take values and gradients at the corners and a cross-edge derivative that is linear along each edge, so that
neighbouring triangles share their tangent planes. Gradients come from local polynomials through two rings of markers.
Everything is a function of the place in the layout (mm); a square cell counts as two triangles.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.layout.reference import Reference
from extractor.space.camera import Array, is_finite

MIN_CUBIC_NEIGHBOURS, MIN_QUADRATIC_NEIGHBOURS = (
    10,
    5,
)  # known neighbours for the polynomials of 9 and 5 terms; fewer get the plane
MAX_CONDITION = 1e3  # of the normal equations; whole rings have 4 to 170
CANDIDATES = 12  # triangles whose centroids are nearest, one of which holds a point
MIN_BARYCENTRIC = -1e-9


class Field:
    """Interpolates values at a layout's markers.

    >>> field = Field(layout)  # doctest: +SKIP
    >>> field.at(shape.displacement_mm, grid_xy_mm)  # doctest: +SKIP
    """

    def __init__(self, layout: Reference) -> None:
        self.xy_mm = np.asarray(layout.xy_mm)
        corners = np.asarray(layout.cell_corners)
        if corners.shape[1] == 4:
            corners = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
        self.triangles: NDArray[np.int32] = corners
        self._last: tuple[bytes, Array] | None = None
        self._near = _two_rings(np.asarray(layout.edges), len(self.xy_mm))
        self._edge_mm = float(np.linalg.norm(np.diff(self.xy_mm[layout.edges], axis=1)[:, 0], axis=1).mean())

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.xy_mm[self.triangles].mean(axis=1))

    def gradients(self, values: Array) -> Array:
        """(M, k, 2): derivatives by the layout's x and y of values (M, k) with NaN where unknown; NaN likewise."""
        known = is_finite(values)
        stencil = self._stencil(known)
        rise = np.where(known[self._near][..., None], values[self._near] - values[:, None], 0.0)
        return np.asarray(np.swapaxes(stencil @ rise, 1, 2))

    def _stencil(self, known: NDArray[np.bool_]) -> Array:
        """(M, 2, K): weights of the differences to the known markers of two rings; NaN where these tell nothing.

        Least squares, weighted by the inverse square of the distance. From frame to frame the same ones are known.
        """
        key = known.tobytes()
        if self._last is None or self._last[0] != key:
            have = (self._near >= 0) & known[self._near] & known[:, None]
            step = np.where(have[..., None], self.xy_mm[self._near] - self.xy_mm[:, None], 0.0)
            out = np.full((len(known), 2, have.shape[1]), np.nan)
            for terms, needed in ((2, 2), (5, MIN_QUADRATIC_NEIGHBOURS), (9, MIN_CUBIC_NEIGHBOURS)):
                some = np.flatnonzero(have.sum(axis=1) >= needed)
                self._fill_stencil_weights(step / self._edge_mm, have, terms, some, out)
            self._last = key, out
        return self._last[1]

    def _fill_stencil_weights(
        self, step: Array, have: NDArray[np.bool_], terms: int, some: NDArray[np.intp], out: Array
    ) -> None:
        """Write the weights that polynomials with this many terms give, where the neighbours determine them."""
        x, y = np.moveaxis(step[some], 2, 0)
        rows = np.stack([x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3][:terms], axis=2)
        design = np.swapaxes(rows * (have[some] / np.maximum(x * x + y * y, 1e-12))[..., None], 1, 2)
        gram = design @ rows
        sound = np.linalg.cond(gram) < MAX_CONDITION
        out[some[sound]] = np.linalg.solve(gram[sound], design[sound])[:, :2] / self._edge_mm

    def mean_around(self, values: Array) -> Array:
        """(M,) means over each marker and the two rings around it, of those that are known; NaN where none is."""
        near = np.column_stack([np.arange(len(self._near)), self._near])
        around = np.where(near >= 0, values[near], np.nan)
        known = np.isfinite(around)
        total = np.where(known, around, 0.0).sum(axis=1)
        count = known.sum(axis=1)
        return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))

    def normals(self, xyz_mm: Array) -> Array:
        """(M, 3) unit normals of the surface through (M, 3), out of the front; NaN where unknown."""
        by_x, by_y = np.moveaxis(self.gradients(xyz_mm), 2, 0)
        normal = np.cross(by_x, by_y)
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))

    def find(self, xy_mm: Array) -> tuple[NDArray[np.intp], Array]:
        """(N,) the triangle that holds each point (N, 2) of the layout, -1 outside; (N, 3) barycentric."""
        count = min(CANDIDATES, len(self.triangles))
        candidates = np.atleast_2d(self._tree.query(xy_mm, k=count)[1].reshape(-1, count))
        triangle, inside = np.full(len(xy_mm), -1, np.intp), np.full((len(xy_mm), 3), np.nan)
        for k in range(count):
            todo = np.flatnonzero(triangle < 0)
            place = self._barycentric(candidates[todo, k], xy_mm[todo])
            hit = place.min(axis=1) > MIN_BARYCENTRIC
            triangle[todo[hit]], inside[todo[hit]] = candidates[todo[hit], k], place[hit]
        return triangle, inside

    def _barycentric(self, triangle: NDArray[np.intp], xy_mm: Array) -> Array:
        a, b, c = np.moveaxis(self.xy_mm[self.triangles[triangle]], 1, 0)
        twice = _cross_2d(b - a, c - a)
        second, third = _cross_2d(xy_mm - a, c - a) / twice, _cross_2d(b - a, xy_mm - a) / twice
        return np.column_stack([1 - second - third, second, third])

    def at(self, values: Array, xy_mm: Array, smooth: bool = True) -> Array:
        """Values (N, k) at points (N, 2) of the layout, from values (M, k) at the markers.

        NaN outside the pattern and in triangles with an unknown corner.

        Args:
            smooth: with a continuous tangent plane; False: linear in each triangle.
        """
        triangle, inside = self.find(xy_mm)
        out = np.full((len(xy_mm), values.shape[1]), np.nan)
        hit = np.flatnonzero(triangle >= 0)
        corners = self.triangles[triangle[hit]]
        if smooth:
            out[hit] = clough_tocher(
                self.xy_mm[corners], values[corners], self.gradients(values)[corners], inside[hit]
            )
        else:
            out[hit] = np.einsum("ni,nik->nk", inside[hit], values[corners])
        return out


def hermite_along_edge(start: Array, end: Array, slope: Array, slope_end: Array, fraction: Array) -> Array:
    """Cubic Hermite between values (E, k) with derivatives (E, k) by the fraction: (E, m, k). Clough and
    Tocher's field is this on an edge."""
    t = fraction[:, None]
    parts = ((1 + 2 * t) * (1 - t) ** 2, t * t * (3 - 2 * t), t * (1 - t) ** 2, -t * t * (1 - t))
    return np.asarray(
        sum(part * value[:, None] for part, value in zip(parts, (start, end, slope, slope_end), strict=True))
    )


def clough_tocher(xy: Array, values: Array, gradients: Array, inside: Array) -> Array:
    """(N, k) at barycentric places (N, 3) in triangles (N, 3, 2).

    Args:
        values: (N, 3, k) at the corners.
        gradients: (N, 3, k, 2) at the corners.
    """
    low = inside.argmin(axis=1)
    order = (low[:, None] + [1, 2, 0]) % 3  # the third corner is opposite to the part that holds the point
    pick = np.arange(len(xy))[:, None], order
    corner, value, slope = xy[pick], values[pick], gradients[pick]
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
    """(M, K): each marker's neighbours and theirs, filled up with -1."""
    ring: list[set[int]] = [set() for _ in range(count)]
    for a, b in edges.tolist():
        ring[a].add(b)
        ring[b].add(a)
    both = [sorted(near.union(*(ring[j] for j in near)) - {i}) for i, near in enumerate(ring)]
    out = np.full((count, max(map(len, both))), -1, np.intp)
    for i, near in enumerate(both):
        out[i, : len(near)] = near
    return out
