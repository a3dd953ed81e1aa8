"""The gridlines between the current markers: cubic curves of the smooth map that the markers define.

Gridlines are straight in the layout; the map to the image curves them. The map's derivative at every marker is
estimated from the two rings of neighbours, and gives the direction of each gridline at that marker. The gridline is the
cubic between two markers with these directions, as a C1-smooth interpolation of the map (Clough-Tocher) has it.
"""

from __future__ import annotations

import numpy as np

from extractor.localmap.regularised_maps import fill_quadratic_derivatives
from extractor.numeric.compilation import compiled, inlined, vectorized

# columns of a gridline: start, unit vector and length of the chord (px), slopes against the chord at both ends, known
X, Y, UX, UY, LENGTH, LEAVE, ARRIVE, KNOWN = range(8)
FIRST_RING = 6
MAX_SLOPE = 0.5  # of a gridline against its chord; a larger slope is an error of the map


@compiled
def local_maps(xy, near, offset, stencil):  # type: ignore[no-untyped-def]
    """The local map at each marker.

    Where both rings are complete, the first derivatives are those of a cubic, and the second are 0, as they are not
    used. Elsewhere they are those of a quadratic, whose second derivatives are regularised towards 0 and are 0 where
    fewer than five neighbours are known.

    Args:
        xy: (M, 2) px, NaN where unknown.
        near, offset, stencil: ``Topology.near``, ``ring_vectors`` and ``derivative_stencil``.

    Returns:
        (M, 2, 5): derivatives of x and y by the layout's x, y, xx / 2, xy, yy / 2; NaN where unknown.
    """
    return local_maps_at(xy, np.isfinite(xy[:, 0]), near, offset, stencil)


@compiled
def local_maps_at(xy, which, near, offset, stencil):  # type: ignore[no-untyped-def]
    """The same at some of the known markers, ``which`` (M,) bool, only."""
    out = np.full((xy.shape[0], 2, 5), np.nan)
    incomplete, count = np.empty(xy.shape[0], np.int64), 0
    for m in range(xy.shape[0]):
        if not which[m]:
            continue
        # the stencil has weights where both rings are complete
        complete = stencil[m, 0, 0] != 0.0 or stencil[m, 0, 1] != 0.0
        xu, xv, yu, yv = (
            _cubic_derivatives(xy, m, near, stencil) if complete else (np.nan, np.nan, np.nan, np.nan)
        )
        if np.isfinite(xu):
            out[m, 0, 0], out[m, 0, 1], out[m, 1, 0], out[m, 1, 1] = xu, xv, yu, yv
            for k in range(2, 5):
                out[m, 0, k], out[m, 1, k] = 0.0, 0.0
        else:
            incomplete[count] = m
            count += 1
    fill_quadratic_derivatives(xy, incomplete[:count], near, offset, out)
    return out


@vectorized
def _cubic_derivatives(xy, m, near, stencil):  # type: ignore[no-untyped-def]
    """The first derivatives of x and y at marker m; NaN where a neighbour is unknown."""
    xu, xv, yu, yv = 0.0, 0.0, 0.0, 0.0
    x, y = xy[m, 0], xy[m, 1]
    for k in range(near.shape[1]):
        n = np.uint64(near[m, k])
        dx, dy, u, v = xy[n, 0] - x, xy[n, 1] - y, stencil[m, 0, k], stencil[m, 1, k]
        xu += u * dx
        xv += v * dx
        yu += u * dy
        yv += v * dy
    return xu, xv, yu, yv


