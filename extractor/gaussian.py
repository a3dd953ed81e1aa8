"""Tables of the normal distribution, and how much of a blurred half plane or wedge a pixel sees.

Lengths are in units of the blur. By the divergence theorem the share of a wedge with the opening angle a is

    a / 2 pi + G(d1, t1) + G(d2, t2),   G(d, t) = integral from -t to infinity of d (1 - exp(-r^2 / 2)) / (2 pi r^2) du,

r^2 = d^2 + u^2, with d the distance to each side (positive inside) and t the pixel's place along it from the corner.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .engine import compiled

REACH = 3.3  # a side farther away than this is not seen
STEPS = 64  # of the tables of one variable, to a unit
WEDGE_STEPS = 8
WEDGE_REACH = (
    14.0  # along a side; where both sides of a wedge of 29 degrees or more are in reach, less is needed
)


def _normal_tables() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    from scipy.special import ndtr

    z = np.arange(-4 * STEPS, 4 * STEPS + 2) / STEPS
    return ndtr(z), np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)


def _wedge_table() -> NDArray[np.float64]:
    """G over d = 0 .. 4 and t = -14 .. 14: Owen's T knows the integral."""
    from scipy.special import ndtr, owens_t

    d = np.arange(0, 4 * WEDGE_STEPS + 2)[:, None] / WEDGE_STEPS
    t = np.arange(-WEDGE_REACH * WEDGE_STEPS, WEDGE_REACH * WEDGE_STEPS + 2)[None, :] / WEDGE_STEPS
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(d > 0, t / d, 0.0)
    inner = np.arctan(ratio) / (2 * np.pi) - owens_t(d, ratio)
    whole = 0.5 * (ndtr(d) - 0.5)
    return np.where(d > 0, whole + inner, 0.0)


NORMAL, DENSITY = _normal_tables()
WEDGE = _wedge_table()


@compiled
def normal(z):  # type: ignore[no-untyped-def]
    """The normal distribution, linearly from its table (error below 1e-5)."""
    if z <= -4.0:
        return 0.0
    if z >= 4.0:
        return 1.0
    at = (z + 4.0) * STEPS
    k = np.uint64(at)
    return NORMAL[k] + (at - k) * (NORMAL[k + np.uint64(1)] - NORMAL[k])


@compiled
def density(z):  # type: ignore[no-untyped-def]
    """The normal density, linearly from its table."""
    if z <= -4.0 or z >= 4.0:
        return 0.0
    at = (z + 4.0) * STEPS
    k = np.uint64(at)
    return DENSITY[k] + (at - k) * (DENSITY[k + np.uint64(1)] - DENSITY[k])


@compiled
def side_of_wedge(d, t):  # type: ignore[no-untyped-def]
    """G(d, t) for |d| < 4, bilinearly from its table (error below 3e-4)."""
    sign = 1.0
    if d < 0.0:
        d, sign = -d, -1.0
    t = min(max(t, -WEDGE_REACH), WEDGE_REACH)
    row, column = d * WEDGE_STEPS, (t + WEDGE_REACH) * WEDGE_STEPS
    i, j = np.uint64(row), np.uint64(column)
    down, right = i + np.uint64(1), j + np.uint64(1)
    fi, fj = row - i, column - j
    upper = WEDGE[i, j] + fj * (WEDGE[i, right] - WEDGE[i, j])
    lower = WEDGE[down, j] + fj * (WEDGE[down, right] - WEDGE[down, j])
    return sign * (upper + fi * (lower - upper))
