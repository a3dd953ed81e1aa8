"""Tetrahedra of a bonded block: a graded triangulation of its outline, extruded layer by layer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

Array = NDArray[np.float64]
GROWTH = 0.5  # growth of the element size with the distance from the contact


def _inside(outline_mm: Array, points: Array, margin_mm: float) -> NDArray[np.bool_]:
    """Points inside a convex outline, at least a margin away from it."""
    side = np.roll(outline_mm, -1, axis=0) - outline_mm
    normal = np.stack([-side[:, 1], side[:, 0]], axis=1) / np.hypot(*side.T)[:, None]
    distance = np.einsum("pkd,kd->pk", points[:, None] - outline_mm[None], normal)
    return np.asarray(distance.min(axis=1) >= margin_mm)


def triangulate_outline(
    outline_mm: Array, centres_mm: Array, fine_mm: float, fine_radius_mm: float, coarse_mm: float
) -> tuple[Array, NDArray[np.int64]]:
    """Points (N, 2) and triangles (T, 3) of a convex outline, fine within a radius around the centres."""
    tree = cKDTree(centres_mm)

    def size(points: Array) -> Array:
        beyond = np.maximum(tree.query(points)[0] - fine_radius_mm, 0.0)
        return np.minimum(fine_mm + GROWTH * beyond, coarse_mm)

    points = []
    for start, end in zip(outline_mm, np.roll(outline_mm, -1, axis=0), strict=True):
        along = np.linspace(0, 1, 400)
        wanted = 1 / size(start + along[:, None] * (end - start))
        total = np.concatenate([[0], np.cumsum(0.5 * (wanted[1:] + wanted[:-1]) * np.diff(along))])
        total *= np.hypot(*(end - start))
        count = max(2, round(total[-1]))
        at = np.interp(np.arange(count) / count * total[-1], total, along)
        points.append(start + at[:, None] * (end - start))
    kept = np.concatenate(points)
    # Points are tried from fine to coarse lattices and kept at a distance of about the wanted size.
    levels = fine_mm * 2.0 ** np.arange(0, 8, 0.5)
    low, high = outline_mm.min(axis=0), outline_mm.max(axis=0)
    for level in levels[:-1]:
        rows = np.arange(low[1], high[1], level * np.sqrt(0.75))
        lattice = np.concatenate(
            [
                np.stack(
                    [
                        np.arange(low[0] + level * (i % 2) / 2, high[0], level),
                        0 * np.arange(low[0] + level * (i % 2) / 2, high[0], level) + y,
                    ],
                    1,
                )
                for i, y in enumerate(rows)
            ]
        )
        wanted = size(lattice)
        last = level >= coarse_mm / np.sqrt(2)
        lattice = lattice[(wanted >= 0.84 * level) & ((wanted < 1.19 * level) | last)]
        lattice = lattice[_inside(outline_mm, lattice, 0.5 * level)]
        if len(lattice):
            lattice = lattice[cKDTree(kept).query(lattice)[0] > 0.62 * level]
            kept = np.concatenate([kept, lattice])
        if last:
            break
    triangles = Delaunay(kept).simplices
    a, b, c = (kept[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return kept, triangles[np.abs(area) > 1e-6 * fine_mm**2]


def extrude(points: Array, triangles: NDArray[np.int64], z_mm: Array) -> tuple[Array, NDArray[np.int64]]:
    """Points (3, N) and tetrahedra (4, T) over the levels ``z_mm``; faces of neighbours match."""
    count = len(points)
    placed = np.concatenate([np.column_stack([points, np.full(count, z)]) for z in z_mm])
    low = np.sort(triangles, axis=1)
    parts = []
    for level in range(len(z_mm) - 1):
        a, b, c = (low + level * count).T
        d, e, f = a + count, b + count, c + count
        parts += [np.stack([a, b, c, f]), np.stack([a, b, e, f]), np.stack([a, d, e, f])]
    return placed.T.copy(), np.concatenate(parts, axis=1)
