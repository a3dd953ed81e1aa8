"""Kerf compensation: paths of the beam's centre along which the beam touches an outline from inside or outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import BeamFootprint, Points

# A 60 degree corner has a mitre ratio of exactly 2; the sharpest corner of the elliptical pattern needs 8.
MITRE_LIMIT = 16.0


def inset_polygons(polygons_mm: Points, beam: BeamFootprint) -> tuple[Points, NDArray[np.bool_]]:
    """Compute the paths along which the beam touches every side of convex polygons from inside, in closed form.

    Each side moves inward by the footprint's extent along the side's normal (one beam unit). The corners of the path
    are the intersections of neighbouring moved sides.

    Args:
        polygons_mm: (N, K, 2) convex polygons, counter-clockwise.
        beam: the footprint.

    Returns:
        (N, K, 2) paths, and (N,) True where a path exists: no side has vanished or reversed.
    """
    if beam.is_point:
        return polygons_mm, np.ones(len(polygons_mm), dtype=np.bool_)
    corners = beam.to_beam_units(polygons_mm)
    side = np.roll(corners, -1, axis=1) - corners
    with np.errstate(divide="ignore", invalid="ignore"):
        inward = (
            np.stack([-side[..., 1], side[..., 0]], axis=-1) / np.hypot(side[..., 0], side[..., 1])[..., None]
        )
        before = np.roll(inward, 1, axis=1)
        moves = (before + inward) / (1 + (before * inward).sum(axis=-1))[..., None]
    path = corners + moves
    kept = ((np.roll(path, -1, axis=1) - path) * side).sum(axis=-1) > 0
    return beam.to_millimetres(path), kept.all(axis=1)


def inset_outline(outline_mm: Points, beam: BeamFootprint) -> list[Points]:
    """Paths along which the beam touches a simple outline (K, 2) from inside.

    Returns:
        None, one or several closed paths, counter-clockwise.
    """
    return _offset_outline(outline_mm, beam, -1.0)


def outset_outline(outline_mm: Points, beam: BeamFootprint) -> list[Points]:
    """Paths along which the beam touches a simple outline (K, 2) from outside: the inside keeps its size."""
    return _offset_outline(outline_mm, beam, 1.0)


def polygon_areas(polygons: Points) -> NDArray[np.float64]:
    """(N,) signed areas of (N, K, 2) polygons."""
    after = np.roll(polygons, -1, axis=1)
    cross = polygons[..., 0] * after[..., 1] - after[..., 0] * polygons[..., 1]
    return np.asarray(cross.sum(axis=1) / 2)


def _offset_outline(outline_mm: Points, beam: BeamFootprint, distance: float) -> list[Points]:
    import shapely

    if beam.is_point:
        return [outline_mm]
    polygon = shapely.Polygon(beam.to_beam_units(outline_mm))
    moved = shapely.buffer(polygon, distance, join_style="mitre", mitre_limit=MITRE_LIMIT)
    parts = [part for part in shapely.get_parts(moved) if not part.is_empty]
    rings = [shapely.get_coordinates(shapely.orient_polygons(part).exterior)[:-1] for part in parts]
    return [beam.to_millimetres(ring) for ring in rings]
