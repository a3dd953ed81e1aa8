"""Lengths, areas and angles of a layout's cells and edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout

Values = NDArray[np.float64]


def edge_lengths_mm(layout: Layout) -> Values:
    """(E,) float64: length of every edge."""
    ends = layout.marker_xy_mm[layout.edges]
    return np.asarray(np.hypot(*(ends[:, 1] - ends[:, 0]).T))


def cell_areas_mm2(layout: Layout) -> Values:
    """(C,) float64: signed area of every cell, positive when counter-clockwise from the front (shoelace formula)."""
    x, y = np.moveaxis(layout.marker_xy_mm[layout.cell_corners], -1, 0)
    return np.asarray((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2)


def cell_widths_mm(layout: Layout) -> Values:
    """(C,) float64: diameter of every cell's inscribed circle, 4 area / perimeter; exact for triangles and squares."""
    corners = layout.marker_xy_mm[layout.cell_corners]
    sides = np.roll(corners, -1, axis=1) - corners
    perimeters = np.hypot(sides[..., 0], sides[..., 1]).sum(axis=1)
    return np.asarray(4 * cell_areas_mm2(layout) / perimeters)


def cell_angles_deg(layout: Layout) -> Values:
    """(C,) float64: the smallest inner angle of every cell."""
    corners = layout.marker_xy_mm[layout.cell_corners]
    to_next, to_previous = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = to_next[..., 0] * to_previous[..., 1] - to_next[..., 1] * to_previous[..., 0]
    angles = np.arctan2(cross, (to_next * to_previous).sum(axis=-1))
    return np.asarray(np.degrees(angles.min(axis=1)))
