"""Quadratic B-splines along one axis, and polynomials through the thickness that vanish at the support."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SUPPORT = 3  # knot spans of a quadratic B-spline
GAUSS_POINTS = 6  # in a knot span


def spline_values(offset: Array) -> tuple[Array, Array]:
    """A quadratic B-spline on the knots 0, 1, 2, 3 and its derivative, at offsets from its first knot in spans."""
    t = np.asarray(offset, np.float64)
    first, middle, last = (t >= 0) & (t < 1), (t >= 1) & (t < 2), (t >= 2) & (t < 3)
    value = 0.5 * first * t**2 + middle * (0.75 - (t - 1.5) ** 2) + 0.5 * last * (3 - t) ** 2
    slope = first * t - middle * 2 * (t - 1.5) - last * (3 - t)
    return value, slope


@dataclass(frozen=True)
class SplineAxis:
    """``count`` splines of knot span ``step_mm``; the first one begins at ``start_mm``."""

    start_mm: float
    step_mm: float
    count: int

    def at(self, places_mm: Array) -> tuple[Array, Array]:
        """Values and derivatives (1/mm), (N, count)."""
        offset = (np.asarray(places_mm)[:, None] - self.start_mm) / self.step_mm - np.arange(self.count)
        value, slope = spline_values(offset)
        return value, slope / self.step_mm

    def quadrature(self) -> tuple[Array, Array]:
        """Places (S, G) mm and weights (S, G) mm of all knot spans that the splines cover."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        spans = np.arange(self.count + SUPPORT - 1)
        places = self.start_mm + self.step_mm * (spans[:, None] + 0.5 * (nodes + 1))
        return places, np.broadcast_to(0.5 * self.step_mm * weights, places.shape)


def axis_over(low_mm: float, high_mm: float, step_mm: float) -> SplineAxis:
    """The splines that do not vanish between two places."""
    spans = int(np.ceil((high_mm - low_mm) / step_mm))
    start = 0.5 * (low_mm + high_mm) - step_mm * (spans / 2 + SUPPORT - 1)
    return SplineAxis(start, step_mm, spans + SUPPORT - 1)


@dataclass(frozen=True)
class ThicknessBasis:
    """s P_k(2 s - 1) for k < ``count``, with s = 0 at the support and 1 at the touched face, P_k of Legendre."""

    thickness_mm: float
    count: int

    def at(self, depths_mm: Array) -> tuple[Array, Array]:
        """Values and derivatives along z (1/mm), (N, count), at depths below the touched face."""
        s = 1 - np.atleast_1d(np.asarray(depths_mm, np.float64)) / self.thickness_mm
        value, slope = np.empty((len(s), self.count)), np.empty((len(s), self.count))
        for k in range(self.count):
            legendre = np.polynomial.legendre.Legendre.basis(k)
            value[:, k] = s * legendre(2 * s - 1)
            slope[:, k] = legendre(2 * s - 1) + 2 * s * legendre.deriv()(2 * s - 1)
        return value, slope / self.thickness_mm

    def products(self) -> dict[str, Array]:
        """The integrals of products through the thickness: "00", "0z", "z0", "zz", (count, count) each."""
        nodes, weights = np.polynomial.legendre.leggauss(self.count + 2)
        value, slope = self.at(0.5 * self.thickness_mm * (1 - nodes))
        scaled = 0.5 * self.thickness_mm * weights[:, None]
        return {
            "00": value.T @ (scaled * value),
            "0z": value.T @ (scaled * slope),
            "z0": slope.T @ (scaled * value),
            "zz": slope.T @ (scaled * slope),
        }
