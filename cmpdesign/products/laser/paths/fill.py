"""Pockets: strokes that clear the area inside a cell's wall path, by parallel lines or by rings."""

from __future__ import annotations

import numpy as np

from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.kerf import inset_polygons, polygon_areas
from cmpdesign.products.laser.paths.strokes import Strokes, join_strokes, loop_strokes, round_points

# Least area of a ring, as a share of the squared spacing; machines run smaller rings as points.
MIN_RING_AREA_SHARE = 0.01


def hatch_strokes(paths_mm: Points, spacing_mm: float, angle_deg: float) -> Strokes:
    """Parallel lines inside convex wall paths, in alternating directions, on one grid for all cells.

    Args:
        paths_mm: (N, K, 2) wall paths, which bound the area of the beam's centre.
        spacing_mm: distance of the lines.
        angle_deg: direction of the lines, counter-clockwise from x.

    Returns:
        Open strokes; the owner is the wall path's index.
    """
    turn = np.radians(angle_deg)
    along = paths_mm @ (np.cos(turn), np.sin(turn))
    across = paths_mm @ (-np.sin(turn), np.cos(turn)) / spacing_mm - 0.5
    lowest = np.ceil(across.min(axis=1)).astype(np.int64)
    counts = np.maximum(np.floor(across.max(axis=1)).astype(np.int64) - lowest + 1, 0)
    owner = np.repeat(np.arange(len(paths_mm)), counts)
    row = lowest[owner] + np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)

    start, end = across[owner], np.roll(across, -1, axis=1)[owner]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (row[:, None] - start) / (end - start)
    crossed = (share >= 0) & (share <= 1)
    places = along[owner] + share * (np.roll(along, -1, axis=1)[owner] - along[owner])
    left = np.where(crossed, places, np.inf).min(axis=1)
    right = np.where(crossed, places, -np.inf).max(axis=1)
    backward = (row % 2 == 1)[:, None]
    ends = np.where(backward, np.stack([right, left], axis=-1), np.stack([left, right], axis=-1))
    height = spacing_mm * (row + 0.5)[:, None]
    x = ends * np.cos(turn) - height * np.sin(turn)
    y = ends * np.sin(turn) + height * np.cos(turn)
    points = round_points(np.stack([x, y], axis=-1).reshape(-1, 2))
    return Strokes(points, 2 * np.arange(len(owner) + 1), owner, closed=False)


def ring_strokes(paths_mm: Points, spacing_mm: float) -> Strokes:
    """Rings inside convex wall paths, the innermost first, without the wall path itself.

    Args:
        paths_mm: (N, K, 2) wall paths.
        spacing_mm: distance of the rings.

    Returns:
        Closed strokes; the owner is the wall path's index.
    """
    spacing = BeamFootprint(spacing_mm, spacing_mm)
    parts: list[Strokes] = []
    inner, owner = paths_mm, np.arange(len(paths_mm))
    while len(inner):
        inner, exists = inset_polygons(inner, spacing)
        exists &= polygon_areas(inner) > MIN_RING_AREA_SHARE * spacing_mm**2
        inner, owner = inner[exists], owner[exists]
        parts.append(loop_strokes(inner, owner))
    # The rings are opened, joined by owner from the inside out, and closed again.
    joined = join_strokes([part.opened() for part in reversed(parts)])
    keep = np.ones(len(joined.xy_mm), dtype=np.bool_)
    keep[joined.first[1:] - 1] = False
    first = joined.first - np.arange(len(joined.first))
    return Strokes(joined.xy_mm[keep], first, joined.owner, closed=True)
