"""Webs: the walls left between cavities. Only pairs that can hold the smallest one are measured exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import Cavities

# Pairs that are copies of each other to a nanometre are measured once.
SAME_DECIMALS = 6


def smallest_web_mm(
    made: Sequence[Cavities],
    outlines: Sequence[Points],
    beam: BeamFootprint,
    reach_mm: float,
    across: bool = False,
) -> float | None:
    """The smallest distance between two burnt outlines; 0 where they meet, None where none lies within reach.

    The distance of two paths, less the footprint's largest and smallest width, bounds the web between
    them; the
    outlines themselves are compared only for pairs whose lower bound lies below every upper bound.

    Args:
        made, outlines: groups of cavities and their burnt outlines.
        beam: the footprint at the face in question.
        reach_mm: centres further apart than this, plus twice a cell's size, are not compared.
        across: only pairs of the first group with any other group; otherwise all pairs of the one group.
    """
    import shapely

    lines = np.concatenate([_cavity_lines(group) for group in made])
    pairs = _neighbour_pairs(made, reach_mm, across)
    if not len(pairs):
        return None
    gap = shapely.distance(lines[pairs[:, 0]], lines[pairs[:, 1]])
    wide, narrow = 2 * max(beam.x_mm, beam.y_mm), beam.narrow_mm
    if wide == narrow:
        return float(max(gap.min() - wide, 0))
    pairs = pairs[gap - wide <= gap.min() - narrow]
    burnt = np.concatenate(outlines)
    pairs = _distinct_pairs(pairs, burnt)
    shapes = shapely.polygons(burnt[np.unique(pairs)])
    index = np.searchsorted(np.unique(pairs), pairs)
    return float(shapely.distance(shapes[index[:, 0]], shapes[index[:, 1]]).min())


def burn_depth_mm(outlines: Points, filled: Points) -> float:
    """How deep one group of outlines runs into another: the farthest burnt point from the filled one's
    rim."""
    import shapely

    burnt, cured = shapely.polygons(outlines), shapely.polygons(filled)
    tree = shapely.STRtree(cured)
    one, other = tree.query(burnt, predicate="intersects")
    deepest = 0.0
    for a, b in zip(burnt[one], cured[other], strict=True):
        points = shapely.points(shapely.get_coordinates(shapely.intersection(a, b)))
        rim = shapely.boundary(b)
        deepest = max(deepest, float(shapely.distance(points, rim).max(initial=0.0)))
    return deepest


def _cavity_lines(group: Cavities) -> NDArray[np.object_]:
    """Each cavity's path with its spurs, as one closed line."""
    import shapely

    return np.asarray(shapely.linearrings(group.loops_mm), dtype=np.object_)


def _neighbour_pairs(made: Sequence[Cavities], reach_mm: float, across: bool) -> NDArray[np.int64]:
    from scipy.spatial import cKDTree

    centres = [group.nominal_mm.mean(axis=1) for group in made]
    size = max(
        float(np.linalg.norm(group.nominal_mm - centre[:, None], axis=-1).max())
        for group, centre in zip(made, centres, strict=True)
    )
    if not across:
        found = cKDTree(centres[0]).query_pairs(reach_mm + size, output_type="ndarray")
        return np.asarray(found, dtype=np.int64)
    others = np.concatenate(centres[1:])
    near = cKDTree(centres[0]).sparse_distance_matrix(cKDTree(others), reach_mm + size, output_type="ndarray")
    return np.column_stack([near["i"], near["j"] + len(centres[0])]).astype(np.int64)


def _distinct_pairs(pairs: NDArray[np.int64], burnt: Points) -> NDArray[np.int64]:
    """One pair of each shape: relative to the first cavity's first point, all points the same."""
    first = burnt[pairs[:, 0]]
    origin = first[:, :1]
    thin = slice(None, None, 4)
    shape = np.concatenate([first[:, thin] - origin, burnt[pairs[:, 1]][:, thin] - origin], axis=1)
    key = np.round(shape.reshape(len(pairs), -1), SAME_DECIMALS) + 0.0
    packed = np.ascontiguousarray(key).view([("", key.dtype)] * key.shape[1]).ravel()
    return pairs[np.unique(packed, return_index=True)[1]]
