"""Stage 5: a triangle for every region that is one, first from its moments, then from its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .regions import Regions, Seeds, domain_moments
from .sampling import MARGIN, clamp, fixed, fixed_step, sample_fixed, sample_patch

# In coordinates in which its covariance is the identity, every triangle is equilateral with its corners at the
# radius sqrt(8), and its third complex moment E[z^3] is 8^1.5 / 10 with the argument 3 times a corner's.
CORNER_RADIUS = np.sqrt(8.0)
THIRD_MOMENT = 8.0**1.5 / 10.0
HALF_ROOT = np.sqrt(0.75)
MIN_TRIANGULARITY = 0.45  # |E[z^3]| against a triangle's; a disc, an ellipse, a square have 0
ROUGH_TRIANGULARITY = 0.1  # of what has too few pixels to tell
MAX_ELONGATION = 30.0  # (trace of the covariance)^2 / determinant; 4 is equilateral
MIN_AREA_PX = 4.0
MAX_GROWTH = 3.0  # of a domain's area over its region's
FIRST = 0.25  # of an edge, where its first profile crosses it; the second does as far from its end
HALF_PROFILE = 4  # samples on each side of an edge
WINDOW = 0.8  # reach of a profile in units of the way from the cell's center to the middle of the edge
FINE_REACH_PX = 8.0  # profiles that reach farther are followed by narrower ones
MIN_CONTRAST = 12.0  # of an ink against what lies beyond its edge, over the three channels, 8-bit
MIN_SINE = 0.05  # two edges that meet at less than 3 degrees have no corner
MAX_CORNER_SHIFT = 1.0  # in units of the corner's distance from the center


@dataclass(frozen=True, eq=False)
class Triangles:
    """Stage 5.

    Attributes:
        corner_px: (T, 3, 2) float64 in the image frame, clockwise as seen in the image.
        ink: (T,) uint8, 1 red, 2 green, 3 blue.
        region: (T,) int32, the region it was fitted to.
    """

    corner_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    region: NDArray[np.int32]

    @property
    def edge_px(self) -> float:
        """The median edge; 0 without triangles."""
        if len(self.ink) == 0:
            return 0.0
        return float(np.median(np.linalg.norm(self.corner_px - np.roll(self.corner_px, 1, axis=1), axis=2)))


@compiled
def _fit(moments, seed, domain_px, min_area, least):  # type: ignore[no-untyped-def]
    """Triangles with the regions' moments up to the third order, and which regions are triangles at all."""
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
        if np.hypot(real, imaginary) < least * THIRD_MOMENT:
            continue
        angle = np.arctan2(imaginary, real) / 3.0
        # growing stops where the blurred rim darkens; the domain, cut nearer to the half level, tells the size
        radius = CORNER_RADIUS * np.sqrt(min(max(domain_px[i] / n, 1.0), MAX_GROWTH))
        u, v = radius * np.cos(angle), radius * np.sin(angle)
        for k in range(3):
            corners[i, k, 0] = seed[i, 0] + mx + a * u
            corners[i, k, 1] = seed[i, 1] + my + b * u + c * v
            u, v = -0.5 * u - HALF_ROOT * v, HALF_ROOT * u - 0.5 * v  # turned by 120 degrees
        good[i] = True
    return corners, good


@compiled
def _profile(flat, width, x, y, dx, dy, red, green, blue, zero):  # type: ignore[no-untyped-def]
    """The area under a profile from (x, y) in steps of (dx, dy), held between -0.2 and 1.2, in steps."""
    at_x, at_y, by_x, by_y = fixed(x), fixed(y), fixed_step(dx), fixed_step(dy)
    area = 0.0
    for m in range(2 * HALF_PROFILE + 1):
        f = clamp(sample_fixed(flat, width, at_x, at_y, red, green, blue) - zero, -0.2, 1.2)
        area += 0.5 * f if m == 0 or m == 2 * HALF_PROFILE else f
        at_x += by_x
        at_y += by_y
    return area


