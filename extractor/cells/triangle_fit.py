"""Stage 5: fits triangles to the regions that are triangles, first to their moments, then to their edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor.cells.region_growing import Regions
from extractor.cells.seeds import Seeds, domain_moments
from extractor.cells.triangle_edges import update_triangle_corners
from extractor.image.pyramid import PyramidLevel
from extractor.numeric.compilation import compiled

# In coordinates in which its covariance is the identity, every triangle is equilateral with corners at the radius
# sqrt(8), and its third complex moment E[z^3] is 8^1.5 / 10 with 3 times the argument of a corner.
CORNER_RADIUS = np.sqrt(8.0)
THIRD_MOMENT = 8.0**1.5 / 10.0
SINE_120 = np.sqrt(0.75)
MIN_TRIANGULARITY = 0.45  # |E[z^3]| relative to a triangle's; a disc, an ellipse and a square have 0
MIN_ROUGH_TRIANGULARITY = 0.1  # the same for domains of few pixels
MAX_ELONGATION = 30.0  # (trace of the covariance)^2 / determinant; 4 is equilateral
MIN_AREA_PX = 4.0  # px^2


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


@compiled
def _fit_to_moments(moments, seed, min_area, min_triangularity):  # type: ignore[no-untyped-def]
    """(N, 3, 2) the triangles with the regions' moments up to the third order; (N,) bool, regions that are triangles.

    Args:
        moments: (N, 10) about ``seed`` (N, 2), as in ``Regions``.
        min_area: px^2; min_triangularity: of |E[z^3]|, relative to a triangle's.
    """
    count = moments.shape[0]
    corners = np.zeros((count, 3, 2))
    good = np.zeros(count, np.bool_)
    for i in range(count):
        n = moments[i, 0]
        if n < min_area:
            continue
        mx, my = moments[i, 1] / n, moments[i, 2] / n
        # a pixel is a square, not a point: it adds 1/12 to each variance
        xx = moments[i, 3] / n - mx * mx + 1.0 / 12.0
        xy = moments[i, 4] / n - mx * my
        yy = moments[i, 5] / n - my * my + 1.0 / 12.0
        determinant = xx * yy - xy * xy
        if determinant <= 0.0 or (xx + yy) ** 2 > MAX_ELONGATION * determinant:
            continue
        xxx = moments[i, 6] / n - 3 * mx * moments[i, 3] / n + 2 * mx**3
        xxy = moments[i, 7] / n - 2 * mx * moments[i, 4] / n - my * moments[i, 3] / n + 2 * mx * mx * my
        xyy = moments[i, 8] / n - 2 * my * moments[i, 4] / n - mx * moments[i, 5] / n + 2 * mx * my * my
        yyy = moments[i, 9] / n - 3 * my * moments[i, 5] / n + 2 * my**3
        # whitened z = L^-1 (p - mean), L the Cholesky factor of the covariance
        a = np.sqrt(xx)
        b = xy / a
        c = np.sqrt(determinant / xx)
        ia, ic = 1.0 / a, 1.0 / c
        ib = -b * ia * ic
        uuu = ia**3 * xxx
        uuv = ia * ia * (ib * xxx + ic * xxy)
        uvv = ia * (ib * ib * xxx + 2 * ib * ic * xxy + ic * ic * xyy)
        vvv = ib**3 * xxx + 3 * ib * ib * ic * xxy + 3 * ib * ic * ic * xyy + ic**3 * yyy
        real, imaginary = uuu - 3 * uvv, 3 * uuv - vvv
        if np.hypot(real, imaginary) < min_triangularity * THIRD_MOMENT:
            continue
        angle = np.arctan2(imaginary, real) / 3.0
        u, v = CORNER_RADIUS * np.cos(angle), CORNER_RADIUS * np.sin(angle)
        for k in range(3):
            corners[i, k, 0] = seed[i, 0] + mx + a * u
            corners[i, k, 1] = seed[i, 1] + my + b * u + c * v
            u, v = -0.5 * u - SINE_120 * v, SINE_120 * u - 0.5 * v  # turned by 120 degrees
        good[i] = True
    return corners, good


def triangles_from_moments(seeds: Seeds, scale: int) -> Triangles:
    """The triangular domains, by their moments alone: without region growing and sub-pixel edges.

    Args:
        seeds: the domains, at 1/``scale`` of the image's scale.
        scale: full-scale pixels per pixel of the seeds.
    """
    moments = domain_moments(seeds.runs, seeds.domain, seeds.xy)
    corners, good = _fit_to_moments(moments, seeds.xy, MIN_AREA_PX, MIN_ROUGH_TRIANGULARITY)
    corners = (corners + 0.5) * scale - 0.5
    return Triangles(corners[good], seeds.ink[good], np.flatnonzero(good).astype(np.int32))


def fit_triangles(view: PyramidLevel, regions: Regions, scale: int = 1) -> Triangles:
    """Stage 5: select the regions that are triangles, and measure their edges with sub-pixel accuracy.

    Args:
        view: the image at full scale.
        regions: grown at 1/``scale`` of the image's scale.
        scale: full-scale pixels per pixel of the regions.
    """
    return Triangles(*_triangle_arrays(view, regions.moments, regions.seed, regions.ink, scale))


@compiled
def _triangle_arrays(view, moments, seed, ink, scale):  # type: ignore[no-untyped-def]
    """The fields of ``Triangles``."""
    corners, good = _fit_to_moments(moments, seed, MIN_AREA_PX, MIN_TRIANGULARITY)
    corners = (corners + 0.5) * scale - 0.5
    update_triangle_corners(view, corners, good)
    region = np.flatnonzero(good)
    return corners[region], ink[region], region.astype(np.int32)
