"""Cells in contact: neighbours in the pattern share a corner; a triangle's ink and corner determine its number.

The only extrapolation is by one cell's own triangle to its neighbour, and back. Cells connected by corners are numbered
in the same way, also where damage has cut the mesh (the article's eqs. 4 and 5).
"""

from __future__ import annotations

from typing import NamedTuple

from extractor.localmap.affine_maps import LIMITS as MAP_LIMITS
from extractor.localmap.affine_maps import AffineMapLimits


class CornerContactLimits(NamedTuple):
    """Limits of contacts.

    Attributes:
        max_corner_distance: of the shorter edge, between the corners of two triangles at one marker. Chosen.
        max_predicted_distance: of two neighbours' distance, from a center to the other triangle's prediction. Measured:
            rule "both triangles".
        max_map_difference: between two cells' maps, of a map's size; a rotation by 120 degrees makes 1.7. Chosen.
        max_neighbour_distance: of an edge, between the centers of neighbours without triangles. Chosen.
        maps: of the linear maps by which triangles are oriented.
    """

    max_corner_distance: float = 0.3
    max_predicted_distance: float = 0.35
    max_map_difference: float = 0.5
    max_neighbour_distance: float = 1.6
    maps: AffineMapLimits = MAP_LIMITS


LIMITS = CornerContactLimits()