@compiled
def extrapolate_markers(xy, maps, near, offset):  # type: ignore[no-untyped-def]
    """Unknown markers beside known ones predicted by their neighbours' maps.

    Returns:
        (M, 2) px, ``xy`` with the predictions; (M,) bool, the predicted markers.
    """
    out = xy.copy()
    predicted = np.zeros(xy.shape[0], np.bool_)
    for m in range(xy.shape[0]):
        if np.isfinite(xy[m, 0]):
            continue
        x, y, count = 0.0, 0.0, 0
        for k in range(FIRST_RING):
            n = near[m, k]
            if n < 0 or not np.isfinite(maps[n, 0, 0]):
                continue
            u, v = -offset[m, k, 0], -offset[m, k, 1]
            x += xy[n, 0] + u * maps[n, 0, 0] + v * maps[n, 0, 1]
            x += 0.5 * u * u * maps[n, 0, 2] + u * v * maps[n, 0, 3] + 0.5 * v * v * maps[n, 0, 4]
            y += xy[n, 1] + u * maps[n, 1, 0] + v * maps[n, 1, 1]
            y += 0.5 * u * u * maps[n, 1, 2] + u * v * maps[n, 1, 3] + 0.5 * v * v * maps[n, 1, 4]
            count += 1
        if count > 0:
            out[m, 0], out[m, 1] = x / count, y / count
            predicted[m] = True
    return out, predicted


@compiled
def extrapolate_rings(xy, near, offset, stencil, rings):  # type: ignore[no-untyped-def]
    """(M, 2) px: ``xy`` with ring after ring of unknown markers around the known ones predicted, ``rings`` times.

    The predictions are those of ``extrapolate_markers``, with maps only at the known markers beside unknown ones.
    """
    for _ in range(rings):
        needed = np.zeros(xy.shape[0], np.bool_)
        for m in np.flatnonzero(~np.isfinite(xy[:, 0])):
            for k in range(FIRST_RING):
                n = near[m, k]
                if n >= 0 and np.isfinite(xy[n, 0]):
                    needed[n] = True
        if not np.any(needed):
            break
        xy = extrapolate_markers(xy, local_maps_at(xy, needed, near, offset, stencil), near, offset)[0]
    return xy


@compiled
def gridlines(xy, maps, bend, edges, along):  # type: ignore[no-untyped-def]
    """The gridlines between markers.

    Args:
        xy: (M, 2) px, the markers. maps: (M, 2, 5), as ``local_maps`` gives them.
        bend: (E, 2) px, b and s of ``gridline_bending``, which add to the slopes.
        edges: (E, 2) marker ids. along: (E, 2) ``Topology.edge_vectors``.

    Returns:
        (E, 8): start and unit vector of the chord, its length, px; slopes against the chord at both ends, towards
        (-uy, ux); 1 where known. All 0 where unknown.
    """
    out = np.zeros((edges.shape[0], 8))
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        dx, dy = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
        length = np.sqrt(dx * dx + dy * dy)
        if not length > 1.0:
            continue
        ux, uy = dx / length, dy / length
        leave, arrive = _slope(maps, a, along, e, ux, uy), _slope(maps, b, along, e, ux, uy)
        # where one end's direction is unknown the gridline is a parabola, where both are, straight
        if not np.isfinite(arrive):
            arrive = -leave
        if not np.isfinite(leave):
            leave = -arrive
        if not np.isfinite(leave):
            leave, arrive = 0.0, 0.0
        out[e, X], out[e, Y], out[e, UX], out[e, UY], out[e, LENGTH] = xy[a, 0], xy[a, 1], ux, uy, length
        out[e, LEAVE] = leave + (bend[e, 1] + bend[e, 0]) / length
        out[e, ARRIVE] = arrive + (bend[e, 1] - bend[e, 0]) / length
        out[e, KNOWN] = 1.0
    return out


@inlined
def _slope(maps, m, along, e, ux, uy):  # type: ignore[no-untyped-def]
    """The slope of gridline e against its chord (ux, uy) at marker m; NaN where the map is unknown or wrong."""
    tx = maps[m, 0, 0] * along[e, 0] + maps[m, 0, 1] * along[e, 1]
    ty = maps[m, 1, 0] * along[e, 0] + maps[m, 1, 1] * along[e, 1]
    forward = tx * ux + ty * uy
    slope = (ty * ux - tx * uy) / forward
    if not (forward > 0.0 and abs(slope) < MAX_SLOPE):
        return np.nan
    return slope


@compiled
def sagitta(t, length, leave, arrive):  # type: ignore[no-untyped-def]
    """px, the offset of a gridline from its chord at the fraction t of the chord; straight beyond the ends."""
    if t <= 0.0:
        return length * leave * t
    if t >= 1.0:
        return length * arrive * (t - 1.0)
    return length * t * (1.0 - t) * (leave * (1.0 - t) - arrive * t)
