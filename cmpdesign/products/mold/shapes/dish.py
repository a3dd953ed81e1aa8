"""The dish: the curved side of a domed pad's plates and stencils, as flat facets with bosses or holes.

The facets are the cells of the pattern, with their corners on the crown, and triangles from the pattern's border to the
crown's foot. A facet lies below the crown by at most pitch^2 / (6 radius), some micrometres. All facets are flat, so
volumes are exact sums over facets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mold.shapes.bosses import STENCIL_LEAN, stencil_hole_outlines
from cmpdesign.products.mold.shapes.cavities import cavities
from cmpdesign.products.mold.solids.loops import Loop, Points, frustum_volume_mm3, polygon_loop
from cmpdesign.products.mold.stack.crown import END_SLOPE, Crown
from cmpdesign.products.mold.stack.stack import MoldStack

# Points of a spherical crown's foot, and of the arch at each end of a cylindrical crown.
FOOT_POINTS = 96
ARCH_POINTS = 24
FacetPoints = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Dish:
    """A polyhedral crown, and the outlines of bosses or holes on it.

    Attributes:
        points: (P, 3) corners of the facets, mm.
        foot: numbers of the points that bound the crown at z = 0, counter-clockwise.
        facets: numbers of each facet's corners, counter-clockwise as seen from above.
        ends: leaning facets at the ends of a cylinder, counter-clockwise as seen from outside.
        outlines: facet -> outlines of its boss or hole in plan, at the facet and at the other end.
        height_mm: distance along z from an outline at the facet to the outline at the other end.
    """

    points: Points
    foot: tuple[int, ...]
    facets: list[FacetPoints]
    ends: list[FacetPoints]
    outlines: dict[int, tuple[Loop, Loop]]
    height_mm: float

    def z_at(self, facet: int, xy_mm: Points) -> NDArray[np.float64]:
        """(N,) height of a facet's plane at (N, 2) points."""
        a, b, c = (self.points[i] for i in self.facets[facet][:3])
        normal = np.cross(b - a, c - a)
        heights: NDArray[np.float64] = a[2] - ((xy_mm - a[:2]) @ normal[:2]) / normal[2]
        return heights

    def volume_mm3(self) -> float:
        """The volume between the facets and z = 0."""
        total = 0.0
        for facet in self.facets:
            corners = self.points[list(facet)]
            total += polygon_loop(corners[:, :2]).area_mm2() * float(corners[:, 2].mean())
        return total + sum(_volume_under_mm3(self.points[list(end)]) for end in self.ends)

    def outlines_volume_mm3(self) -> float:
        """The volume of all bosses or holes; a shear along z does not change a frustum's volume."""
        return sum(frustum_volume_mm3(start, end, self.height_mm) for start, end in self.outlines.values())


def make_bare_dish(stack: MoldStack) -> Dish:
    """The dish without bosses or holes, in the mold's frame.

    Cells must be triangles, because four markers on a crown are not in one plane.
    """
    assert stack.crown is not None
    border = _crown_border(stack.crown)
    used = np.unique(stack.layout.cell_corners)
    markers = stack.marker_xy_mm[used]
    points = np.concatenate([border.points, np.column_stack([markers, stack.crown.z_mm(markers)])])
    number = np.full(len(stack.marker_xy_mm), -1)
    number[used] = len(border.points) + np.arange(len(used))
    cells = [tuple(corners) for corners in number[stack.layout.cell_corners].tolist()]
    facets = [*cells, *_triangulate_rim(points[:, :2], len(border.points), cells)]
    return Dish(points, border.foot, facets, border.ends, {}, 0.0)


def make_dish(stack: MoldStack, color: int, through: bool) -> Dish:
    """The dish of a color's plate or (``through``) stencil; the number of a cell is that of its facet."""
    dish = make_bare_dish(stack)
    height = stack.options.stencil_mm if through else stack.thickness_mm[1]
    if through:
        starts = [below for below, _ in stencil_hole_outlines(stack, color)]
    else:
        starts = [cavity.open for cavity in cavities(stack, color)]
    growth = STENCIL_LEAN * height if through else -stack.draft_mm
    cells = np.flatnonzero(stack.layout.cell_color == color).tolist()
    chorded = [start.with_chords() for start in starts]
    outlines = {cell: (loop, loop.offset(growth)) for cell, loop in zip(cells, chorded, strict=True)}
    return replace(dish, outlines=outlines, height_mm=height)


def _volume_under_mm3(corners: Points) -> float:
    """The volume between a flat polygon and z = 0: a fan of prisms under triangles."""
    a, b, c = corners[0], corners[1:-1], corners[2:]
    x1, y1 = (b - a)[:, :2].T
    x2, y2 = (c - a)[:, :2].T
    return float(((x1 * y2 - x2 * y1) / 2 * (a[2] + b[:, 2] + c[:, 2]) / 3).sum())


class _CrownBorder(NamedTuple):
    """The border of a crown in plan.

    Attributes:
        points: (B, 3) counter-clockwise, mm.
        foot: numbers of the points at the foot.
        ends: end facets of a cylinder.
    """

    points: Points
    foot: tuple[int, ...]
    ends: list[FacetPoints]


def _crown_border(crown: Crown) -> _CrownBorder:
    if crown.shape == "sphere":
        angle = 2 * np.pi * np.arange(FOOT_POINTS) / FOOT_POINTS
        circle = crown.reach_mm * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        return _CrownBorder(circle, tuple(range(FOOT_POINTS)), [])
    slope = np.radians(crown.slope_deg) * np.linspace(1, -1, ARCH_POINTS)
    x = crown.radius_mm * np.sin(slope)
    x[[0, -1]] = crown.reach_mm, -crown.reach_mm
    z = crown.z_mm(np.column_stack([x, 0 * x]))
    z[[0, -1]] = 0.0
    y = crown.length_mm - z / END_SLOPE
    back = np.column_stack([x, y, z])
    front = np.column_stack([-x, -y, z])
    n = ARCH_POINTS
    return _CrownBorder(
        points=np.concatenate([back, front]),
        foot=(0, n - 1, n, 2 * n - 1),
        ends=[tuple(range(n))[::-1], tuple(range(n, 2 * n))[::-1]],
    )


def _triangulate_rim(plan: Points, border: int, cells: Sequence[FacetPoints]) -> list[FacetPoints]:
    """Triangles between the cells and the border, whose points are the first ``border``; no points are added."""
    import shapely

    pattern = shapely.coverage_union_all(shapely.polygons([plan[list(cell)] for cell in cells]))
    ring = shapely.Polygon(plan[:border]).difference(pattern)
    number_at = {(x, y): number for number, (x, y) in enumerate(plan.tolist())}
    facets = []
    for triangle in shapely.constrained_delaunay_triangles(ring).geoms:
        corners = [number_at[point] for point in list(triangle.exterior.coords)[:3]]
        a, b, c = plan[corners]
        turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        facets.append(tuple(corners if turn > 0 else corners[::-1]))
    return facets
