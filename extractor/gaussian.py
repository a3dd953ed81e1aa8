"""The normal distribution, and how much of a blurred half plane or wedge a pixel sees.

Lengths are in units of the blur. By the divergence theorem the share of a wedge with the opening angle a is

    a / 2 pi + G(d1, t1) + G(d2, t2),   G(d, t) = integral from -t to infinity of d (1 - exp(-r^2 / 2)) / (2 pi r^2) du,

r^2 = d^2 + u^2, with d the distance to each side (positive inside) and t the pixel's place along it from the corner.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .engine import lent

REACH = 3.3  # a side farther away than this is not seen
WEDGE_STEPS = 8
WEDGE_REACH = (
    14.0  # along a side; where both sides of a wedge of 29 degrees or more are in reach, less is needed
)


def _normal_terms() -> tuple[np.float32, ...]:
    """The normal distribution less a half over z, by z^2, as a polynomial good to 3e-6 as far as ``REACH``."""
    from scipy.special import ndtr

    z = REACH * np.sin(np.linspace(1e-3, np.pi / 2, 3000))
    square = 2 * (z / REACH) ** 2 - 1
    terms = np.polynomial.chebyshev.chebvander(square, 7) * z[:, None]
    fit = np.polynomial.Chebyshev(np.linalg.lstsq(terms, ndtr(z) - 0.5, rcond=None)[0], domain=[0, REACH**2])
    return tuple(np.float32(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


def _wedge_table() -> NDArray[np.float32]:
    """G over d = 0 .. 4 and t = -14 .. 14: Owen's T knows the integral."""
    from scipy.special import ndtr, owens_t

    d = np.arange(0, 4 * WEDGE_STEPS + 2)[:, None] / WEDGE_STEPS
    t = np.arange(-WEDGE_REACH * WEDGE_STEPS, WEDGE_REACH * WEDGE_STEPS + 2)[None, :] / WEDGE_STEPS
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(d > 0, t / d, 0.0)
    inner = np.arctan(ratio) / (2 * np.pi) - owens_t(d, ratio)
    whole = 0.5 * (ndtr(d) - 0.5)
    return np.where(d > 0, whole + inner, 0.0).astype(np.float32)


N0, N1, N2, N3, N4, N5, N6, N7 = _normal_terms()
HALF = np.float32(0.5)
WEDGE = _wedge_table()


@lent
def normal(z):  # type: ignore[no-untyped-def]
    """The normal distribution of a float32 as far as ``REACH`` to both sides."""
    zz = z * z
    return HALF + z * (N0 + zz * (N1 + zz * (N2 + zz * (N3 + zz * (N4 + zz * (N5 + zz * (N6 + zz * N7)))))))


@lent
def side_of_wedge(d, t):  # type: ignore[no-untyped-def]
    """G(d, t) of float32 for |d| < 4, bilinearly from its table (error below 3e-4)."""
    steps, reach = np.float32(WEDGE_STEPS), np.float32(WEDGE_REACH)
    row, column = abs(d) * steps, (min(max(t, -reach), reach) + reach) * steps
    i, j = np.uint64(row), np.uint64(column)
    down, right = i + np.uint64(1), j + np.uint64(1)
    fi, fj = row - np.float32(i), column - np.float32(j)
    upper = WEDGE[i, j] + fj * (WEDGE[i, right] - WEDGE[i, j])
    lower = WEDGE[down, j] + fj * (WEDGE[down, right] - WEDGE[down, j])
    share = upper + fi * (lower - upper)
    return -share if d < np.float32(0.0) else share
