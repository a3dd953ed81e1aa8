"""The curved side of a domed pad's plates and stencils: flat facets between markers, bosses or holes in them.

The facets are the pattern's own cells, with their corners on the crown, and triangles from the pattern's rim
to the crown's foot. A facet lies below the crown by at most pitch^2 / (6 radius), some micrometres. As
everything is flat, the shells are exact: volumes are sums over facets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.mold.shapes.bosses import STENCIL_LEAN
from cmpdesign.products.mold.solids.loops import Loop, Points, frustum_volume_mm3, inset_cells, polygon_loop
from cmpdesign.products.mold.stack.crown import END_SLOPE, Crown
from cmpdesign.products.mold.stack.stack import MoldStack

FOOT_POINTS = 96
ARCH_POINTS = 24
FacetPoints = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Dish:
    """A polyhedral crown, and the outlines of bosses or holes on it.

    Attributes:
        points: (P, 3) corners of facets.
        foot: the points that bound the crown at z = 0, counter-clockwise.
        facets: corners of each facet, counter-clockwise from above.
        ends: leaning facets at the ends of a cylinder, counter-clockwise from outside.
        outlines: facet -> (the boss's or hole's outline where it meets the facet, its other end), in plan.
        height_mm: from an outline to its other end, along z.
    """

    points: Points
    foot: tuple[int, ...]
    facets: list[FacetPoints]
    ends: list[FacetPoints]
    outlines: dict[int, tuple[Loop, Loop]]
    height_mm: float

    def z_at(self, facet: int, xy_mm: Points) -> NDArray[np.float64]:
        """(N,) height of a facet's plane."""
        a, b, c = (self.points[i] for i in self.facets[facet][:3])
        normal = np.cross(b - a, c - a)
        heights: NDArray[np.float64] = a[2] - ((xy_mm - a[:2]) @ normal[:2]) / normal[2]
        return heights

    def volume_mm3(self) -> float:
        """Between the facets and z = 0."""
        total = 0.0
        for facet in self.facets:
            corners = self.points[list(facet)]
            total += polygon_loop(corners[:, :2]).area_mm2() * float(corners[:, 2].mean())
        return total + sum(_volume_under_mm3(self.points[list(end)]) for end in self.ends)

    def outlines_volume_mm3(self) -> float:
        """Of all bosses or holes; a shear along z leaves a frustum's volume as it is."""
        return sum(frustum_volume_mm3(start, end, self.height_mm) for start, end in self.outlines.values())


def make_bare_dish(stack: MoldStack) -> Dish:
    """The crown without bosses or holes, in the mold's frame, seen from above.

    Cells must be triangles: four markers on a crown are in no plane.
    """
    assert stack.crown is not None
    border, foot, ends = _crown_border(stack.crown)
    kept = np.unique(stack.layout.cell_corners)
    markers = stack.marker_xy_mm[kept]
    points = np.concatenate([border, np.column_stack([markers, stack.crown.z_mm(markers)])])
    number = np.full(len(stack.marker_xy_mm), -1)
    number[kept] = len(border) + np.arange(len(kept))
    cells = [tuple(corners) for corners in number[stack.layout.cell_corners].tolist()]
    facets = [*cells, *_triangulate_rim(points[:, :2], len(border), cells)]
    return Dish(points, foot, facets, ends, {}, 0.0)


def make_dish(stack: MoldStack, color: int, through: bool) -> Dish:
    """The dish of a color's plate or (``through``) stencil; a facet's number is its cell's."""
    dish = make_bare_dish(stack)
    option = stack.options
    height = option.stencil_mm if through else stack.thickness_mm[1]
    grows = (STENCIL_LEAN if through else -stack.lean) * height
    inset = option.gap_mm / 2 + (option.clearance_mm if through else 0.0)
    # A boss's edges are rounder at its root than at its tip, a stencil's hole begins with the tip's radius.
    radius = option.tip_radius_mm - min(grows, 0.0) if option.tip_radius_mm else 0.0
    outlines = {}
    for cell in np.flatnonzero(stack.layout.cell_color == color).tolist():
        (start,) = inset_cells(dish.points[None, list(dish.facets[cell]), :2], inset, radius)
        outlines[cell] = start.chorded(), start.chorded().moved(grows)
    return replace(dish, outlines=outlines, height_mm=height)


def _volume_under_mm3(corners: Points) -> float:
    """Between a flat polygon and z = 0: a fan of prisms, each under a triangle."""
    a, b, c = corners[0], corners[1:-1], corners[2:]
    x1, y1 = (b - a)[:, :2].T
    x2, y2 = (c - a)[:, :2].T
    return float(((x1 * y2 - x2 * y1) / 2 * (a[2] + b[:, 2] + c[:, 2]) / 3).sum())


def _crown_border(crown: Crown) -> tuple[Points, tuple[int, ...], list[FacetPoints]]:
    """(B, 3) points around the crown in plan, counter-clockwise; the foot's; a cylinder's end facets."""
    if crown.shape == "sphere":
        angle = 2 * np.pi * np.arange(FOOT_POINTS) / FOOT_POINTS
        ring = crown.reach_mm * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        return ring, tuple(range(FOOT_POINTS)), []
    slope = np.radians(crown.slope_deg) * np.linspace(1, -1, ARCH_POINTS)
    x = crown.radius_mm * np.sin(slope)
    x[[0, -1]] = crown.reach_mm, -crown.reach_mm
    z = crown.z_mm(np.column_stack([x, 0 * x]))
    z[[0, -1]] = 0.0
    y = crown.length_mm - z / END_SLOPE
    back = np.column_stack([x, y, z])
    front = np.column_stack([-x, -y, z])
    n = ARCH_POINTS
    return (
        np.concatenate([back, front]),
        (0, n - 1, n, 2 * n - 1),
        [tuple(range(n))[::-1], tuple(range(n, 2 * n))[::-1]],
    )


def _triangulate_rim(plan: Points, border: int, cells: Sequence[FacetPoints]) -> list[FacetPoints]:
    """Triangles between the pattern and the border, on no other points than theirs."""
    import shapely

    pattern = shapely.coverage_union_all(shapely.polygons([plan[list(cell)] for cell in cells]))
    ring = shapely.Polygon(plan[:border]).difference(pattern)
    at = {(x, y): number for number, (x, y) in enumerate(plan.tolist())}
    facets = []
    for triangle in shapely.constrained_delaunay_triangles(ring).geoms:
        corners = [at[point] for point in list(triangle.exterior.coords)[:3]]
        a, b, c = plan[corners]
        turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        facets.append(tuple(corners if turn > 0 else corners[::-1]))
    return facets
