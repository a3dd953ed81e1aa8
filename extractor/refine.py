"""Sub-pixel markers: all edges of the numbered cells are measured once more and solved together.

Every colored edge says where the line between its two markers runs, and every inner marker ends six of them. One
sparse least squares over all of them uses the neighbours' edges for each marker, which is worth more than the mean
of three corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erf

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .placing import Places
from .sampling import clamp, sample_dot, sample_patch

SAMPLES = 7  # at most, on each side of it
REACH_SIGMA = 2.5  # how far a profile reaches, in units of the blur
CLEAR_SIGMA = 2.8  # how far the other gridline of a corner must be for it not to show, in units of the blur
MAX_REACH = 0.33  # of the cell's height, how far a profile may reach at most
MIN_CONTRAST = 12.0
LEVEL_REACH = 0.15  # of the cell's height, how far around its middle the ink is averaged
MAX_STEPS = 60  # of the conjugate gradient
ROUNDS = (4, 24)  # stations along an edge at most, in each round
MIN_NOISE = 0.3  # grey levels; rounding alone makes 0.29
MAX_SHIFT = 0.25  # in units of the edges around the marker


@dataclass(frozen=True, eq=False)
class Refined:
    """Markers after refinement.

    Attributes:
        xy_px: (M, 2) float64, NaN where nothing was measured.
        cov_px2: (M, 2, 2) float64, NaN where nothing was measured.
        blur_px: the blur found in the image, pixel included (sigma).
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    blur_px: float


@compiled
def _levels(image, xy, cells):  # type: ignore[no-untyped-def]
    """(3 C, 5) per edge: what turns a color into its share of the ink, 1 in the cell and 0 beyond the edge.

    Columns: three channel weights, the offset to subtract, and the squared contrast; 0 where nothing can be measured.
    Ink and black are taken from the middle of the cell and of the cell beyond.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    ink, beyond = np.zeros(3), np.zeros(3)
    out = np.zeros((cells.shape[0] * 3, 5))
    for i in range(cells.shape[0]):
        a, b, c = xy[cells[i, 0]], xy[cells[i, 1]], xy[cells[i, 2]]
        cx, cy = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3
        area = abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        longest = max(np.hypot(b[0] - a[0], b[1] - a[1]), np.hypot(c[0] - a[0], c[1] - a[1]))
        longest = max(longest, np.hypot(c[0] - b[0], c[1] - b[1]))
        radius = LEVEL_REACH * area / max(longest, 1e-9)
        if area < 2.0 or not sample_patch(flat, height, width, cx, cy, radius, ink):
            continue
        for k in range(3):
            a, b = xy[cells[i, k]], xy[cells[i, (k + 1) % 3]]
            if not sample_patch(flat, height, width, a[0] + b[0] - cx, a[1] + b[1] - cy, radius, beyond):
                continue
            contrast = (ink[0] - beyond[0]) ** 2 + (ink[1] - beyond[1]) ** 2 + (ink[2] - beyond[2]) ** 2
            if contrast < MIN_CONTRAST**2:
                continue
            e = 3 * i + k
            for channel in range(3):
                out[e, channel] = (ink[channel] - beyond[channel]) / contrast
                out[e, 3] += out[e, channel] * beyond[channel]
            out[e, 4] = contrast
    return out


@compiled
def _outward(a, b, c):  # type: ignore[no-untyped-def]
    """Length of the edge a-b, its unit normal away from c, and the height of c over it."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = np.hypot(dx, dy)
    nx, ny = dy / length, -dx / length
    depth = (c[0] - a[0]) * nx + (c[1] - a[1]) * ny
    if depth > 0.0:
        return length, -nx, -ny, depth
    return length, nx, ny, -depth


