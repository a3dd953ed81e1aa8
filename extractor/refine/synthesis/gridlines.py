"""The gridlines between the current markers: cubic curves through the smooth map that the markers define.

Gridlines are straight in the layout and curved by the map to the image. At every marker the map's derivative is
estimated from the two rings of neighbours; it gives the direction in which each gridline leaves. A cubic between the
two markers with these directions is what a C1-smooth interpolation of the map (Clough-Tocher) draws.
"""

from __future__ import annotations

import numpy as np

from extractor.localmap.regularised_maps import fill_quadratic_derivatives
from extractor.numeric.compilation import compiled, inlined, vectorized

# columns of a gridline
X, Y, UX, UY, LENGTH, LEAVE, ARRIVE, KNOWN = range(8)
FIRST_RING = 6
MAX_SLOPE = 0.5  # of a gridline against its chord; more is an error somewhere


@compiled
def local_maps(xy, near, offset, stencil):  # type: ignore[no-untyped-def]
    """(M, 2, 5): derivatives of x and y by the layout's x, y, xx / 2, xy, yy / 2 at each marker; NaN where unknown.

    Where both rings are whole, the first derivatives are those of a cubic (and the second 0: nothing asks for them);
    elsewhere of a quadratic, bending held towards 0, and without bending where fewer than five neighbours are known.
    """
    return local_maps_at(xy, np.isfinite(xy[:, 0]), near, offset, stencil)


@compiled
def local_maps_at(xy, which, near, offset, stencil):  # type: ignore[no-untyped-def]
    """The same at ``gridlines`` (M,) of the known markers only."""
    out = np.full((xy.shape[0], 2, 5), np.nan)
    broken, count = np.empty(xy.shape[0], np.int64), 0
    for m in range(xy.shape[0]):
        if not which[m]:
            continue
        # there are weights where both rings are whole
        whole = stencil[m, 0, 0] != 0.0 or stencil[m, 0, 1] != 0.0
        xu, xv, yu, yv = (
            _cubic_derivatives(xy, m, near, stencil) if whole else (np.nan, np.nan, np.nan, np.nan)
        )
        if np.isfinite(xu):
            out[m, 0, 0], out[m, 0, 1], out[m, 1, 0], out[m, 1, 1] = xu, xv, yu, yv
            for k in range(2, 5):
                out[m, 0, k], out[m, 1, k] = 0.0, 0.0
        else:
            broken[count] = m
            count += 1
    fill_quadratic_derivatives(xy, broken[:count], near, offset, out)
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
    """``xy`` with unknown markers beside known ones put where their neighbours' maps say; which ones, (M,) bool."""
    out = xy.copy()
    put = np.zeros(xy.shape[0], np.bool_)
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
            put[m] = True
    return out, put


@compiled
def extrapolate_rings(xy, near, offset, stencil, rings):  # type: ignore[no-untyped-def]
    """``xy`` with the unknown markers of so many rings around known ones put where ``extrapolate_markers`` puts
    them, by maps
    that are laid only beside them."""
    for _ in range(rings):
        asked = np.zeros(xy.shape[0], np.bool_)
        for m in np.flatnonzero(~np.isfinite(xy[:, 0])):
            for k in range(FIRST_RING):
                n = near[m, k]
                if n >= 0 and np.isfinite(xy[n, 0]):
                    asked[n] = True
        if not np.any(asked):
            break
        xy = extrapolate_markers(xy, local_maps_at(xy, asked, near, offset, stencil), near, offset)[0]
    return xy


@compiled
def gridlines(xy, maps, bend, edges, along):  # type: ignore[no-untyped-def]
    """(E, 8) per gridline: start, unit vector along its chord, length, slopes against the chord at both ends, known.

    Slopes count towards (-uy, ux), per unit of length along the chord. ``bend`` (E, 2) px is added to them: b and s of
    ``bending``.
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
    """Of gridline e by the map at marker m, NaN where that cannot be."""
    tx = maps[m, 0, 0] * along[e, 0] + maps[m, 0, 1] * along[e, 1]
    ty = maps[m, 1, 0] * along[e, 0] + maps[m, 1, 1] * along[e, 1]
    forward = tx * ux + ty * uy
    slope = (ty * ux - tx * uy) / forward
    if not (forward > 0.0 and abs(slope) < MAX_SLOPE):
        return np.nan
    return slope


@compiled
def sagitta(t, length, leave, arrive):  # type: ignore[no-untyped-def]
    """How far the gridline lies off its chord at the fraction t; straight on beyond its ends."""
    if t <= 0.0:
        return length * leave * t
    if t >= 1.0:
        return length * arrive * (t - 1.0)
    return length * t * (1.0 - t) * (leave * (1.0 - t) - arrive * t)
