"""Lenses of scenes: OpenCV's perspective model with 5, 8 or 12 coefficients, and its fisheye model with 4."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Points = NDArray[np.float64]
LensKind = Literal["perspective", "fisheye"]

COUNTS: dict[str, tuple[int, ...]] = {"perspective": (5, 8, 12), "fisheye": (4,)}


def reach_of(kind: LensKind, coefficients: tuple[float, ...]) -> float:
    """The radius, in focal lengths before the lens, up to which the radius after the lens grows; inf: always."""
    if kind == "fisheye":
        angle = Polynomial(
            [0, 1, 0, coefficients[0], 0, coefficients[1], 0, coefficients[2], 0, coefficients[3]]
        )
        turn = _least_root(angle.deriv(), np.pi / 2)
        return float(np.tan(turn)) if turn < np.pi / 2 else np.inf
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0)[:8]
    above, below = Polynomial([0, 1, 0, k1, 0, k2, 0, k3]), Polynomial([1, 0, k4, 0, k5, 0, k6])
    turning = above.deriv() * below - above * below.deriv()
    return min(_least_root(turning, np.inf), _least_root(below, np.inf))


def _least_root(polynomial: Polynomial, otherwise: float) -> float:
    """The least positive root; solved in the inverse of the variable, so that weak coefficients do not overflow."""
    inverse = np.roots(polynomial.coef)
    real = inverse.real[np.abs(inverse.imag) <= 1e-9 * np.abs(inverse)]
    largest = float(real.max(initial=0.0))
    return min(1 / largest, otherwise) if largest > 1e-6 else otherwise


def distort(kind: LensKind, coefficients: tuple[float, ...], xy: Points) -> Points:
    """(N, 2) normalised coordinates after the lens, of coordinates (N, 2) before it."""
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    if kind == "fisheye":
        r = np.sqrt(r2)
        angle = np.arctan(r)
        bent = angle * Polynomial([1, *coefficients])(angle**2)
        return np.asarray(xy * np.divide(bent, r, out=np.ones_like(r), where=r > 0)[:, None])
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*coefficients, *(12 * (0.0,)))[:12]
    radial = Polynomial([1, k1, k2, k3])(r2) / Polynomial([1, k4, k5, k6])(r2)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + s2 * r2)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + s4 * r2)
    return np.stack([u, v], axis=-1)
