"""Stage 5: fits triangles to the regions that are triangles, first to their moments, then to their edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.region_growing import Regions
from extractor.cells.seeds import Seeds, domain_moments
from extractor.cells.triangle_edges import LIMITS as EDGE_LIMITS
from extractor.cells.triangle_edges import TriangleEdgeLimits
from extractor.image.pyramid import PyramidLevel


class MomentLimits(NamedTuple):
    """Limits of regions whose moments are those of triangles.

    Attributes:
        min_area_px: px^2. Chosen.
        min_triangularity: |E[z^3]| relative to a triangle's; a disc, an ellipse and a square have 0. Chosen between
            both.
        max_elongation: (trace of the covariance)^2 / determinant; 4 is equilateral. Chosen.
    """

    min_area_px: float = 4.0
    min_triangularity: float = 0.45
    max_elongation: float = 30.0


class TriangleLimits(NamedTuple):
    """Limits of both fits.

    Attributes:
        moments: of the fit to moments.
        edges: of the fit to edges.
    """

    moments: MomentLimits = MomentLimits()
    edges: TriangleEdgeLimits = EDGE_LIMITS


LIMITS = TriangleLimits()
ROUGH_LIMITS = MomentLimits(min_triangularity=0.1)  # for domains of few pixels


@dataclass(frozen=True, eq=False)
class Triangles:
    """Stage 5.

    Attributes:
        corner_px: (T, 3, 2) float64 in the image frame, clockwise in the image.
        ink: (T,) uint8, 1 red, 2 green, 3 blue.
        region: (T,) int32, the region of each triangle.
    """

    corner_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    region: NDArray[np.int32]

    @property
    def edge_px(self) -> float:
        """The median length of the edges; 0 without triangles."""
        if len(self.ink) == 0:
            return 0.0
        return float(np.median(np.linalg.norm(self.corner_px - np.roll(self.corner_px, 1, axis=1), axis=2)))


def triangles_from_moments(seeds: Seeds, scale: int) -> Triangles:
    """The triangular domains, by their moments alone: without region growing and sub-pixel edges.

    Args:
        seeds: the domains, at 1/``scale`` of the image's scale.
        scale: full-scale pixels per pixel of the seeds.
    """
    corners, good = native.fit_to_moments(domain_moments(seeds), seeds.xy, ROUGH_LIMITS)
    corners = (corners + 0.5) * scale - 0.5
    return Triangles(corners[good], seeds.ink[good], np.flatnonzero(good).astype(np.int32))


def fit_triangles(view: PyramidLevel, regions: Regions, scale: int = 1) -> Triangles:
    """Stage 5: select the regions that are triangles, and measure their edges with sub-pixel accuracy.

    Args:
        view: the image at full scale.
        regions: grown at 1/``scale`` of the image's scale.
        scale: full-scale pixels per pixel of the regions.
    """
    return Triangles(*native.triangle_arrays(view, regions.moments, regions.seed, regions.ink, scale, LIMITS))
