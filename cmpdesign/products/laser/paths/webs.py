"""Webs: the walls left between cavities. Only pairs that can have the smallest web are measured exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.products.laser.paths.beam import BeamFootprint, Points
from cmpdesign.products.laser.paths.cavities import Cavities, burnt_shapes

# Decimals in mm to which pairs of cavities are compared: copies are measured once.
SAME_DECIMALS = 6
# Distance of the points of an outline at which depths are measured.
DEPTH_STEP_MM = 0.02


def smallest_web_mm(
    groups: Sequence[Cavities],
    outlines: Sequence[Points],
    beam: BeamFootprint,
    reach_mm: float,
    across: bool = False,
) -> float | None:
    """The smallest distance between two burnt outlines.

    The distance of two paths, less the footprint's largest and smallest width, bounds the web between them. Outlines
    are compared only for pairs whose lower bound lies below every upper bound.

    Args:
        groups, outlines: groups of cavities and their burnt outlines.
        beam: the footprint at the face.
        reach_mm: centres further apart than this, plus twice a cell's size, are not compared.
        across: True: pairs of the first group with every other group; False: pairs within the single group.

    Returns:
        The distance in mm; 0 where outlines meet, None without a pair within reach.
    """
    import shapely

    lines = np.concatenate([_cavity_lines(group) for group in groups])
    pairs = _neighbour_pairs(groups, reach_mm, across)
    if not len(pairs):
        return None
    gap = shapely.distance(lines[pairs[:, 0]], lines[pairs[:, 1]])
    wide, narrow = 2 * max(beam.x_mm, beam.y_mm), beam.narrow_mm
    if wide == narrow:
        return float(max(gap.min() - wide, 0))
    pairs = pairs[gap - wide <= gap.min() - narrow]
    burnt = np.concatenate(outlines)
    pairs = _distinct_pairs(pairs, burnt)
    shapes = burnt_shapes(burnt[np.unique(pairs)])
    index = np.searchsorted(np.unique(pairs), pairs)
    return float(shapely.distance(shapes[index[:, 0]], shapes[index[:, 1]]).min())


def burn_depth_mm(outlines: Points, filled: Points) -> float:
    """Largest depth of burnt outlines in filled outlines: the distance of a burnt point from the filled one's rim.

    Points of the outlines are compared, ``DEPTH_STEP_MM`` apart or less.
    """
    import shapely

    burnt, cured = burnt_shapes(outlines), burnt_shapes(filled)
    meeting = np.unique(shapely.STRtree(cured).query(burnt, predicate="intersects")[0])
    points = shapely.points(shapely.get_coordinates(shapely.segmentize(burnt[meeting], DEPTH_STEP_MM)))
    inside, around = shapely.STRtree(cured).query(points, predicate="within")
    return float(shapely.distance(points[inside], shapely.boundary(cured)[around]).max(initial=0.0))


def _cavity_lines(group: Cavities) -> NDArray[np.object_]:
    """Each cavity's path with its spurs, as one closed line."""
    import shapely

    return np.asarray(shapely.linearrings(group.loops_mm), dtype=np.object_)


def _neighbour_pairs(groups: Sequence[Cavities], reach_mm: float, across: bool) -> NDArray[np.int64]:
    """(P, 2) int64 indices of cavities, counted through all groups, whose centres lie within reach."""
    with extra("laser"):
        from scipy.spatial import cKDTree

    centres = [group.nominal_mm.mean(axis=1) for group in groups]
    size = max(
        float(np.linalg.norm(group.nominal_mm - centre[:, None], axis=-1).max())
        for group, centre in zip(groups, centres, strict=True)
    )
    if not across:
        within = cKDTree(centres[0]).query_pairs(reach_mm + size, output_type="ndarray")
        return np.asarray(within, dtype=np.int64)
    others = np.concatenate(centres[1:])
    pairs = cKDTree(centres[0]).sparse_distance_matrix(
        cKDTree(others), reach_mm + size, output_type="ndarray"
    )
    return np.column_stack([pairs["i"], pairs["j"] + len(centres[0])]).astype(np.int64)


def _distinct_pairs(pairs: NDArray[np.int64], burnt: Points) -> NDArray[np.int64]:
    """(P, 2) one pair of each shape; the shape is all points relative to the first cavity's first point."""
    first = burnt[pairs[:, 0]]
    origin = first[:, :1]
    every_fourth = slice(None, None, 4)
    second = burnt[pairs[:, 1]]
    shape = np.concatenate([first[:, every_fourth] - origin, second[:, every_fourth] - origin], axis=1)
    key = np.round(shape.reshape(len(pairs), -1), SAME_DECIMALS) + 0.0
    packed = np.ascontiguousarray(key).view([("", key.dtype)] * key.shape[1]).ravel()
    return pairs[np.unique(packed, return_index=True)[1]]
