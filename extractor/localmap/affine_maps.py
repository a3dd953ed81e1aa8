"""How the layout lies in the image around every numbered cell: a local linear map, pixels per millimetre."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled, inlined_no_refcount

MIN_SPREAD = 0.2  # of the neighbours across against along, below which they are one line and tell nothing
MAX_MISFIT = 0.3  # of the way to a neighbour, between its center and where a cell's own triangle puts it
MIN_RIVAL_MISFIT = 0.8  # the same for the triangle turned by a third, which puts it 1.7 ways off


@compiled
def image_cell_of_layout_cell(cell, count):  # type: ignore[no-untyped-def]
    """(U,) int32, which cell of the image each of the layout's ``count`` cells is, or -1."""
    out = np.full(count, -1, np.int32)
    for i in range(cell.shape[0]):
        if cell[i] >= 0:
            out[cell[i]] = i
    return out


@compiled
def linear_maps(center_px, cell, seen, center_mm, beside):  # type: ignore[no-untyped-def]
    """(N, 2, 2) float64, image step (px) per layout step (mm) around each numbered cell, by least squares over its six
    neighbours; NaN where they lie on one line.

    The layout's own shape is in its millimetres, so a round pattern is no more curved than a honeycomb.
    """
    out = np.full((cell.shape[0], 2, 2), np.nan)
    for i in range(cell.shape[0]):
        if cell[i] >= 0:
            fill_linear_map(i, center_px, cell[i], seen, center_mm, beside, out[i])
    return out


@inlined_no_refcount
def fill_linear_map(i, center_px, u, seen, center_mm, beside, out):  # type: ignore[no-untyped-def]
    """Write that of cell i, the layout's u."""
    xx, xy, yy = 0.0, 0.0, 0.0
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    for k in range(6):
        v = beside[u, k]
        if v < 0 or seen[v] < 0:
            continue
        j = seen[v]
        x, y = center_mm[v, 0] - center_mm[u, 0], center_mm[v, 1] - center_mm[u, 1]
        px, py = center_px[j, 0] - center_px[i, 0], center_px[j, 1] - center_px[i, 1]
        xx += x * x
        xy += x * y
        yy += y * y
        ax += px * x
        ay += px * y
        bx += py * x
        by += py * y
    determinant = xx * yy - xy * xy
    if determinant > MIN_SPREAD * MIN_SPREAD * 0.25 * (xx + yy) ** 2:
        out[0, 0], out[0, 1] = (ax * yy - ay * xy) / determinant, (ay * xx - ax * xy) / determinant
        out[1, 0], out[1, 1] = (bx * yy - by * xy) / determinant, (by * xx - bx * xy) / determinant
    else:
        out[0, 0], out[0, 1], out[1, 0], out[1, 1] = np.nan, np.nan, np.nan, np.nan


@compiled
def _fill_map_from_triangle(arms, seen, middle, shift, step, out):  # type: ignore[no-untyped-def]
    """Write the linear map that carries a cell's corners 0 and 1 to those of a triangle, counted from ``shift``."""
    a, b = arms[0], arms[1]
    p, q = seen[shift] - middle, seen[(shift + step) % 3] - middle
    area = a[0] * b[1] - a[1] * b[0]
    out[:, 0] = (p * b[1] - q * a[1]) / area
    out[:, 1] = (q * a[0] - p * b[0]) / area


@compiled
def _fill_maps_from_triangles(center_px, corner_px, mirrored, cell, seen, plan, out):  # type: ignore[no-untyped-def]
    """Write the map of every numbered cell that has none, but a triangle, and a neighbour that tells its turn."""
    center_mm, _, _, arms_mm, beside = plan
    maps, misfit = np.empty((3, 2, 2)), np.empty(3)
    step = (
        1 if mirrored else 2
    )  # clockwise in the image a cell's corners run 0, 2, 1, seen from the back 0, 1, 2
    for i in range(cell.shape[0]):
        u = cell[i]
        if u < 0 or not np.isnan(out[i, 0, 0]) or np.isnan(corner_px[i, 0, 0]):
            continue
        for shift in range(3):
            _fill_map_from_triangle(arms_mm[u], corner_px[i], center_px[i], shift, step, maps[shift])
        misfit[:] = 0.0
        for k in range(6):
            v = beside[u, k]
            if v < 0 or seen[v] < 0:
                continue
            x, y = center_mm[v, 0] - center_mm[u, 0], center_mm[v, 1] - center_mm[u, 1]
            px, py = center_px[seen[v], 0] - center_px[i, 0], center_px[seen[v], 1] - center_px[i, 1]
            for shift in range(3):
                m = maps[shift]
                apart = np.hypot(px - m[0, 0] * x - m[0, 1] * y, py - m[1, 0] * x - m[1, 1] * y)
                misfit[shift] = max(misfit[shift], apart / np.hypot(px, py))
        best = misfit.argmin()
        # without a neighbour all are 0
        if misfit[best] < MAX_MISFIT and min(misfit[best - 1], misfit[best - 2]) > MIN_RIVAL_MISFIT:
            out[i] = maps[best]


@compiled
def completed_linear_maps(center_px, corner_px, cell, mirrored, plan):  # type: ignore[no-untyped-def]
    """``linear_maps``, and where a cell's neighbours are too few for it, in the rims of holes, what its own triangle
    says
    if one of them tells which of its corners is which."""
    center_mm, _, _, arms_mm, beside = plan
    seen = image_cell_of_layout_cell(cell, arms_mm.shape[0])
    out = linear_maps(center_px, cell, seen, center_mm, beside)
    _fill_maps_from_triangles(center_px, corner_px, mirrored, cell, seen, plan, out)
    return out