@compiled
def _sine(a, b, c):  # type: ignore[no-untyped-def]
    """Sine of the angle at a between b and c, 1 where it is obtuse."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    if ux * vx + uy * vy <= 0.0:
        return 1.0
    return max(abs(ux * vy - uy * vx) / (np.hypot(ux, uy) * np.hypot(vx, vy)), 0.05)


@compiled
def _edge_blurs(image, xy, cells, levels, every):  # type: ignore[no-untyped-def]
    """The blur seen across the middle of every n-th edge: the integral of f (1 - f) is sigma / sqrt(pi)."""
    out = np.full(cells.shape[0] * 3 // every + 1, np.nan)
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    for e in range(0, cells.shape[0] * 3, every):
        if levels[e, 4] == 0.0:
            continue
        i, k = e // 3, e % 3
        a, b, c = xy[cells[i, k]], xy[cells[i, (k + 1) % 3]], xy[cells[i, (k + 2) % 3]]
        u0, u1, u2, zero = levels[e, :4]
        _, nx, ny, depth = _outward(a, b, c)
        reach = MAX_REACH * depth
        step = reach / 8
        total = 0.0
        for t in range(3):
            w = 0.4 + 0.1 * t
            x, y = a[0] + w * (b[0] - a[0]), a[1] + w * (b[1] - a[1])
            for m in range(-8, 9):
                f = sample_dot(flat, height, width, x + m * step * nx, y + m * step * ny, u0, u1, u2) - zero
                total += f * (1.0 - f) * step / 3.0
        out[e // every] = total * np.sqrt(np.pi)
    return out


@compiled
def _measure(image, xy, cells, levels, sigma, noise, most):  # type: ignore[no-untyped-def]
    """Per edge: its normal, and the sums of the weighted offsets of its stations.

    At each station the matched filter of a blurred step tells how far the edge lies from where it is thought to be.
    Columns: nx, ny, A00, A01, A11, B0, B1 with A the sums of weight * (1-t, t) (1-t, t)' and B of weight * (1-t, t) *
    offset; the weight is the Fisher information A^2 / (2 sqrt(pi) s noise^2) of the station's length.
    """
    rows = np.zeros((cells.shape[0] * 3, 7))
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    kernel, step_profile = np.zeros(2 * SAMPLES + 1), np.zeros(2 * SAMPLES + 1)
    for e in range(cells.shape[0] * 3):
        if levels[e, 4] == 0.0:
            continue
        i, k = e // 3, e % 3
        a, b, c = xy[cells[i, k]], xy[cells[i, (k + 1) % 3]], xy[cells[i, (k + 2) % 3]]
        u0, u1, u2, zero, contrast = levels[e]
        length, nx, ny, depth = _outward(a, b, c)
        rows[e, 0], rows[e, 1] = nx, ny
        # the sharper a corner, the longer the edge runs close to its neighbour
        start = min(max(CLEAR_SIGMA * sigma / (length * _sine(a, b, c)), 0.15), 0.4)
        end = 1.0 - min(max(CLEAR_SIGMA * sigma / (length * _sine(b, a, c)), 0.15), 0.4)
        stations = min(max(int(length * (end - start)), 3), most)
        reach = min(REACH_SIGMA * sigma, MAX_REACH * depth)
        samples = min(max(int(np.ceil(reach)), 2), SAMPLES)
        step = reach / samples
        norm = 0.0
        for m in range(-samples, samples + 1):
            z = m * step / sigma
            kernel[m + samples] = np.exp(-0.5 * z * z) / (np.sqrt(2 * np.pi) * sigma)
            step_profile[m + samples] = 0.5 * (1.0 - erf(z / np.sqrt(2.0)))
            norm += kernel[m + samples] ** 2
        information = (
            contrast / (2 * np.sqrt(np.pi) * sigma * noise * noise) * length * (end - start) / stations
        )
        for j in range(stations):
            t = start + (end - start) * (j + 0.5) / stations
            x, y = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
            product = 0.0
            for m in range(-samples, samples + 1):
                f = sample_dot(flat, height, width, x + m * step * nx, y + m * step * ny, u0, u1, u2) - zero
                product += kernel[m + samples] * (clamp(f, -0.3, 1.3) - step_profile[m + samples])
            offset = product / norm
            if not abs(offset) < max(1.0, 0.15 * length):
                continue
            rows[e, 2] += information * (1 - t) * (1 - t)
            rows[e, 3] += information * (1 - t) * t
            rows[e, 4] += information * t * t
            rows[e, 5] += information * (1 - t) * offset
            rows[e, 6] += information * t * offset
    return rows


@compiled
def _multiply(rows, ends, vector, ridge, out):  # type: ignore[no-untyped-def]
    """out = (information matrix + ridge) vector."""
    for m in range(vector.shape[0]):
        out[m, 0] = ridge[m] * vector[m, 0]
        out[m, 1] = ridge[m] * vector[m, 1]
    for e in range(rows.shape[0]):
        if rows[e, 2] == 0.0:
            continue
        nx, ny, a, b = rows[e, 0], rows[e, 1], ends[e, 0], ends[e, 1]
        at_a = nx * vector[a, 0] + ny * vector[a, 1]
        at_b = nx * vector[b, 0] + ny * vector[b, 1]
        to_a = rows[e, 2] * at_a + rows[e, 3] * at_b
        to_b = rows[e, 3] * at_a + rows[e, 4] * at_b
        out[a, 0] += nx * to_a
        out[a, 1] += ny * to_a
        out[b, 0] += nx * to_b
        out[b, 1] += ny * to_b


@compiled
def _blocks(rows, ends, count):  # type: ignore[no-untyped-def]
    """(M, 3): xx, xy, yy of the diagonal blocks of the information matrix."""
    block = np.zeros((count, 3))
    for e in range(rows.shape[0]):
        nx, ny = rows[e, 0], rows[e, 1]
        for side in range(2):
            m = ends[e, side]
            weight = rows[e, 2 + 2 * side]
            block[m, 0] += weight * nx * nx
            block[m, 1] += weight * nx * ny
            block[m, 2] += weight * ny * ny
    return block


@compiled
def _solve(rows, ends, count, block):  # type: ignore[no-untyped-def]
    """The shifts (M, 2) that fit all edges, by conjugate gradients preconditioned with the diagonal blocks."""
    ridge = np.empty(count)
    inverse = np.zeros((count, 3))
    residual = np.zeros((count, 2))
    for m in range(count):
        ridge[m] = 1e-6 * (block[m, 0] + block[m, 2]) + 1e-12
        xx, xy, yy = block[m, 0] + ridge[m], block[m, 1], block[m, 2] + ridge[m]
        determinant = xx * yy - xy * xy
        inverse[m, 0], inverse[m, 1], inverse[m, 2] = yy / determinant, -xy / determinant, xx / determinant
    for e in range(rows.shape[0]):
        for side in range(2):
            m = ends[e, side]
            residual[m, 0] += rows[e, 0] * rows[e, 5 + side]
            residual[m, 1] += rows[e, 1] * rows[e, 5 + side]
    shift = np.zeros((count, 2))
    search = np.zeros((count, 2))
    product = np.zeros((count, 2))
    descent = np.empty((count, 2))
    before, start = 1.0, 0.0
    for step in range(MAX_STEPS):
        now = 0.0
        for m in range(count):
            descent[m, 0] = inverse[m, 0] * residual[m, 0] + inverse[m, 1] * residual[m, 1]
            descent[m, 1] = inverse[m, 1] * residual[m, 0] + inverse[m, 2] * residual[m, 1]
            now += residual[m, 0] * descent[m, 0] + residual[m, 1] * descent[m, 1]
        if step == 0:
            start = now
        if not now > 1e-8 * start:
            break
        blend = now / before if step > 0 else 0.0
        search = descent + blend * search
        _multiply(rows, ends, search, ridge, product)
        length = now / (search * product).sum()
        shift += length * search
        residual -= length * product
        before = now
    return shift


@compiled
def _covariances(rows, ends, block):  # type: ignore[no-untyped-def]
    """(M, 2, 2): the inverse of each marker's block once its neighbours are solved for (Schur complement)."""
    count = block.shape[0]
    reduced = block.copy()
    for e in range(rows.shape[0]):
        nx, ny = rows[e, 0], rows[e, 1]
        for side in range(2):
            m, other = ends[e, side], ends[e, 1 - side]
            xx, xy, yy = block[other, 0], block[other, 1], block[other, 2]
            determinant = xx * yy - xy * xy
            if determinant <= 1e-12 * (xx + yy) ** 2:
                continue
            stiffness = (yy * nx * nx - 2 * xy * nx * ny + xx * ny * ny) / determinant
            loss = rows[e, 3] * rows[e, 3] * stiffness
            reduced[m, 0] -= loss * nx * nx
            reduced[m, 1] -= loss * nx * ny
            reduced[m, 2] -= loss * ny * ny
    out = np.full((count, 2, 2), np.nan)
    for m in range(count):
        xx, xy, yy = reduced[m, 0], reduced[m, 1], reduced[m, 2]
        determinant = xx * yy - xy * xy
        if determinant > 1e-9 * (xx + yy) ** 2:
            out[m, 0, 0] = yy / determinant
            out[m, 0, 1] = -xy / determinant
            out[m, 1, 0] = -xy / determinant
            out[m, 1, 1] = xx / determinant
    return out