@compiled
def _edge_line(flat, height, width, corners, i, k, cx, cy, ink, share, beyond, lines):  # type: ignore[no-untyped-def]
    """Write the line n . p = d of edge k of triangle i, where its ink has fallen halfway to the color beyond; False
    without.

    The ink's profile across the edge, 1 inside and 0 outside, is integrated: its area is the edge's position
    whatever the blur, so no blur has to be known. The line through two such positions is the edge. Profiles run
    along the median, not the normal: so they stay clear of the other edges in any triangle. ``beyond`` is a buffer.
    """
    start_x, start_y = corners[i, k, 0], corners[i, k, 1]
    end_x, end_y = corners[i, (k + 1) % 3, 0], corners[i, (k + 1) % 3, 1]
    dx, dy = end_x - start_x, end_y - start_y
    length = np.sqrt(dx * dx + dy * dy)
    nx, ny = dy / length, -dx / length  # outward: corners run clockwise with y down
    depth = (start_x - cx) * nx + (start_y - cy) * ny
    ux, uy = start_x + 0.5 * dx - cx, start_y + 0.5 * dy - cy
    if not depth > 0.3 or not sample_patch(
        flat, height, width, cx + 2 * ux, cy + 2 * uy, 0.4 * depth, beyond
    ):
        return False
    u0, u1, u2 = ink[0] - beyond[0], ink[1] - beyond[1], ink[2] - beyond[2]
    contrast = u0 * u0 + u1 * u1 + u2 * u2
    if contrast < MIN_CONTRAST**2:
        return False
    u0, u1, u2 = u0 / contrast, u1 / contrast, u2 / contrast
    zero = u0 * beyond[0] + u1 * beyond[1] + u2 * beyond[2]
    step = share / HALF_PROFILE
    x0, y0 = start_x + FIRST * dx, start_y + FIRST * dy
    x1, y1 = end_x - FIRST * dx, end_y - FIRST * dy
    wide, high = share * abs(ux), share * abs(uy)
    if not (
        min(x0, x1) >= wide
        and min(y0, y1) >= high
        and max(x0, x1) + wide < width - 1.0 - MARGIN
        and max(y0, y1) + high < height - 1.0 - MARGIN
    ):
        return False  # a profile leaves the image
    first = _profile(flat, width, x0 - share * ux, y0 - share * uy, step * ux, step * uy, u0, u1, u2, zero)
    second = _profile(flat, width, x1 - share * ux, y1 - share * uy, step * ux, step * uy, u0, u1, u2, zero)
    first, second = depth * (first * step - share), depth * (second * step - share)
    slope = (second - first) / (1.0 - 2 * FIRST)
    off_a, off_b = first - FIRST * slope, second + FIRST * slope
    ax, ay = start_x + off_a * nx, start_y + off_a * ny
    dx, dy = end_x + off_b * nx - ax, end_y + off_b * ny - ay
    norm = np.sqrt(dx * dx + dy * dy)
    lines[k, 0], lines[k, 1] = dy / norm, -dx / norm
    lines[k, 2] = lines[k, 0] * ax + lines[k, 1] * ay
    return norm > 0.0


@compiled
def fit_edges(image, corners, good):  # type: ignore[no-untyped-def]
    """Move every triangle's corners to where the lines of its edges meet; in place.

    The first profiles reach across the cell; where it is large, narrower ones follow until they step by a pixel.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    ink, beyond, lines, moved = np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 2))
    for i in range(corners.shape[0]):
        share, passes = WINDOW, 0
        while good[i]:
            cx = (corners[i, 0, 0] + corners[i, 1, 0] + corners[i, 2, 0]) / 3
            cy = (corners[i, 0, 1] + corners[i, 1, 1] + corners[i, 2, 1]) / 3
            size = np.sqrt((corners[i, 0, 0] - cx) ** 2 + (corners[i, 0, 1] - cy) ** 2)
            fits = sample_patch(flat, height, width, cx, cy, 0.2 * size, ink)
            for k in range(3):
                fits = fits and _edge_line(
                    flat, height, width, corners, i, k, cx, cy, ink, share, beyond, lines
                )
            if not (fits and _meeting(lines, corners, i, MAX_CORNER_SHIFT * size, moved)):
                good[i] = False
                break
            for k in range(3):
                corners[i, k, 0], corners[i, k, 1] = moved[k, 0], moved[k, 1]
            passes += 1
            if passes == 3 or share * size < 2 * FINE_REACH_PX:
                break
            share = max(0.25 * share, 2 * FINE_REACH_PX / size)


@compiled
def _meeting(lines, corners, i, limit, moved):  # type: ignore[no-untyped-def]
    """Write where the lines of edges meet, corner by corner; False where one does not or lies beyond the limit."""
    for k in range(3):
        j = (k + 2) % 3
        sine = lines[j, 0] * lines[k, 1] - lines[j, 1] * lines[k, 0]
        if not abs(sine) >= MIN_SINE:
            return False
        moved[k, 0] = (lines[j, 2] * lines[k, 1] - lines[j, 1] * lines[k, 2]) / sine
        moved[k, 1] = (lines[j, 0] * lines[k, 2] - lines[j, 2] * lines[k, 0]) / sine
        dx, dy = moved[k, 0] - corners[i, k, 0], moved[k, 1] - corners[i, k, 1]
        if not dx * dx + dy * dy < limit * limit:
            return False
    return True


def rough_triangles(seeds: Seeds, scale: int) -> Triangles:
    """The domains that are triangles by shape, by their moments alone: without growing, without sub-pixel edges."""
    moments = domain_moments(seeds.runs, seeds.domain, seeds.xy)
    corners, good = _fit(moments, seeds.xy, seeds.area_px, MIN_AREA_PX, ROUGH_TRIANGULARITY)
    corners = (corners + 0.5) * scale - 0.5
    return Triangles(corners[good], seeds.ink[good], np.flatnonzero(good).astype(np.int32))


def fit_triangles(image: NDArray[np.uint8], regions: Regions, scale: int = 1) -> Triangles:
    """Stage 5: keep the regions that are triangles by shape and size, and place their edges with sub-pixel accuracy.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        regions: grown at 1/``scale`` of the image's scale.
        scale: full-scale pixels per pixel of the regions.
    """
    corners, good = _fit(regions.moments, regions.seed, regions.domain_px, MIN_AREA_PX, MIN_TRIANGULARITY)
    corners = (corners + 0.5) * scale - 0.5
    fit_edges(image, corners, good)
    return Triangles(
        corner_px=corners[good], ink=regions.ink[good], region=np.flatnonzero(good).astype(np.int32)
    )