def refine(image: NDArray[np.uint8], places: Places, noise: float) -> Refined:
    """Solve all markers together from the edges of the numbered colored cells.

    Args:
        image: (H, W, 3) uint8 BGR.
        places: where the markers were found, to about a pixel.
        noise: standard deviation of a channel, in grey levels.

    A marker that its edges would move by more than ``MAX_SHIFT`` of an edge is lost.
    """
    cells, xy = places.cells, places.xy_px
    levels = _levels(image, xy, cells)
    blurs = _edge_blurs(image, xy, cells, levels, max(1, 3 * len(cells) // 200))
    sigma = max(float(np.nanmedian(blurs)) if np.isfinite(blurs).any() else 1.0, 0.4)
    ends = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    rows = np.zeros((len(ends), 7))
    block = np.zeros((len(xy), 3))
    for stations in ROUNDS:
        rows = _measure(image, xy, cells, levels, sigma, max(noise, MIN_NOISE), stations)
        block = _blocks(rows, ends, len(xy))
        xy = xy + _solve(rows, ends, len(xy), block)
    cov = _covariances(rows, ends, block)
    with np.errstate(invalid="ignore"):
        astray = ~(np.linalg.norm(xy - places.xy_px, axis=1) < MAX_SHIFT * places.edge_px)
    lost = astray | np.isnan(cov[:, 0, 0])
    xy[lost] = np.nan
    cov[lost] = np.nan
    return Refined(xy_px=xy, cov_px2=cov, blur_px=sigma)
